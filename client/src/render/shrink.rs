//! Antialiasing by drawing the eyes twice as wide and high and taking means.
//!
//! Multisampling would be cheaper, but software drivers get its resolve into
//! layers and its centroids wrong, and then atlas lookups leave their blocks.

use super::{
    EyeImages,
    cover::{cover_pass, cover_pipeline},
};

/// Pictures twice as large as the eyes, and the pass that shrinks them.
#[derive(Debug)]
pub(super) struct Shrink {
    large: EyeImages,
    groups: [wgpu::BindGroup; 2],
    pipeline: wgpu::RenderPipeline,
}

impl Shrink {
    /// For eyes of `eye_size` pixels.
    pub(super) fn new(
        device: &wgpu::Device,
        eye_size: [u32; 2],
        format: wgpu::TextureFormat,
    ) -> Self {
        let large = EyeImages::new(device, eye_size.map(|side| side * 2), format);
        let module = device.create_shader_module(wgpu::include_wgsl!("shrink.wgsl"));
        let pipeline = cover_pipeline(
            device,
            &module,
            "shrink",
            None,
            &[("IS_ENCODED", f64::from(!format.is_srgb()))],
            format,
        );
        let layout = pipeline.get_bind_group_layout(0);
        let groups = large.layers().each_ref().map(|layer| {
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("shrink"),
                layout: &layout,
                entries: &[wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(layer),
                }],
            })
        });
        Self {
            large,
            groups,
            pipeline,
        }
    }

    /// What to draw the eyes into.
    pub(super) fn large(&self) -> &EyeImages {
        &self.large
    }

    /// Shrinks both eyes into `target`.
    pub(super) fn draw(&self, encoder: &mut wgpu::CommandEncoder, target: &EyeImages) {
        for (group, view) in self.groups.iter().zip(target.layers()) {
            let mut pass = cover_pass(encoder, "shrink", view);
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.draw(0..3, 0..1);
        }
    }
}
