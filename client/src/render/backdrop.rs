//! A picture that is drawn as it is: the sky, a panel.

/// Display-encoded RGBA, row by row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Picture<'a> {
    pub(super) label: &'static str,
    /// Pixels.
    pub(super) size: [u32; 2],
    pub(super) rgba: &'a [u8],
    /// What is beyond its left and right sides.
    pub(super) sideways: wgpu::AddressMode,
}

impl Picture<'_> {
    /// Binds its texture and, one further, how it is looked up.
    pub(super) fn bind(
        self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        eye_format: wgpu::TextureFormat,
        layout: &wgpu::BindGroupLayout,
        first_binding: u32,
    ) -> wgpu::BindGroup {
        // Like the atlas, it holds display-encoded colours.
        let format = if eye_format.is_srgb() {
            wgpu::TextureFormat::Rgba8UnormSrgb
        } else {
            wgpu::TextureFormat::Rgba8Unorm
        };
        let label = Some(self.label);
        let [width, height] = self.size;
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label,
            size: wgpu::Extent3d {
                width,
                height,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        queue.write_texture(
            texture.as_image_copy(),
            self.rgba,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(width * 4),
                rows_per_image: None,
            },
            texture.size(),
        );
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label,
            address_mode_u: self.sideways,
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label,
            layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: first_binding,
                    resource: wgpu::BindingResource::TextureView(&view),
                },
                wgpu::BindGroupEntry {
                    binding: first_binding + 1,
                    resource: wgpu::BindingResource::Sampler(&sampler),
                },
            ],
        })
    }
}
