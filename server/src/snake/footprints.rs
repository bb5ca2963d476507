//! The pass that measures visible triangles.

use glam::Vec3;
use shadecast_shaders::snake::{FOOTPRINT_SOURCE, SnakeFootprintParameters};
use wgpu::ShaderStages;

use super::place::Snake;
use crate::{
    gpu::{Binding, Gpu, GpuError, GpuScene, bind, layout, workgroups},
    patches::PatchedScene,
};

/// From pixels of triangles to what the triangles deserve.
#[derive(Debug)]
pub struct SnakeFootprints {
    kernel: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    parameters: wgpu::Buffer,
    eyes: wgpu::Buffer,
    patches: u32,
}

impl SnakeFootprints {
    /// For the patches of a scene, each a triangle: `pixels` says which are visible,
    /// and the wishes of `snake` are filled in for those.
    ///
    /// # Errors
    /// When there are more patches than the device binds.
    pub fn new(
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        scene: &PatchedScene,
        pixels: &wgpu::Buffer,
        snake: &Snake,
    ) -> Result<Self, GpuError> {
        let records: Vec<[u32; 2]> = (scene.patches.iter())
            .map(|patch| [patch.first_triangle, u32::from(patch.object.0) << 8])
            .collect();
        let own_layout = layout(
            gpu,
            ShaderStages::COMPUTE,
            &[
                Binding::Uniform,
                Binding::Read,
                Binding::Read,
                Binding::Read,
                Binding::Read,
                Binding::Write,
            ],
        );
        let parameters = gpu.uniform("footprints", size_of::<SnakeFootprintParameters>());
        let patches = gpu.storage("patches", bytemuck::cast_slice(&records))?;
        let eyes = gpu.scratch("eyes", 16 * (scene.scene.objects.len() as u64 + 1))?;
        let (slots, wishes) = (snake.slots(), snake.wishes());
        let buffers = [&parameters, pixels, &patches, &eyes, slots, wishes];
        Ok(Self {
            kernel: gpu.compute_pipeline(
                FOOTPRINT_SOURCE,
                "measure_snake_footprints",
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
        let parameters = SnakeFootprintParameters {
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
