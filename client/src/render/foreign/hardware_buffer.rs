//! AHardwareBuffers as images that Vulkan samples.
//!
//! What a decoder fills has a format of its own, which Vulkan knows by a number
//! and reads through a sampler that converts YCbCr. Nothing here calls Android: a
//! buffer is a pointer, and what holds it is the caller's.
//!
//! Source: VK_ANDROID_external_memory_android_hardware_buffer.

use std::any::Any;
use std::collections::HashMap;
use std::ffi::CStr;
use std::fmt;
use std::sync::Arc;

use ash::android::external_memory_android_hardware_buffer as hardware_buffer;
use ash::vk;

use super::super::vulkan::{Extras, VulkanGpu};
use super::{ConvertError, ImageParts, PictureKind, RawDevice, SourceImage, SourceSampler};

/// Images that are kept at most; a codec goes round in fewer buffers.
const MOST_IMAGES: usize = 32;

/// Imports buffers, and keeps what it made of them, since they come again.
pub struct HardwareBuffers {
    device: Arc<RawDevice>,
    functions: hardware_buffer::Device,
    /// By address, which no other buffer has while this one is held.
    images: HashMap<usize, Kept>,
    sampler: Option<(PictureKind, Arc<SourceSampler>)>,
}

struct Kept {
    image: Arc<SourceImage>,
    _buffer: Box<dyn Any + Send>,
}

/// A buffer, as its platform describes it.
#[derive(Clone, Copy, Debug)]
pub struct BufferParts {
    /// Where it is.
    pub buffer: *mut vk::AHardwareBuffer,
    /// Width and height, texels.
    pub size: [u32; 2],
}

/// What Vulkan says of a buffer.
struct Properties {
    kind: PictureKind,
    allocation_size: vk::DeviceSize,
    memory_types: u32,
}

impl HardwareBuffers {
    /// Device extensions without which a buffer does not become an image.
    const EXTENSIONS: [&CStr; 2] = [hardware_buffer::NAME, ash::ext::queue_family_foreign::NAME];

    /// What it needs of a device.
    #[must_use]
    pub fn extras() -> Extras {
        Extras {
            extensions: Self::EXTENSIONS.into(),
            ycbcr: true,
        }
    }

    /// For a device that was opened with these [`extras`](Self::extras).
    ///
    /// # Errors
    /// The device does not have them.
    pub fn new(vulkan: &VulkanGpu) -> Result<Self, ConvertError> {
        for name in Self::EXTENSIONS {
            if !vulkan.extensions.contains(&name) {
                let name = name.to_string_lossy();
                let message = format!("the GPU driver lacks {name}");
                return Err(ConvertError::Picture(message));
            }
        }
        if !vulkan.ycbcr {
            let message = "the GPU driver does not sample YCbCr";
            return Err(ConvertError::Picture(message.into()));
        }
        let device = RawDevice::of(&vulkan.gpu.device)?;
        Ok(Self {
            functions: hardware_buffer::Device::new(device.instance(), device.raw()),
            device,
            images: HashMap::new(),
            sampler: None,
        })
    }

    /// The image of a buffer; `hold` is called where it is a new one, and what it
    /// returns is dropped with the image.
    ///
    /// # Errors
    /// Vulkan does not take it.
    ///
    /// # Safety
    /// The buffer is valid for as long as this lasts, and then for as long as what
    /// `hold` returned.
    pub unsafe fn image(
        &mut self,
        parts: BufferParts,
        hold: impl FnOnce() -> Box<dyn Any + Send>,
    ) -> Result<Arc<SourceImage>, ConvertError> {
        let address = parts.buffer.addr();
        if let Some(kept) = self.images.get(&address) {
            return Ok(Arc::clone(&kept.image));
        }
        let image = self.import(parts)?;
        if self.images.len() >= MOST_IMAGES {
            self.images.clear();
        }
        let kept = Kept {
            image: Arc::clone(&image),
            _buffer: hold(),
        };
        self.images.insert(address, kept);
        Ok(image)
    }

    fn import(
        &mut self,
        BufferParts { buffer, size }: BufferParts,
    ) -> Result<Arc<SourceImage>, ConvertError> {
        let properties = self.properties(buffer)?;
        let sampler = self.sampler(properties.kind)?;
        let mut parts = ImageParts {
            image: vk::Image::null(),
            memory: vk::DeviceMemory::null(),
            view: vk::ImageView::null(),
            size,
            owner: vk::QUEUE_FAMILY_FOREIGN_EXT,
        };
        // SAFETY: the buffer is held by the caller, its description is Vulkan's
        // own; what was made is given away, or destroyed here.
        unsafe {
            let made = self.make(buffer, &properties, &sampler, &mut parts);
            if let Err(error) = made {
                let raw = self.device.raw();
                raw.destroy_image(parts.image, None);
                raw.free_memory(parts.memory, None);
                return Err(error);
            }
            Ok(SourceImage::new(parts, &sampler))
        }
    }

