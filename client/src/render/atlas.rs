//! The decoded picture as a texture to sample. It becomes RGBA once for each
//! picture, and never again for the pixels that look it up: planes in memory by
//! `planes`, what a hardware decoder left on the GPU by `foreign`.

use std::sync::Arc;

#[cfg(feature = "vulkan")]
use super::foreign::Converter;
use super::pipelines::Layouts;
use super::planes::{Planes, plane, write_plane};
use super::renderer::UploadError;
use crate::{ClientFrame, DecodedPicture, ForeignPicture, MaskAtlas};

/// The atlas holds display-encoded colours. An sRGB eye samples it through an
/// sRGB view, any other eye through this plain one; either way what is drawn is
/// what was decoded.
pub(super) const PLAIN: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const SRGB: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

/// Converts pictures and keeps the newest.
#[derive(Debug)]
pub(super) struct Atlas {
    sampler: wgpu::Sampler,
    sampled_as: wgpu::TextureFormat,
    /// Built with the first picture in memory.
    planes: Option<Planes>,
    #[cfg(feature = "vulkan")]
    pub(super) foreign: Option<Converter>,
    current: Option<Sampled>,
    mask: Option<Mask>,
}

/// A converted picture and how the shaders see it.
#[derive(Debug)]
struct Sampled {
    rgba: wgpu::Texture,
    group: wgpu::BindGroup,
}

#[derive(Debug)]
struct Mask {
    content: Arc<MaskAtlas>,
    texture: wgpu::Texture,
    group: wgpu::BindGroup,
}

impl Atlas {
    pub(super) fn new(device: &wgpu::Device, eye_format: wgpu::TextureFormat) -> Self {
        Self {
            sampler: device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("atlas"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..wgpu::SamplerDescriptor::default()
            }),
            sampled_as: if eye_format.is_srgb() { SRGB } else { PLAIN },
            planes: None,
            #[cfg(feature = "vulkan")]
            foreign: None,
            current: None,
            mask: None,
        }
    }

    /// Takes over the frame's picture and masks. The frame has been checked.
    ///
    /// # Errors
    /// A picture of the platform cannot be converted; nothing has changed.
    pub(super) fn upload(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        layouts: &Layouts,
        frame: &ClientFrame,
    ) -> Result<(), UploadError> {
        let rgba = match &frame.picture {
            DecodedPicture::Planes(picture) => self
                .planes
                .get_or_insert_with(|| Planes::new(device))
                .convert(device, queue, picture),
            DecodedPicture::Foreign(picture) => self.convert_foreign(queue, picture)?,
        };
        if self.texture() != Some(&rgba) {
            self.current = Some(self.sampled(device, layouts, rgba));
        }
        match &frame.masks {
            None => self.mask = None,
            Some(masks) => self.upload_mask(device, queue, layouts, masks),
        }
        Ok(())
    }

    #[cfg(feature = "vulkan")]
    fn convert_foreign(
        &mut self,
        queue: &wgpu::Queue,
        picture: &ForeignPicture,
    ) -> Result<wgpu::Texture, UploadError> {
        let converter = self.foreign.as_mut().ok_or(UploadError::NoConverter)?;
        Ok(converter.convert(queue, picture)?)
    }

    #[cfg(not(feature = "vulkan"))]
    #[expect(clippy::unused_self, reason = "the other one needs it")]
    fn convert_foreign(
        &mut self,
        _: &wgpu::Queue,
        _: &ForeignPicture,
    ) -> Result<wgpu::Texture, UploadError> {
        Err(UploadError::NoConverter)
    }

    fn sampled(&self, device: &wgpu::Device, layouts: &Layouts, rgba: wgpu::Texture) -> Sampled {
        let view = rgba.create_view(&wgpu::TextureViewDescriptor {
            format: Some(self.sampled_as),
            usage: Some(wgpu::TextureUsages::TEXTURE_BINDING),
            ..wgpu::TextureViewDescriptor::default()
        });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("atlas"),
            layout: &layouts.atlas,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&view),
                },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: wgpu::BindingResource::Sampler(&self.sampler),
                },
            ],
        });
        Sampled { rgba, group }
    }

    fn upload_mask(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        layouts: &Layouts,
        masks: &Arc<MaskAtlas>,
    ) {
        let size = [masks.width, masks.height];
        match &mut self.mask {
            Some(mask) if Arc::ptr_eq(&mask.content, masks) => return,
            Some(mask) if mask.texture.size() == extent(size) => {
                mask.content = Arc::clone(masks);
            }
            _ => {
                let texture = plane(device, "mask", size);
                let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("mask"),
                    layout: &layouts.mask,
                    entries: &[wgpu::BindGroupEntry {
                        binding: 0,
                        resource: wgpu::BindingResource::TextureView(&default_view(&texture)),
                    }],
                });
                self.mask = Some(Mask {
                    content: Arc::clone(masks),
                    texture,
                    group,
                });
            }
        }
        if let Some(mask) = &self.mask {
            write_plane(queue, &mask.texture, &masks.coverage);
        }
    }

    /// What the patches sample; none before the first picture.
    pub(super) fn group(&self) -> Option<&wgpu::BindGroup> {
        self.current.as_ref().map(|current| &current.group)
    }

    /// Present only where the frame has masks.
    pub(super) fn mask_group(&self) -> Option<&wgpu::BindGroup> {
        self.mask.as_ref().map(|mask| &mask.group)
    }

    /// The converted picture.
    pub(super) fn texture(&self) -> Option<&wgpu::Texture> {
        self.current.as_ref().map(|current| &current.rgba)
    }
}

/// What a picture is converted into.
pub(super) fn target(device: &wgpu::Device, size: [u32; 2]) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some("atlas"),
        size: extent(size),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: PLAIN,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[SRGB],
    })
}

pub(super) fn extent([width, height]: [u32; 2]) -> wgpu::Extent3d {
    wgpu::Extent3d {
        width,
        height,
        depth_or_array_layers: 1,
    }
}

pub(super) fn default_view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}
