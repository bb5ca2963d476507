//! The kernels of the snake, in their order, and the buffers between them.

use shadecast_shaders::snake::{
    ActiveTriangle, BINS, NONE, RAISES, SOURCE, SnakeParameters, SnakeState, TALLY_WORDS, templates,
};
use wgpu::ShaderStages;

use super::policy::SnakeShape;
use crate::{
    gpu::{Binding, Gpu, GpuError, bind, layout, workgroups},
    packer::passes::{CountsActive, Outcomes, Threads},
};

/// Threads of a group, where a thread has a run of triangles.
const GROUP: u32 = 64;

/// How many groups a kernel gets.
#[derive(Clone, Copy, Debug)]
enum Groups {
    /// A thread for each run of triangles.
    Runs,
    /// A thread for each bin.
    Bins,
    /// One for each digit that is sorted by.
    Digits,
    /// One.
    One,
}

/// Times that bins are asked for: with what is, in an empty atlas, and with larger
/// biases. Each but the first returns at once where it is not needed.
const ATTEMPTS: usize = 2 + RAISES.len();
const BEFORE: [(&str, Groups); 5] = [
    ("count_active", Groups::Runs),
    ("scan_active", Groups::One),
    ("gather", Groups::Runs),
    ("leave_out", Groups::One),
    ("choose_scale", Groups::One),
];
const ATTEMPT: [(&str, Groups); 4] = [
    ("choose_bins", Groups::Runs),
    ("map_bins", Groups::Bins),
    ("choose_targets", Groups::Runs),
    ("superblocks", Groups::One),
];
const AFTER: [(&str, Groups); 10] = [
    ("scan_slots", Groups::One),
    ("mark_taken", Groups::Runs),
    ("scan_taken", Groups::One),
    ("count_low", Groups::Runs),
    ("scan_low", Groups::Digits),
    ("scatter_low", Groups::Runs),
    ("count_high", Groups::Runs),
    ("scan_high", Groups::Digits),
    ("scatter_high", Groups::Runs),
    ("assign", Groups::Runs),
];

/// The kernels of a frame.
fn frame() -> impl Iterator<Item = (&'static str, Groups)> {
    let attempts = std::iter::repeat_n(ATTEMPT, ATTEMPTS).flatten();
    BEFORE.into_iter().chain(attempts).chain(AFTER)
}

/// Everything of the snake that lies on the GPU.
#[derive(Debug)]
pub(super) struct Passes {
    kernels: Vec<(wgpu::ComputePipeline, Groups)>,
    group: wgpu::BindGroup,
    parameters: wgpu::Buffer,
    wishes: wgpu::Buffer,
    slots: wgpu::Buffer,
    tally: wgpu::Buffer,
    taken: wgpu::Buffer,
    state: wgpu::Buffer,
    pub(super) outcomes: Outcomes<SnakeState, ActiveTriangle>,
    patches: u32,
    run: u32,
}

