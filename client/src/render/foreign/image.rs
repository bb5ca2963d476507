//! Raw Vulkan objects that live as long as something holds them.

use std::fmt;
use std::sync::Arc;

use ash::vk;
use wgpu::hal::api::Vulkan;

use super::ConvertError;

/// The Vulkan device below a device of wgpu, which it keeps alive.
pub struct RawDevice {
    raw: ash::Device,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    queue_family: u32,
    wgpu: wgpu::Device,
}

impl RawDevice {
    /// The device below `device`.
    ///
    /// # Errors
    /// It is not one of Vulkan.
    pub fn of(device: &wgpu::Device) -> Result<Arc<Self>, ConvertError> {
        // SAFETY: nothing of it is destroyed, and `wgpu` keeps it alive.
        let hal = unsafe { device.as_hal::<Vulkan>() }.ok_or(ConvertError::NotVulkan)?;
        Ok(Arc::new(Self {
            raw: hal.raw_device().clone(),
            instance: hal.shared_instance().raw_instance().clone(),
            physical: hal.raw_physical_device(),
            queue_family: hal.queue_family_index(),
            wgpu: device.clone(),
        }))
    }

    /// The device; nothing that wgpu owns may be destroyed with it.
    #[must_use]
    pub fn raw(&self) -> &ash::Device {
        &self.raw
    }

    /// The instance of the device.
    #[must_use]
    pub fn instance(&self) -> &ash::Instance {
        &self.instance
    }

    /// What the device was made of.
    #[must_use]
    pub fn physical(&self) -> vk::PhysicalDevice {
        self.physical
    }

    pub(super) fn queue_family(&self) -> u32 {
        self.queue_family
    }

    pub(super) fn wgpu(&self) -> &wgpu::Device {
        &self.wgpu
    }

    pub(super) fn encoder(&self) -> wgpu::CommandEncoder {
        self.wgpu
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Returns when the GPU is done with it, or lost.
    pub(super) fn wait_for(&self, submission: wgpu::SubmissionIndex) {
        let wait = wgpu::PollType::Wait {
            submission_index: Some(submission),
            timeout: None,
        };
        if let Err(error) = self.wgpu.poll(wait) {
            tracing::warn!("the GPU stopped answering: {error}");
        }
    }
}

impl fmt::Debug for RawDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("RawDevice")
            .field(&self.raw.handle())
            .finish()
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

/// What a [`SourceImage`] is made of.
#[derive(Clone, Copy, Debug)]
pub struct ImageParts {
    /// The image.
    pub image: vk::Image,
    /// What it is bound to; null where something else owns memory and image.
    pub memory: vk::DeviceMemory,
    /// The image as the sampler reads it.
    pub view: vk::ImageView,
    /// Width and height of the image, texels.
    pub size: [u32; 2],
    /// Whoever has the image between conversions: `QUEUE_FAMILY_FOREIGN_EXT`, or
    /// `QUEUE_FAMILY_IGNORED` where it stays with our queue, ready to be sampled.
    pub owner: u32,
}

/// A picture of the platform as an image to sample.
#[derive(Debug)]
pub struct SourceImage {
    device: Arc<RawDevice>,
    parts: ImageParts,
    sampler: Arc<SourceSampler>,
}

impl SourceImage {
    /// Takes over an image.
    ///
    /// # Safety
    /// All parts are of the sampler's device, and nothing else destroys the view,
    /// nor image and memory unless `memory` is null; then the image outlives this.
    /// Nothing but this device writes the image while the GPU converts it.
    #[must_use]
    pub unsafe fn new(parts: ImageParts, sampler: &Arc<SourceSampler>) -> Arc<Self> {
        Arc::new(Self {
            device: Arc::clone(&sampler.device),
            parts,
            sampler: Arc::clone(sampler),
        })
    }

    pub(super) fn size(&self) -> [u32; 2] {
        self.parts.size
    }

    pub(super) fn sampler(&self) -> &Arc<SourceSampler> {
        &self.sampler
    }

    pub(super) fn view(&self) -> vk::ImageView {
        self.parts.view
    }

    /// Takes the image over from its owner and makes it ready to be sampled.
    pub(super) fn acquire(&self) -> Option<vk::ImageMemoryBarrier<'static>> {
        let ours = self.device.queue_family();
        self.barrier().map(|barrier| {
            barrier
                // What a foreign owner wrote survives this, unlike our own.
                .old_layout(vk::ImageLayout::UNDEFINED)
                .new_layout(vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)
                .src_queue_family_index(self.parts.owner)
                .dst_queue_family_index(ours)
                .dst_access_mask(vk::AccessFlags::SHADER_READ)
        })
    }

    /// Gives it back.
    pub(super) fn release(&self) -> Option<vk::ImageMemoryBarrier<'static>> {
        let ours = self.device.queue_family();
        self.barrier().map(|barrier| {
            barrier
                .old_layout(vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)
                .new_layout(vk::ImageLayout::GENERAL)
                .src_queue_family_index(ours)
                .dst_queue_family_index(self.parts.owner)
                .src_access_mask(vk::AccessFlags::SHADER_READ)
        })
    }

    fn barrier(&self) -> Option<vk::ImageMemoryBarrier<'static>> {
        let is_foreign = self.parts.owner != vk::QUEUE_FAMILY_IGNORED;
        is_foreign.then(|| {
            vk::ImageMemoryBarrier::default()
                .image(self.parts.image)
                .subresource_range(COLOR)
        })
    }
}

/// The whole of an image with one level and one layer.
pub(super) const COLOR: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: 1,
};

impl Drop for SourceImage {
    fn drop(&mut self) {
        let device = self.device.raw();
        // SAFETY: ours by `new`; conversions hold this until the GPU is done.
        unsafe {
            device.destroy_image_view(self.parts.view, None);
            if self.parts.memory != vk::DeviceMemory::null() {
                device.destroy_image(self.parts.image, None);
                device.free_memory(self.parts.memory, None);
            }
        }
    }
}
