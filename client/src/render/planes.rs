//! A picture in memory becomes RGBA: three planes are uploaded and drawn into
//! one texture.

use super::atlas::{PLAIN, default_view, extent, target};
use super::cover::{cover_pass, cover_pipeline};
use crate::YuvPicture;

/// Converts pictures and keeps the textures of the current size.
#[derive(Debug)]
pub(super) struct Planes {
    pipeline: wgpu::RenderPipeline,
    current: Option<Textures>,
}

/// Everything that depends on the size of the picture.
#[derive(Debug)]
struct Textures {
    size: [u32; 2],
    planes: [wgpu::Texture; 3],
    rgba: wgpu::Texture,
    drawn: wgpu::TextureView,
    group: wgpu::BindGroup,
}

impl Planes {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let module = device.create_shader_module(wgpu::include_wgsl!("yuv.wgsl"));
        Self {
            pipeline: cover_pipeline(device, &module, "rgb_from_yuv", None, &[], PLAIN),
            current: None,
        }
    }

    /// The picture, which has been checked, as RGBA. The same texture as long as
    /// the size lasts.
    pub(super) fn convert(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        picture: &YuvPicture,
    ) -> wgpu::Texture {
        let size = [picture.width, picture.height];
        let textures = match &mut self.current {
            Some(current) if current.size == size => current,
            current => current.insert(textures(device, &self.pipeline, size)),
        };
        for (plane, bytes) in textures
            .planes
            .iter()
            .zip([&picture.y, &picture.u, &picture.v])
        {
            write_plane(queue, plane, bytes);
        }
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = cover_pass(&mut encoder, "RGB from YUV", &textures.drawn);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &textures.group, &[]);
        pass.draw(0..3, 0..1);
        drop(pass);
        queue.submit([encoder.finish()]);
        textures.rgba.clone()
    }
}

fn textures(device: &wgpu::Device, pipeline: &wgpu::RenderPipeline, size: [u32; 2]) -> Textures {
    let [width, height] = size;
    let planes = [
        plane(device, "luma", [width, height]),
        plane(device, "blue chroma", [width / 2, height / 2]),
        plane(device, "red chroma", [width / 2, height / 2]),
    ];
    let views = planes.each_ref().map(default_view);
    let rgba = target(device, size);
    Textures {
        size,
        group: device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("planes"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[0, 1, 2].map(|n| wgpu::BindGroupEntry {
                binding: n,
                resource: wgpu::BindingResource::TextureView(&views[n as usize]),
            }),
        }),
        planes,
        drawn: default_view(&rgba),
        rgba,
    }
}

/// A texture of bytes.
pub(super) fn plane(device: &wgpu::Device, label: &str, size: [u32; 2]) -> wgpu::Texture {
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

/// Fills it.
pub(super) fn write_plane(queue: &wgpu::Queue, plane: &wgpu::Texture, bytes: &[u8]) {
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
