//! Waves of light paths: whatever begins them and whatever gathers them, what
//! lies between is the same.

use shadecast_shaders::light::{
    ADVANCE_SOURCE, HIT_BYTES, RAY_BYTES, STATE_BYTES, TRACE_SOURCE, Wave,
};
use wgpu::ShaderStages;

use crate::gpu::{Binding, Gpu, GpuError, GpuScene, bind, layout, workgroups};

/// Most paths in flight; more only cost memory.
const LONGEST_WAVE: u32 = 1 << 18;
/// Most times that the rays of a wave are traced: bounces and a camera's ray.
const MOST_STEPS: u32 = 128;
/// Of the lengths of the queues, and of their sum over all waves.
const LENGTH_BYTES: u64 = MOST_STEPS as u64 * 4;
const SUM_BYTES: u64 = 8;
/// Threads of a workgroup in all kernels here.
const GROUP: u32 = 64;

/// The rays in flight and the kernels that all kinds of paths share.
#[derive(Debug)]
pub struct Paths {
    /// Second group of every kernel that begins, traces or gathers paths.
    pub layout: wgpu::BindGroupLayout,
    /// The same, bound.
    pub group: wgpu::BindGroup,
    wave: wgpu::Buffer,
    queued: wgpu::Buffer,
    trace: wgpu::ComputePipeline,
    advance: wgpu::ComputePipeline,
    count: wgpu::ComputePipeline,
    longest_wave: u32,
    /// Times that rays are traced, with the same result: more than once only to
    /// tell what it costs.
    pub repeats: u32,
}

/// What begins paths and what gathers them, with their third group.
#[derive(Clone, Copy, Debug)]
pub struct Ends<'a> {
    /// Makes the first vertex or ray of each path.
    pub start: &'a wgpu::ComputePipeline,
    /// Looks at what paths bring before it is taken, and in how many workgroups.
    pub before_finish: Option<(&'a wgpu::ComputePipeline, u32)>,
    /// Takes what each path brings.
    pub finish: &'a wgpu::ComputePipeline,
    /// What both bind.
    pub group: &'a wgpu::BindGroup,
    /// True where paths begin with a ray from a camera instead of a vertex.
    pub from_camera: bool,
}

impl Paths {
    /// Room for waves of at most `most` paths.
    ///
    /// # Errors
    /// When a wave is larger than the device binds.
    pub fn new(gpu: &Gpu, gpu_scene: &GpuScene, most: u32) -> Result<Self, GpuError> {
        let longest_wave = most.clamp(1, LONGEST_WAVE).next_multiple_of(GROUP);
        let layout = layout(
            gpu,
            ShaderStages::COMPUTE,
            &[
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Uniform,
                Binding::Write,
                Binding::Write,
            ],
        );
        let bytes = u64::from(longest_wave);
        let rays = gpu.scratch("rays", bytes * RAY_BYTES)?;
        let hits = gpu.scratch("hits", bytes * HIT_BYTES)?;
        let states = gpu.scratch("paths", bytes * STATE_BYTES)?;
        let wave = gpu.uniform("wave", size_of::<Wave>());
        let layouts = [&gpu_scene.layout, &layout];
        let trace =
            gpu.compute_pipeline(TRACE_SOURCE, "trace_rays", &layouts, &gpu_scene.constants);
        let advance =
            gpu.compute_pipeline(ADVANCE_SOURCE, "advance", &layouts, &gpu_scene.constants);
        let queue = gpu.scratch("ray queue", bytes * 3 * 4)?;
        let count =
            gpu.compute_pipeline(TRACE_SOURCE, "count_rays", &layouts, &gpu_scene.constants);
        let queued = gpu.scratch("queue lengths", LENGTH_BYTES + SUM_BYTES)?;
        let group = bind(
            gpu,
            &layout,
            &[&rays, &hits, &states, &wave, &queue, &queued],
        );
        Ok(Self {
            layout,
            group,
            wave,
            queued,
            trace,
            advance,
            count,
            longest_wave,
            repeats: 1,
        })
    }

    /// Rays traced so far.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn rays(&self, gpu: &Gpu) -> Result<u64, GpuError> {
        // Lower word first, as 64-bit numbers lie in memory.
        let sum = gpu.read::<u32>(&self.queued, LENGTH_BYTES..LENGTH_BYTES + SUM_BYTES)?;
        Ok(u64::from(sum[0]) | u64::from(sum[1]) << 32)
    }

    /// Most paths in flight.
    #[must_use]
    pub fn longest_wave(&self) -> u32 {
        self.longest_wave
    }

    /// Follows `count` paths from their start to their end, and submits the work.
    pub fn follow(&self, gpu: &Gpu, gpu_scene: &GpuScene, ends: Ends<'_>, count: u32) {
        // A camera's ray comes before the first vertex; each vertex has rays of its own.
        let steps = gpu_scene.bounces()
            + 1
            + u32::from(ends.from_camera)
            + u32::from(gpu_scene.looks_for_lamps);
        let mut first_job = 0;
        while first_job < count {
            let path_count = (count - first_job).min(self.longest_wave);
            let wave = Wave {
                path_count,
                first_job,
                ..Default::default()
            };
            for step in 0..steps {
                let wave = Wave {
                    cull: u32::from(ends.from_camera && step == 0),
                    step,
                    ..wave
                };
                let mut encoder = gpu
                    .device
                    .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                if step == 0 {
                    encoder.clear_buffer(&self.queued, 0, Some(LENGTH_BYTES));
                }
                gpu.queue
                    .write_buffer(&self.wave, 0, bytemuck::bytes_of(&wave));
                {
                    let mut pass =
                        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                    pass.set_bind_group(0, &gpu_scene.group, &[]);
                    pass.set_bind_group(1, &self.group, &[]);
                    pass.set_bind_group(2, ends.group, &[]);
                    let mut dispatch = |pipeline: &wgpu::ComputePipeline, threads: u32| {
                        pass.set_pipeline(pipeline);
                        let (x, y) = workgroups(threads, GROUP);
                        pass.dispatch_workgroups(x, y, 1);
                    };
                    if step == 0 {
                        dispatch(ends.start, path_count);
                    }
                    for _ in 0..self.repeats {
                        dispatch(&self.trace, path_count * 3);
                    }
                    dispatch(&self.advance, path_count);
                    if step + 1 == steps {
                        if let Some((pipeline, groups)) = ends.before_finish {
                            dispatch(pipeline, groups * GROUP);
                        }
                        dispatch(ends.finish, path_count);
                        dispatch(&self.count, 1);
                    }
                }
                gpu.queue.submit([encoder.finish()]);
            }
            first_job += path_count;
        }
    }
}
