//! A picture of the platform as an image, and whose it is when.

use std::sync::Arc;

use ash::vk;

use super::{RawDevice, SourceSampler};

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
            device: Arc::clone(sampler.device()),
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
