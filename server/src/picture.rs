//! From accumulated radiance to the planes that a video encoder takes.

use shadecast_shaders::picture::{PictureParameters, SOURCE};
use wgpu::ShaderStages;

use crate::{
    encode::Planes,
    gpu::{Binding, Gpu, GpuError, bind, layout},
};

/// The pass that tone-maps and converts the atlas.
#[derive(Debug)]
pub struct PictureConversion {
    size: [u32; 2],
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    parameters: wgpu::Buffer,
    planes: wgpu::Buffer,
    readback: wgpu::Buffer,
}

impl PictureConversion {
    /// For an atlas of `size` texels, multiples of 16, whose radiance is in `radiance`.
    ///
    /// # Errors
    /// When the planes are larger than the device binds.
    pub fn new(gpu: &Gpu, radiance: &wgpu::Buffer, size: [u16; 2]) -> Result<Self, GpuError> {
        let size = size.map(u32::from);
        let bytes = u64::from(size[0]) * u64::from(size[1]) * 3 / 2;
        let own_layout = layout(
            gpu,
            ShaderStages::COMPUTE,
            &[Binding::Uniform, Binding::Read, Binding::Write],
        );
        let parameters = gpu.uniform("picture parameters", size_of::<PictureParameters>());
        let planes = gpu.scratch("planes", bytes)?;
        Ok(Self {
            size,
            pipeline: gpu.compute_pipeline(SOURCE, "convert", &[&own_layout], &[]),
            group: bind(gpu, &own_layout, &[&parameters, radiance, &planes]),
            parameters,
            readback: gpu.readback("planes", bytes),
            planes,
        })
    }

    /// Records the conversion and the copy to the CPU.
    pub fn record(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, exposure: f32) {
        let parameters = PictureParameters {
            size: self.size,
            exposure,
            padding: 0,
        };
        gpu.queue
            .write_buffer(&self.parameters, 0, bytemuck::bytes_of(&parameters));
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.group, &[]);
            pass.dispatch_workgroups(self.size[0].div_ceil(64), self.size[1].div_ceil(16), 1);
        }
        encoder.copy_buffer_to_buffer(&self.planes, 0, &self.readback, 0, None);
    }

    /// Submits the recorded work and reads the planes.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn read(&self, gpu: &Gpu, encoder: wgpu::CommandEncoder) -> Result<Planes, GpuError> {
        gpu.submit_and_read(encoder, &self.readback, self.readback.size(), |bytes| {
            Planes {
                width: self.size[0],
                height: self.size[1],
                bytes: bytes.to_vec(),
            }
        })
    }
}
