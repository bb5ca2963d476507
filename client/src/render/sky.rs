//! The surroundings, where no triangle is.

use shadecast_protocol::Sky;

use super::pipelines::Pipelines;

/// A sky picture that is drawn behind everything.
#[derive(Debug)]
pub(super) struct SkyPass {
    pipeline: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
}

impl SkyPass {
    /// None where the picture is empty or not of the size that it says.
    pub(super) fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        pipelines: &Pipelines,
        eye_format: wgpu::TextureFormat,
        sky: &Sky,
    ) -> Option<Self> {
        let pixels = usize::from(sky.width) * usize::from(sky.height);
        if pixels == 0 || sky.rgb.len() != pixels * 3 {
            return None;
        }
        // Like the atlas, it holds display-encoded colours.
        let format = if eye_format.is_srgb() {
            wgpu::TextureFormat::Rgba8UnormSrgb
        } else {
            wgpu::TextureFormat::Rgba8Unorm
        };
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("sky"),
            size: wgpu::Extent3d {
                width: sky.width.into(),
                height: sky.height.into(),
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let rgba: Vec<u8> = sky
            .rgb
            .chunks_exact(3)
            .flat_map(|pixel| [pixel[0], pixel[1], pixel[2], 255])
            .collect();
        queue.write_texture(
            texture.as_image_copy(),
            &rgba,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(u32::from(sky.width) * 4),
                rows_per_image: None,
            },
            texture.size(),
        );
        // Columns go round, rows end at the poles.
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("sky"),
            address_mode_u: wgpu::AddressMode::Repeat,
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("sky"),
            layout: &pipelines.layouts().sky,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 2,
                    resource: wgpu::BindingResource::TextureView(
                        &texture.create_view(&wgpu::TextureViewDescriptor::default()),
                    ),
                },
                wgpu::BindGroupEntry {
                    binding: 3,
                    resource: wgpu::BindingResource::Sampler(&sampler),
                },
            ],
        });
        Some(Self {
            pipeline: pipelines.build_sky(device),
            group,
        })
    }

    /// Draws over what is left at the clear depth.
    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, world_rays_from_ndc: &[u8]) {
        pass.set_pipeline(&self.pipeline);
        pass.set_immediates(0, world_rays_from_ndc);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..3, 0..1);
    }
}
