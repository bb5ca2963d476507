//! What reads pictures of one kind, and turns YCbCr into RGB while it does.

use std::sync::Arc;

use ash::vk;

use super::{ConvertError, RawDevice};

/// What a sampler of YCbCr pictures depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureKind {
    /// Undefined where only the number names the format.
    pub format: vk::Format,
    /// The driver's number of the format, or 0.
    pub external_format: u64,
    /// Where luma and chroma are found.
    pub components: [vk::ComponentSwizzle; 4],
    /// Where chroma lies between the texels, across and down.
    pub chroma: [vk::ChromaLocation; 2],
}

impl PictureKind {
    /// That of an AHardwareBuffer.
    #[must_use]
    pub fn of(format: &vk::AndroidHardwareBufferFormatPropertiesANDROID<'_>) -> Self {
        let swizzle = format.sampler_ycbcr_conversion_components;
        Self {
            // A format that has a number is not named twice.
            format: if format.external_format == 0 {
                format.format
            } else {
                vk::Format::UNDEFINED
            },
            external_format: format.external_format,
            components: [swizzle.r, swizzle.g, swizzle.b, swizzle.a],
            chroma: [
                format.suggested_x_chroma_offset,
                format.suggested_y_chroma_offset,
            ],
        }
    }
}

/// A sampler for pictures of one kind, which pipelines are built with.
#[derive(Debug)]
pub struct SourceSampler {
    device: Arc<RawDevice>,
    sampler: vk::Sampler,
    conversion: vk::SamplerYcbcrConversion,
}

impl SourceSampler {
    /// Takes over a sampler of the nearest texel, and the conversion that it was
    /// made with, null where there is none.
    ///
    /// # Safety
    /// Both are of `device`, and nothing else destroys them.
    #[must_use]
    pub unsafe fn new(
        device: &Arc<RawDevice>,
        sampler: vk::Sampler,
        conversion: vk::SamplerYcbcrConversion,
    ) -> Arc<Self> {
        Arc::new(Self {
            device: Arc::clone(device),
            sampler,
            conversion,
        })
    }

    /// A sampler that converts what a shadecast server streams: BT.709 in limited
    /// range, whatever the buffer suggests. Chroma is taken as it is, because its
    /// neighbour may belong to another block.
    ///
    /// # Errors
    /// The device does not sample pictures of this kind.
    pub fn bt709(device: &Arc<RawDevice>, kind: PictureKind) -> Result<Arc<Self>, ConvertError> {
        let raw = device.raw();
        let [r, g, b, a] = kind.components;
        let [x, y] = kind.chroma;
        let mut external =
            vk::ExternalFormatANDROID::default().external_format(kind.external_format);
        let mut conversion = vk::SamplerYcbcrConversionCreateInfo::default()
            .format(kind.format)
            .ycbcr_model(vk::SamplerYcbcrModelConversion::YCBCR_709)
            .ycbcr_range(vk::SamplerYcbcrRange::ITU_NARROW)
            .components(vk::ComponentMapping { r, g, b, a })
            .x_chroma_offset(x)
            .y_chroma_offset(y)
            .chroma_filter(vk::Filter::NEAREST);
        if kind.external_format != 0 {
            conversion = conversion.push_next(&mut external);
        }
        // SAFETY: the infos are valid; both objects go to their owner.
        unsafe {
            let conversion = raw
                .create_sampler_ycbcr_conversion(&conversion, None)
                .map_err(ConvertError::when("convert colours of decoded pictures"))?;
            let mut chained = vk::SamplerYcbcrConversionInfo::default().conversion(conversion);
            let info = vk::SamplerCreateInfo::default()
                .address_mode_u(vk::SamplerAddressMode::CLAMP_TO_EDGE)
                .address_mode_v(vk::SamplerAddressMode::CLAMP_TO_EDGE)
                .address_mode_w(vk::SamplerAddressMode::CLAMP_TO_EDGE)
                .push_next(&mut chained);
            match raw.create_sampler(&info, None) {
                Ok(sampler) => Ok(Self::new(device, sampler, conversion)),
                Err(error) => {
                    raw.destroy_sampler_ycbcr_conversion(conversion, None);
                    Err(ConvertError::when("sample decoded pictures")(error))
                }
            }
        }
    }

    /// The conversion, which views of pictures of this kind must name too.
    #[must_use]
    pub fn conversion(&self) -> vk::SamplerYcbcrConversion {
        self.conversion
    }

    /// What it is a sampler of.
    #[must_use]
    pub fn device(&self) -> &Arc<RawDevice> {
        &self.device
    }

    pub(super) fn raw(&self) -> vk::Sampler {
        self.sampler
    }
}

impl Drop for SourceSampler {
    fn drop(&mut self) {
        let device = self.device.raw();
        // SAFETY: ours by `new`; what uses them holds this.
        unsafe {
            device.destroy_sampler(self.sampler, None);
            device.destroy_sampler_ycbcr_conversion(self.conversion, None);
        }
    }
}
