//! The pass that measures visible patches.

use glam::Vec3;
use shadecast_protocol::PatchShape;
use shadecast_shaders::atlas::{FOOTPRINT_SOURCE, FootprintParameters};
use wgpu::ShaderStages;

use crate::{
    gpu::{Binding, Gpu, GpuError, GpuScene, bind, layout, workgroups},
    patches::PatchedScene,
};

/// From pixels of patches to what the patches deserve.
#[derive(Debug)]
pub struct Footprints {
    kernel: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    parameters: wgpu::Buffer,
    eyes: wgpu::Buffer,
    patches: u32,
}

impl Footprints {
    /// For the patches of a scene: `pixels` says which are visible, and `wishes`
    /// is filled in for those.
    ///
    /// # Errors
    /// When there are more patches than the device binds.
    pub fn new(
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        scene: &PatchedScene,
        pixels: &wgpu::Buffer,
        wishes: &wgpu::Buffer,
    ) -> Result<Self, GpuError> {
        let records: Vec<[u32; 2]> = (scene.patches.iter())
            .map(|patch| {
                let shape = match patch.shape {
                    PatchShape::Solo => 0,
                    PatchShape::Pair => 1,
                    PatchShape::Triple => 2,
                };
                [patch.first_triangle, shape | u32::from(patch.object.0) << 8]
            })
            .collect();
        let own_layout = layout(
            gpu,
            ShaderStages::COMPUTE,
            &[
                Binding::Uniform,
                Binding::Read,
                Binding::Read,
                Binding::Read,
                Binding::Write,
            ],
        );
        let parameters = gpu.uniform("footprints", size_of::<FootprintParameters>());
        let patches = gpu.storage("patches", bytemuck::cast_slice(&records))?;
        let eyes = gpu.scratch("eyes", 16 * (scene.scene.objects.len() as u64 + 1))?;
        let buffers = [&parameters, pixels, &patches, &eyes, wishes];
        Ok(Self {
            kernel: gpu.compute_pipeline(
                FOOTPRINT_SOURCE,
                "measure_footprints",
                &[&gpu_scene.layout, &own_layout],
                &gpu_scene.constants,
            ),
            group: bind(gpu, &own_layout, &buffers),
            parameters,
            eyes,
            patches: records.len() as u32,
        })
    }

    /// Records the measuring; `eyes[n]` is the eye in the space of `ObjectId(n)`.
    pub fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        gpu_scene: &GpuScene,
        eyes: &[Vec3],
        pixels_per_radian: f32,
    ) {
        let parameters = FootprintParameters {
            patch_count: self.patches,
            pixels_per_radian,
            padding: [0; 2],
        };
        gpu.queue
            .write_buffer(&self.parameters, 0, bytemuck::bytes_of(&parameters));
        let eyes: Vec<[f32; 4]> = (eyes.iter())
            .map(|eye| eye.extend(0.0).to_array())
            .take((self.eyes.size() / 16) as usize)
            .collect();
        gpu.queue
            .write_buffer(&self.eyes, 0, bytemuck::cast_slice(&eyes));
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("footprints"),
            timestamp_writes: None,
        });
        pass.set_pipeline(&self.kernel);
        pass.set_bind_group(0, &gpu_scene.group, &[]);
        pass.set_bind_group(1, &self.group, &[]);
        let (x, y) = workgroups(self.patches, 64);
        pass.dispatch_workgroups(x, y, 1);
    }
}