    fn properties(&self, buffer: *mut vk::AHardwareBuffer) -> Result<Properties, ConvertError> {
        let mut format = vk::AndroidHardwareBufferFormatPropertiesANDROID::default();
        let mut whole =
            vk::AndroidHardwareBufferPropertiesANDROID::default().push_next(&mut format);
        // SAFETY: the buffer is held by the caller.
        unsafe {
            self.functions
                .get_android_hardware_buffer_properties(buffer, &mut whole)
        }
        .map_err(ConvertError::when("read what a decoded picture is like"))?;
        let (allocation_size, memory_types) = (whole.allocation_size, whole.memory_type_bits);
        if memory_types == 0 {
            return Err(ConvertError::Picture(
                "a decoded picture lies where the GPU does not reach".into(),
            ));
        }
        Ok(Properties {
            kind: PictureKind::of(&format),
            allocation_size,
            memory_types,
        })
    }

    /// The sampler for pictures of a kind; the same for as long as that lasts.
    fn sampler(&mut self, kind: PictureKind) -> Result<Arc<SourceSampler>, ConvertError> {
        if let Some((_, sampler)) = self.sampler.as_ref().filter(|(now, _)| *now == kind) {
            return Ok(Arc::clone(sampler));
        }
        tracing::info!("decoded pictures: {kind:?}");
        let sampler = SourceSampler::bt709(&self.device, kind)?;
        // Images are viewed through the sampler that they were made for.
        self.images.clear();
        self.sampler = Some((kind, Arc::clone(&sampler)));
        Ok(sampler)
    }

    /// Makes the image, its memory and its view, in this order.
    ///
    /// # Safety
    /// The properties are those of the buffer, the sampler is for their kind.
    unsafe fn make(
        &self,
        buffer: *mut vk::AHardwareBuffer,
        properties: &Properties,
        sampler: &SourceSampler,
        parts: &mut ImageParts,
    ) -> Result<(), ConvertError> {
        let raw = self.device.raw();
        let [width, height] = parts.size;
        let mut external =
            vk::ExternalFormatANDROID::default().external_format(properties.kind.external_format);
        let mut handles = vk::ExternalMemoryImageCreateInfo::default()
            .handle_types(vk::ExternalMemoryHandleTypeFlags::ANDROID_HARDWARE_BUFFER_ANDROID);
        let image = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(properties.kind.format)
            .extent(vk::Extent3D {
                width,
                height,
                depth: 1,
            })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(vk::ImageUsageFlags::SAMPLED)
            .push_next(&mut handles)
            .push_next(&mut external);
        // SAFETY: by the caller's word the infos are valid; memory is asked for
        // as the buffer's properties say, since the image has none of its own to
        // ask for before it is bound.
        unsafe {
            parts.image = raw
                .create_image(&image, None)
                .map_err(ConvertError::when("make an image of a decoded picture"))?;
            let mut import = vk::ImportAndroidHardwareBufferInfoANDROID::default().buffer(buffer);
            let mut dedicated = vk::MemoryDedicatedAllocateInfo::default().image(parts.image);
            let memory = vk::MemoryAllocateInfo::default()
                .allocation_size(properties.allocation_size)
                .memory_type_index(properties.memory_types.trailing_zeros())
                .push_next(&mut import)
                .push_next(&mut dedicated);
            parts.memory = raw
                .allocate_memory(&memory, None)
                .map_err(ConvertError::when("import a decoded picture"))?;
            raw.bind_image_memory(parts.image, parts.memory, 0)
                .map_err(ConvertError::when("bind a decoded picture"))?;
            let mut conversion =
                vk::SamplerYcbcrConversionInfo::default().conversion(sampler.conversion());
            let view = vk::ImageViewCreateInfo::default()
                .image(parts.image)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(properties.kind.format)
                .subresource_range(
                    vk::ImageSubresourceRange::default()
                        .aspect_mask(vk::ImageAspectFlags::COLOR)
                        .level_count(1)
                        .layer_count(1),
                )
                .push_next(&mut conversion);
            parts.view = raw
                .create_image_view(&view, None)
                .map_err(ConvertError::when("view a decoded picture"))?;
        }
        Ok(())
    }
}

impl fmt::Debug for HardwareBuffers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HardwareBuffers")
            .field("kept", &self.images.len())
            .finish_non_exhaustive()
    }
}