impl Passes {
    pub(super) fn new(
        gpu: &Gpu,
        shape: SnakeShape,
        patches: u32,
        pixels: &wgpu::Buffer,
        threads: Threads,
    ) -> Result<Self, GpuError> {
        let Threads { run, lanes } = threads;
        let of_patches = |bytes: u64| u64::from(patches.max(1)) * bytes;
        let runs = u64::from(patches.div_ceil(run).max(1));
        let parameters = gpu.uniform("snake parameters", size_of::<SnakeParameters>());
        let wishes = gpu.scratch("wishes of triangles", of_patches(8))?;
        let templates = gpu.storage("footprints of bins", bytemuck::cast_slice(&templates()))?;
        let slots = gpu.scratch("slots of triangles", of_patches(8))?;
        let active = gpu.scratch(
            "active triangles",
            of_patches(size_of::<ActiveTriangle>() as u64),
        )?;
        let counts = gpu.scratch("active triangles of runs", runs * 16)?;
        let digits = gpu.scratch("digits of bins", (runs + 1) * 64 * 4)?;
        let tally = gpu.scratch("tally of the snake", TALLY_WORDS * 4)?;
        let state = gpu.scratch("state of the snake", SnakeState::BYTES)?;
        let plans = gpu.scratch("plans of bins", BINS as u64 * 16)?;
        let listed = gpu.scratch("lists of runs", of_patches(4))?;
        let requests = gpu.scratch("requests", of_patches(4))?;
        // A slot has a texel at least, and each bin begins with a word of its own.
        let words = u64::from(shape.texels() / 32) + BINS as u64;
        let taken = gpu.scratch("slots in use", words * 4)?;
        let free_before = gpu.scratch("free slots", words * 4)?;

        let [read, write] = [Binding::Read, Binding::Write];
        let own_layout = layout(
            gpu,
            ShaderStages::COMPUTE,
            &[
                Binding::Uniform,
                read,
                read,
                read,
                write,
                write,
                write,
                write,
                write,
                write,
                write,
                write,
                write,
                write,
                write,
            ],
        );
        let group = bind(
            gpu,
            &own_layout,
            &[
                &parameters,
                pixels,
                &wishes,
                &templates,
                &slots,
                &active,
                &counts,
                &digits,
                &tally,
                &state,
                &plans,
                &listed,
                &requests,
                &taken,
                &free_before,
            ],
        );
        let constants = [("RUN", f64::from(run)), ("LANES", f64::from(lanes))];
        let mut kernels: Vec<(&str, wgpu::ComputePipeline, Groups)> = Vec::new();
        for (name, groups) in frame() {
            let known = kernels.iter().find(|(known, ..)| *known == name);
            let kernel = match known {
                Some((_, kernel, _)) => kernel.clone(),
                None => gpu.compute_pipeline(SOURCE, name, &[&own_layout], &constants),
            };
            kernels.push((name, kernel, groups));
        }
        let passes = Self {
            outcomes: Outcomes::new(gpu, &state, &active, patches),
            kernels: (kernels.into_iter())
                .map(|(_, kernel, groups)| (kernel, groups))
                .collect(),
            group,
            parameters,
            wishes,
            slots,
            tally,
            taken,
            state,
            patches,
            run,
        };
        passes.clear(gpu);
        Ok(passes)
    }

    /// Patches of the scene.
    pub(super) fn patches(&self) -> u32 {
        self.patches
    }

    pub(super) fn wishes(&self) -> &wgpu::Buffer {
        &self.wishes
    }

    pub(super) fn slots(&self) -> &wgpu::Buffer {
        &self.slots
    }

    /// Forgets all slots.
    pub(super) fn clear(&self, gpu: &Gpu) {
        let none = vec![NONE; (self.slots.size() / 4) as usize];
        gpu.queue
            .write_buffer(&self.slots, 0, bytemuck::cast_slice(&none));
        let state = vec![0_u32; (SnakeState::BYTES / 4) as usize];
        gpu.queue
            .write_buffer(&self.state, 0, bytemuck::cast_slice(&state));
    }

    /// Records the placement of a frame.
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        parameters: &SnakeParameters,
    ) {
        gpu.queue
            .write_buffer(&self.parameters, 0, bytemuck::bytes_of(parameters));
        encoder.clear_buffer(&self.tally, 0, None);
        encoder.clear_buffer(&self.taken, 0, None);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("snake"),
            timestamp_writes: None,
        });
        for kernel in &self.kernels {
            self.dispatch(&mut pass, kernel);
        }
    }

    fn dispatch(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        (kernel, groups): &(wgpu::ComputePipeline, Groups),
    ) {
        let (x, y) = match groups {
            Groups::Runs => workgroups(self.patches.div_ceil(self.run), GROUP),
            Groups::Bins => (BINS.div_ceil(64) as u32, 1),
            Groups::Digits => (64, 1),
            Groups::One => (1, 1),
        };
        pass.set_bind_group(0, &self.group, &[]);
        pass.set_pipeline(kernel);
        pass.dispatch_workgroups(x, y, 1);
    }
}

impl CountsActive for SnakeState {
    fn active_count(&self) -> u32 {
        self.active_count
    }
}
