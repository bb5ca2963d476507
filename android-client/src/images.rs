//! Pictures in AHardwareBuffers as images that Vulkan samples.
//!
//! What a decoder fills has a format of its own, which Vulkan knows by a number
//! and reads through a sampler that converts YCbCr.
//!
//! Source: VK_ANDROID_external_memory_android_hardware_buffer.

use std::any::Any;
use std::collections::HashMap;
use std::ffi::CStr;
use std::sync::Arc;

use ash::vk;
use ndk::hardware_buffer::{HardwareBuffer, HardwareBufferRef};
use shadecast_client::render::foreign::{
    ConvertError, ImageParts, ImageSource, PictureKind, RawDevice, SourceImage, SourceSampler,
};

use crate::codec::HeldImage;

/// Device extensions without which a buffer does not become an image.
pub(crate) const EXTENSIONS: [&CStr; 2] = [
    ash::android::external_memory_android_hardware_buffer::NAME,
    ash::ext::queue_family_foreign::NAME,
];

/// Images that are kept at most; a codec goes round in fewer buffers.
const MOST_IMAGES: usize = 32;

/// Imports buffers, and keeps what it made of them, since they come again.
pub(crate) struct Images {
    device: Arc<RawDevice>,
    hardware_buffers: ash::android::external_memory_android_hardware_buffer::Device,
    /// By address, which no other buffer has while this one is held.
    images: HashMap<usize, Kept>,
    sampler: Option<(PictureKind, Arc<SourceSampler>)>,
}

struct Kept {
    image: Arc<SourceImage>,
    _buffer: HardwareBufferRef,
}

// SAFETY: references to buffers are counted atomically, and may be given up on
// any thread.
unsafe impl Send for Kept {}

/// What Vulkan says of a buffer.
struct Properties {
    kind: PictureKind,
    allocation_size: vk::DeviceSize,
    memory_types: u32,
}

impl Images {
    /// For a device that has [`EXTENSIONS`] and samples YCbCr.
    pub(crate) fn new(device: &wgpu::Device) -> Result<Self, ConvertError> {
        let device = RawDevice::of(device)?;
        Ok(Self {
            hardware_buffers: ash::android::external_memory_android_hardware_buffer::Device::new(
                device.instance(),
                device.raw(),
            ),
            device,
            images: HashMap::new(),
            sampler: None,
        })
    }

    fn import(&mut self, buffer: &HardwareBuffer) -> Result<Arc<SourceImage>, ConvertError> {
        let properties = self.properties(buffer)?;
        let sampler = self.sampler(properties.kind)?;
        let description = buffer.describe();
        let size = [description.width, description.height];
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

    fn properties(&self, buffer: &HardwareBuffer) -> Result<Properties, ConvertError> {
        let mut format = vk::AndroidHardwareBufferFormatPropertiesANDROID::default();
        let mut whole =
            vk::AndroidHardwareBufferPropertiesANDROID::default().push_next(&mut format);
        // SAFETY: the buffer is held by the caller.
        unsafe {
            self.hardware_buffers
                .get_android_hardware_buffer_properties(buffer.as_ptr().cast(), &mut whole)
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
        buffer: &HardwareBuffer,
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
            let mut import = vk::ImportAndroidHardwareBufferInfoANDROID::default()
                .buffer(buffer.as_ptr().cast());
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

impl std::fmt::Debug for Images {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Images")
            .field("kept", &self.images.len())
            .finish_non_exhaustive()
    }
}

impl ImageSource for Images {
    fn image(
        &mut self,
        picture: &(dyn Any + Send + Sync),
    ) -> Result<Arc<SourceImage>, ConvertError> {
        let held = picture
            .downcast_ref::<HeldImage>()
            .ok_or_else(|| ConvertError::Picture("a picture of no codec of this device".into()))?;
        let buffer = held
            .buffer()
            .map_err(|error| ConvertError::Picture(format!("a picture has no buffer: {error}")))?;
        let address = buffer.as_ptr().addr();
        if let Some(kept) = self.images.get(&address) {
            return Ok(Arc::clone(&kept.image));
        }
        let image = self.import(&buffer)?;
        if self.images.len() >= MOST_IMAGES {
            self.images.clear();
        }
        let kept = Kept {
            image: Arc::clone(&image),
            _buffer: buffer.acquire(),
        };
        self.images.insert(address, kept);
        Ok(image)
    }
}
