//! The textures that pictures are converted into, in turn.

use std::sync::Arc;

use ash::vk;
use wgpu::hal::api::Vulkan;

use super::image::COLOR;
use super::{ConvertError, RawDevice};
use crate::render::atlas::{default_view, target};
use crate::render::cover::cover_pass;

/// One that is drawn from, one that the GPU may still be drawing from, and one
/// to convert into.
pub(super) const RING: usize = 3;

/// Textures of one size.
#[derive(Debug)]
pub(super) struct Ring {
    size: [u32; 2],
    targets: Vec<Target>,
    next: usize,
}

/// A texture of wgpu and what it takes to draw into it without wgpu.
#[derive(Debug)]
pub(super) struct Target {
    device: Arc<RawDevice>,
    framebuffer: vk::Framebuffer,
    view: vk::ImageView,
    texture: wgpu::Texture,
}

impl Ring {
    /// Textures that wgpu takes for filled and ready to be sampled: otherwise it
    /// would clear them at their first use, after they were drawn into.
    pub(super) fn new(
        device: &Arc<RawDevice>,
        queue: &wgpu::Queue,
        render_pass: vk::RenderPass,
        size: [u32; 2],
    ) -> Result<Self, ConvertError> {
        let targets = (0..RING)
            .map(|_| Target::new(device, render_pass, size))
            .collect::<Result<Vec<_>, _>>()?;
        let mut encoder = device.encoder();
        for one in &targets {
            drop(cover_pass(
                &mut encoder,
                "prime",
                &default_view(&one.texture),
            ));
        }
        encoder.transition_resources(
            std::iter::empty(),
            targets.iter().map(|one| wgpu::wgt::TextureTransition {
                texture: &one.texture,
                selector: None,
                state: wgpu::wgt::TextureUses::RESOURCE,
            }),
        );
        queue.submit([encoder.finish()]);
        Ok(Self {
            size,
            targets,
            next: 0,
        })
    }

    pub(super) fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The place whose turn it is.
    pub(super) fn next(&mut self) -> usize {
        let slot = self.next;
        self.next = (slot + 1) % RING;
        slot
    }

    pub(super) fn target(&self, slot: usize) -> &Target {
        &self.targets[slot]
    }
}

impl Target {
    fn new(
        device: &Arc<RawDevice>,
        render_pass: vk::RenderPass,
        size: [u32; 2],
    ) -> Result<Self, ConvertError> {
        let mut this = Self {
            device: Arc::clone(device),
            framebuffer: vk::Framebuffer::null(),
            view: vk::ImageView::null(),
            texture: target(device.wgpu(), size),
        };
        // SAFETY: `texture` keeps the image alive, and the guard ends here.
        let image = unsafe { this.texture.as_hal::<Vulkan>() }
            .map(|hal| unsafe { hal.raw_handle() })
            .ok_or(ConvertError::NotVulkan)?;
        let raw = device.raw();
        let view = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(FORMAT)
            .subresource_range(COLOR);
        // SAFETY: the image is a colour attachment of this format; view and
        // framebuffer are destroyed by `drop`, before the texture.
        unsafe {
            this.view = raw
                .create_image_view(&view, None)
                .map_err(ConvertError::when("view an atlas texture"))?;
            let framebuffer = vk::FramebufferCreateInfo::default()
                .render_pass(render_pass)
                .attachments(std::slice::from_ref(&this.view))
                .width(size[0])
                .height(size[1])
                .layers(1);
            this.framebuffer =
                raw.create_framebuffer(&framebuffer, None)
                    .map_err(ConvertError::when(
                        "make a frame buffer of an atlas texture",
                    ))?;
        }
        Ok(this)
    }

    pub(super) fn texture(&self) -> &wgpu::Texture {
        &self.texture
    }

    pub(super) fn framebuffer(&self) -> vk::Framebuffer {
        self.framebuffer
    }

    pub(super) fn extent(&self) -> vk::Extent2D {
        vk::Extent2D {
            width: self.texture.width(),
            height: self.texture.height(),
        }
    }
}

/// `PLAIN` in the words of Vulkan.
pub(super) const FORMAT: vk::Format = vk::Format::R8G8B8A8_UNORM;

impl Drop for Target {
    fn drop(&mut self) {
        // SAFETY: ours; the GPU is done with both (`Converter::prepare`).
        unsafe {
            self.device
                .raw()
                .destroy_framebuffer(self.framebuffer, None);
            self.device.raw().destroy_image_view(self.view, None);
        }
    }
}
