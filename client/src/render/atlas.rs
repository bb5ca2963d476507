//! The decoded picture as a texture to sample: three planes become RGBA once
//! for each picture, and never again for the pixels that look it up.

use std::sync::Arc;

use super::cover::{cover_pass, cover_pipeline};
use super::pipelines::Layouts;
use crate::{ClientFrame, MaskAtlas, YuvPicture};

/// The atlas holds display-encoded colours. An sRGB eye samples it through an
/// sRGB view, any other eye through this plain one; either way what is drawn is
/// what was decoded.
const PLAIN: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const SRGB: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

/// Converts pictures and keeps the textures of the current size.
#[derive(Debug)]
pub(super) struct Atlas {
    convert: wgpu::RenderPipeline,
    sampler: wgpu::Sampler,
    sampled_as: wgpu::TextureFormat,
    current: Option<Textures>,
    mask: Option<Mask>,
}

/// Everything that depends on the size of the picture.
#[derive(Debug)]
struct Textures {
    size: [u32; 2],
    planes: [wgpu::Texture; 3],
    rgba: wgpu::Texture,
    drawn: wgpu::TextureView,
    convert_group: wgpu::BindGroup,
    sample_group: wgpu::BindGroup,
}

#[derive(Debug)]
struct Mask {
    content: Arc<MaskAtlas>,
    texture: wgpu::Texture,
    group: wgpu::BindGroup,
}

impl Atlas {
    pub(super) fn new(device: &wgpu::Device, eye_format: wgpu::TextureFormat) -> Self {
        let module = device.create_shader_module(wgpu::include_wgsl!("yuv.wgsl"));
        let convert = cover_pipeline(device, &module, "rgb_from_yuv", None, &[], PLAIN);
        Self {
            convert,
            sampler: device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("atlas"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..wgpu::SamplerDescriptor::default()
            }),
            sampled_as: if eye_format.is_srgb() { SRGB } else { PLAIN },
            current: None,
            mask: None,
        }
    }

    /// Takes over the frame's picture and masks. The frame has been checked.
    pub(super) fn upload(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        layouts: &Layouts,
        frame: &ClientFrame,
    ) {
        let picture = &*frame.picture;
        let size = [picture.width, picture.height];
        if self
            .current
            .as_ref()
            .is_none_or(|current| current.size != size)
        {
            self.current = Some(self.textures(device, layouts, size));
        }
        if let Some(current) = &self.current {
            convert(device, queue, &self.convert, current, picture);
        }
        match &frame.masks {
            None => self.mask = None,
            Some(masks) => self.upload_mask(device, queue, layouts, masks),
        }
    }

    fn textures(&self, device: &wgpu::Device, layouts: &Layouts, size: [u32; 2]) -> Textures {
        let [width, height] = size;
        let planes = [
            plane(device, "luma", [width, height]),
            plane(device, "blue chroma", [width / 2, height / 2]),
            plane(device, "red chroma", [width / 2, height / 2]),
        ];
        let rgba = device.create_texture(&wgpu::TextureDescriptor {
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
        });
        let plane_views = planes.each_ref().map(default_view);
        let sampled = rgba.create_view(&wgpu::TextureViewDescriptor {
            format: Some(self.sampled_as),
            usage: Some(wgpu::TextureUsages::TEXTURE_BINDING),
            ..wgpu::TextureViewDescriptor::default()
        });
        Textures {
            size,
            convert_group: device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("planes"),
                layout: &self.convert.get_bind_group_layout(0),
                entries: &[0, 1, 2].map(|n| wgpu::BindGroupEntry {
                    binding: n,
                    resource: wgpu::BindingResource::TextureView(&plane_views[n as usize]),
                }),
            }),
            sample_group: device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("atlas"),
                layout: &layouts.atlas,
                entries: &[
                    wgpu::BindGroupEntry {
                        binding: 0,
                        resource: wgpu::BindingResource::TextureView(&sampled),
                    },
                    wgpu::BindGroupEntry {
                        binding: 1,
                        resource: wgpu::BindingResource::Sampler(&self.sampler),
                    },
                ],
            }),
            planes,
            drawn: default_view(&rgba),
            rgba,
        }
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
        self.current.as_ref().map(|current| &current.sample_group)
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

fn convert(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    pipeline: &wgpu::RenderPipeline,
    textures: &Textures,
    picture: &YuvPicture,
) {
    for (plane, bytes) in textures
        .planes
        .iter()
        .zip([&picture.y, &picture.u, &picture.v])
    {
        write_plane(queue, plane, bytes);
    }
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut pass = cover_pass(&mut encoder, "RGB from YUV", &textures.drawn);
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, &textures.convert_group, &[]);
    pass.draw(0..3, 0..1);
    drop(pass);
    queue.submit([encoder.finish()]);
}

fn plane(device: &wgpu::Device, label: &str, size: [u32; 2]) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: extent(size),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::R8Unorm,
        usage: wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    })
}

fn write_plane(queue: &wgpu::Queue, plane: &wgpu::Texture, bytes: &[u8]) {
    queue.write_texture(
        plane.as_image_copy(),
        bytes,
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(plane.width()),
            rows_per_image: None,
        },
        plane.size(),
    );
}

fn extent([width, height]: [u32; 2]) -> wgpu::Extent3d {
    wgpu::Extent3d {
        width,
        height,
        depth_or_array_layers: 1,
    }
}

fn default_view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}
