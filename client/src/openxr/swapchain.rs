//! The runtime's pictures: two layers each, one an eye, wrapped for the renderer
//! once and drawn into for as long as the session lives.

use ::openxr as xr;
use ash::vk::{self, Handle};
use wgpu::hal::vulkan as hal;

use super::HeadsetError;
use super::error::refused;
use crate::render::EyeImages;

/// Pictures that an eye is drawn into, best first, and what Vulkan calls them.
/// The atlas holds display-encoded colours, and a compositor takes those only
/// in sRGB formats: it would show the bytes of others too bright.
const COLORS: [(wgpu::TextureFormat, vk::Format); 2] = [
    (
        wgpu::TextureFormat::Rgba8UnormSrgb,
        vk::Format::R8G8B8A8_SRGB,
    ),
    (
        wgpu::TextureFormat::Bgra8UnormSrgb,
        vk::Format::B8G8R8A8_SRGB,
    ),
];
/// What the renderer keeps depth in.
const DEPTH: (wgpu::TextureFormat, vk::Format) =
    (wgpu::TextureFormat::Depth32Float, vk::Format::D32_SFLOAT);

/// A swapchain and its wrapped images.
pub(super) struct Swapchain {
    // Before the swapchain, whose images they are.
    images: Vec<EyeImages>,
    pub(super) raw: xr::Swapchain<xr::Vulkan>,
    pub(super) size: [u32; 2],
    pub(super) format: wgpu::TextureFormat,
}

impl Swapchain {
    /// Pictures of `size` pixels for the eyes.
    pub(super) fn color(
        session: &xr::Session<xr::Vulkan>,
        device: &wgpu::Device,
        size: [u32; 2],
    ) -> Result<Self, HeadsetError> {
        let offered = formats(session)?;
        let best = COLORS
            .into_iter()
            .find(|(_, vulkan)| offered.contains(&vulkan.as_raw()));
        let Some(format) = best else {
            return Err(HeadsetError::Format(
                offered.into_iter().map(i64::from).collect(),
            ));
        };
        let usage = xr::SwapchainUsageFlags::COLOR_ATTACHMENT;
        Self::new(session, device, size, format, usage)
    }

    /// Depth of `size` pixels; none where the runtime does not take ours.
    pub(super) fn depth(
        session: &xr::Session<xr::Vulkan>,
        device: &wgpu::Device,
        size: [u32; 2],
    ) -> Result<Option<Self>, HeadsetError> {
        if !formats(session)?.contains(&DEPTH.1.as_raw()) {
            return Ok(None);
        }
        let usage = xr::SwapchainUsageFlags::DEPTH_STENCIL_ATTACHMENT;
        Self::new(session, device, size, DEPTH, usage).map(Some)
    }

    fn new(
        session: &xr::Session<xr::Vulkan>,
        device: &wgpu::Device,
        size: [u32; 2],
        (format, vulkan): (wgpu::TextureFormat, vk::Format),
        usage_flags: xr::SwapchainUsageFlags,
    ) -> Result<Self, HeadsetError> {
        let raw = session
            .create_swapchain(&xr::SwapchainCreateInfo {
                create_flags: xr::SwapchainCreateFlags::EMPTY,
                usage_flags,
                format: vulkan.as_raw() as u32,
                sample_count: 1,
                width: size[0],
                height: size[1],
                face_count: 1,
                array_size: 2,
                mip_count: 1,
            })
            .map_err(refused("gave no swapchain"))?;
        let handles = raw.enumerate_images().map_err(refused("lists no images"))?;
        let images = handles
            .into_iter()
            .map(|handle| {
                let image = vk::Image::from_raw(handle);
                // SAFETY: the image was just made with this size and format, and
                // outlives the texture, which is dropped before the swapchain.
                EyeImages::from_texture(unsafe { wrap(device, image, size, format) })
            })
            .collect();
        Ok(Self {
            images,
            raw,
            size,
            format,
        })
    }

    /// The next image to draw into, once the compositor is done with it.
    pub(super) fn acquire(&mut self) -> Result<&EyeImages, HeadsetError> {
        let index = self
            .raw
            .acquire_image()
            .map_err(refused("has no image to draw into"))?;
        self.raw
            .wait_image(xr::Duration::INFINITE)
            .map_err(refused("does not let go of an image"))?;
        self.images.get(index as usize).ok_or_else(|| {
            refused("names an image that is none")(xr::sys::Result::ERROR_RUNTIME_FAILURE)
        })
    }

    /// Gives the image back, drawn.
    pub(super) fn release(&mut self) -> Result<(), HeadsetError> {
        self.raw
            .release_image()
            .map_err(refused("does not take an image"))
    }

    /// The layer of an eye, whole.
    pub(super) fn part(&self, eye: u32) -> xr::SwapchainSubImage<'_, xr::Vulkan> {
        xr::SwapchainSubImage::new()
            .swapchain(&self.raw)
            .image_array_index(eye)
            .image_rect(xr::Rect2Di {
                offset: xr::Offset2Di { x: 0, y: 0 },
                extent: xr::Extent2Di {
                    width: self.size[0] as i32,
                    height: self.size[1] as i32,
                },
            })
    }
}

fn formats(session: &xr::Session<xr::Vulkan>) -> Result<Vec<i32>, HeadsetError> {
    let formats = session
        .enumerate_swapchain_formats()
        .map_err(refused("tells no picture formats"))?;
    Ok(formats.into_iter().map(|format| format as i32).collect())
}

/// # Safety
/// `image` is one of two layers, of this size and format, on this device, and
/// outlives the texture.
unsafe fn wrap(
    device: &wgpu::Device,
    image: vk::Image,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
) -> wgpu::Texture {
    let size = wgpu::Extent3d {
        width,
        height,
        depth_or_array_layers: 2,
    };
    let uses = if format.is_depth_stencil_format() {
        wgpu::TextureUses::DEPTH_STENCIL_WRITE
    } else {
        wgpu::TextureUses::COLOR_TARGET
    };
    let described = wgpu::hal::TextureDescriptor {
        label: Some("headset"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: uses,
        memory_flags: wgpu::hal::MemoryFlags::empty(),
        view_formats: Vec::new(),
    };
    // SAFETY: the device is one of Vulkan, as is the image; the callback that
    // does nothing keeps the image the runtime's.
    unsafe {
        let texture = device
            .as_hal::<hal::Api>()
            .expect("the device was made on Vulkan")
            .texture_from_raw(
                image,
                &described,
                Some(Box::new(|| {})),
                hal::TextureMemory::External,
            );
        device.create_texture_from_hal::<hal::Api>(
            texture,
            &wgpu::TextureDescriptor {
                label: Some("headset"),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            },
        )
    }
}
