//! The surroundings, where no triangle is.

use shadecast_protocol::Sky;

use super::{backdrop, pipelines::Pipelines};

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
        let rgba: Vec<u8> = sky
            .rgb
            .chunks_exact(3)
            .flat_map(|pixel| [pixel[0], pixel[1], pixel[2], 255])
            .collect();
        let picture = backdrop::Picture {
            label: "sky",
            size: [sky.width.into(), sky.height.into()],
            rgba: &rgba,
            // Columns go round, rows end at the poles.
            sideways: wgpu::AddressMode::Repeat,
        };
        let layout = &pipelines.layouts().sky;
        let group = picture.bind(device, queue, eye_format, layout, 2);
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
