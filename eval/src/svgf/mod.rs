//! The baseline: screen-space filtering of fresh path-traced frames.
//!
//! Every frame traces a few paths a pixel by the integrator that also lights the
//! atlas, blends them with what the frames before saw of the same points, smooths
//! the result along surfaces as far as its variance asks for, and antialiases it
//! over time. Nothing but pixels is remembered, so that what was hidden, or outside
//! of the picture, is noisy when it comes into view.
//!
//! Source: Schied et al., "Spatiotemporal Variance-Guided Filtering: Real-Time
//! Reconstruction for Path-Traced Global Illumination", HPG 2017. We differ in
//! tracing primary rays instead of rasterising, in several paths a pixel that share
//! one (four in Kravec, "Realistic Remote Rendering for VR and Mobile Devices",
//! 2020, section 4.4), and in blending pictures before the tone curve.

mod passes;
mod records;
#[cfg(test)]
mod tests;

use bytemuck::Pod;
use glam::{Mat3, Vec3};
use shadecast_protocol::Pose;
use shadecast_server::{
    Gpu, GpuError, GpuScene,
    kernels::{Ends, Paths},
    still::Still,
};
use shadecast_shaders::light::rows_of_affine;
use wgpu::{Buffer, CommandEncoder, CommandEncoderDescriptor, ComputePassDescriptor};

use self::{
    passes::{FilterPasses, LightPasses},
    records::{MOST_INSTANCES, Records, View},
};

/// A picture that is path-traced and filtered frame by frame.
#[derive(Debug)]
pub struct Svgf {
    size: [u32; 2],
    paths: Paths,
    records: Records,
    light: LightPasses,
    filter: FilterPasses,
    /// Camera of the frame before, its tangents, and how many frames are remembered.
    before: (Pose, [f32; 4]),
    age: u32,
    /// All frames, and all samples of a pixel, forgotten or not.
    frames: u32,
    samples: u32,
}

impl Svgf {
    /// Compiles the kernels for what the scene needs, for pictures of this width
    /// and height, at least a pixel.
    ///
    /// # Errors
    /// When the device has no room for a wave of paths or the picture's records.
    pub fn new(gpu: &Gpu, gpu_scene: &GpuScene, size: [u32; 2]) -> Result<Self, GpuError> {
        let size = size.map(|side| side.max(1));
        let paths = Paths::new(gpu, gpu_scene, u32::MAX)?;
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let records = Records::new(gpu, pixels, u64::from(paths.longest_wave()))?;
        Ok(Self {
            size,
            light: LightPasses::new(gpu, gpu_scene, &paths, &records),
            filter: FilterPasses::new(gpu, &records),
            paths,
            records,
            before: (Pose::IDENTITY, [0.0; 4]),
            age: 0,
            frames: 0,
            samples: 0,
        })
    }

    /// Adds a frame of `samples` paths a pixel, one at least, seen from `view`, a
    /// pose and its tangents; objects stand where they were last moved to. Frames
    /// of one seed continue one sequence of samples.
    pub fn frame(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        view: (Pose, [f32; 4]),
        samples: u32,
        seed: u32,
    ) {
        let pixels = self.size[0] * self.size[1];
        let samples = samples.clamp(1, u32::MAX / pixels);
        let rows = |pose: Pose| rows_of_affine(Mat3::from_quat(pose.orientation), pose.position);
        let values = View {
            world_from_eye: rows(view.0),
            eye_from_world_before: rows(self.before.0.inverse()),
            tangents: view.1,
            tangents_before: self.before.1,
            size: self.size,
            jitter: jitter(self.frames),
            sample_index: self.samples,
            seed,
            samples,
            age: self.age,
        };
        gpu.queue
            .write_buffer(&self.records.view, 0, bytemuck::bytes_of(&values));
        let scene = (gpu_scene, &self.paths);
        submit(gpu, |encoder| {
            for kept in self.records.kept() {
                encoder.copy_buffer_to_buffer(&kept.now, 0, &kept.before, 0, None);
            }
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
            let see = &self.light.see;
            self.light.dispatch(&mut pass, see, scene, pixels);
        });
        let ends = Ends {
            start: &self.light.start,
            before_finish: None,
            finish: &self.light.gather,
            group: &self.light.group,
            from_camera: false,
        };
        self.paths.follow(gpu, gpu_scene, ends, pixels * samples);
        submit(gpu, |encoder| {
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
            let remember = &self.light.remember;
            self.light
                .dispatch(&mut pass, remember, scene, MOST_INSTANCES);
            self.filter.dispatch(&mut pass, pixels);
        });
        self.before = view;
        self.age = self.age.saturating_add(1);
        self.frames = self.frames.wrapping_add(1);
        self.samples = self.samples.wrapping_add(samples);
    }

    /// Forgets all frames, as at a cut.
    pub fn forget(&mut self) {
        self.age = 0;
    }

    /// The picture after the last frame; waits for it.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn read(&self, gpu: &Gpu) -> Result<Still, GpuError> {
        let picture = &self.records.picture.now;
        let [width, height] = self.size;
        Ok(Still {
            width,
            height,
            radiance: read(gpu, picture, |[r, g, b, _]: [f32; 4]| Vec3::new(r, g, b))?,
        })
    }

    /// Frames behind the light of each pixel, row by row from the top; zero where
    /// the sky is seen.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn histories(&self, gpu: &Gpu) -> Result<Vec<f32>, GpuError> {
        read(gpu, &self.records.moments.now, |moments: [f32; 6]| {
            moments[4]
        })
    }
}

/// Where in their pixels the rays of a frame are: evenly spread over any few frames.
/// Source: Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018.
fn jitter(frame: u32) -> [f32; 2] {
    // One over the plastic number, and over its square.
    [0.754_877_666_246_692_8, 0.569_840_290_998_053_3]
        .map(|step: f64| (0.5 + step * f64::from(frame)).fract() as f32)
}

fn submit(gpu: &Gpu, record: impl FnOnce(&mut CommandEncoder)) {
    let mut encoder = gpu
        .device
        .create_command_encoder(&CommandEncoderDescriptor::default());
    record(&mut encoder);
    gpu.queue.submit([encoder.finish()]);
}

fn read<T: Pod, U>(gpu: &Gpu, buffer: &Buffer, each: impl Fn(T) -> U) -> Result<Vec<U>, GpuError> {
    let records = gpu.read(buffer, 0..buffer.size())?;
    Ok(records.into_iter().map(each).collect())
}
