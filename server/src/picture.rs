//! From accumulated radiance to the planes that a video encoder takes.

use shadecast_protocol::Method;
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
    fills: bool,
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    parameters: wgpu::Buffer,
    planes: wgpu::Buffer,
    readback: wgpu::Buffer,
}

impl PictureConversion {
    /// For an atlas of `size` texels, multiples of 16, whose radiance is in `radiance`
    /// and which `method` fills. Rectangles leave whole blocks of the video empty, which
    /// grey makes cheapest; triangles have edges in most.
    ///
    /// # Errors
    /// When the planes are larger than the device binds.
    pub fn new(
        gpu: &Gpu,
        radiance: &wgpu::Buffer,
        size: [u16; 2],
        method: Method,
    ) -> Result<Self, GpuError> {
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
            fills: method != Method::Sas,
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
            fills: self.fills.into(),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Two macroblocks, of which a row of four texels in the first is lit.
    fn planes(method: Method) -> Planes {
        let gpu = Gpu::open().expect("a GPU");
        let mut radiance = vec![[0.0_f32; 4]; 32 * 16];
        radiance[..4].fill([0.05, 0.05, 0.05, 1.0]);
        let radiance = gpu.storage("radiance", bytemuck::cast_slice(&radiance));
        let size = [32, 16];
        let picture = PictureConversion::new(&gpu, &radiance.expect("room"), size, method);
        let picture = picture.expect("room");
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        picture.record(&gpu, &mut encoder, 1.0);
        picture.read(&gpu, encoder).expect("a GPU")
    }

    #[test]
    #[ignore = "needs a Vulkan driver"]
    fn gaps_show_the_mean_of_what_is_about_them() {
        let [grey, filled] = [Method::Sas, Method::Snake].map(planes);
        let lit = grey.y()[0];
        assert!(lit < 100 && filled.y()[..4] == [lit; 4] && grey.y()[..4] == [lit; 4]);
        for y in 0..16 {
            for x in 4..32 {
                let at = y * 32 + x;
                assert_eq!(grey.y()[at].abs_diff(125) <= 1, y > 0 || x > 3, "{x} {y}");
                let expected = if x < 16 { lit } else { grey.y()[at] };
                assert_eq!(filled.y()[at], expected, "{x} {y}");
            }
        }
    }
}
