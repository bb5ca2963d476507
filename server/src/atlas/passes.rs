//! The kernels of the atlas, in their order, and the buffers between them.

use shadecast_shaders::atlas::{
    ActivePatch, AtlasParameters, AtlasState, FreeTexels, NONE, SOURCE, TALLY_BYTES,
};
use wgpu::ShaderStages;

use super::policy::AtlasShape;
use crate::{
    gpu::{Binding, Gpu, GpuError, bind, layout, workgroups},
    packer::passes::{CountsActive, Outcomes, Threads},
};

/// Threads of a group, where a thread has a run of patches.
const GROUP: u32 = 64;

/// How many groups a kernel gets.
#[derive(Clone, Copy, Debug)]
enum Groups {
    /// A thread for each run of patches.
    Runs,
    /// One for each kind of slot and level.
    Lists,
    /// One.
    One,
}

/// The kernels of a frame. A request may be made three times: with the bias of
/// equation 3, with a larger one, and in an empty atlas. Each but the first
/// returns at once where it is not needed.
const FRAME: [(&str, Groups); 18] = [
    ("count_active", Groups::Runs),
    ("scan_active", Groups::One),
    ("gather", Groups::Runs),
    ("leave_out", Groups::One),
    ("choose_bias", Groups::One),
    ("request", Groups::Runs),
    ("scan_slots", Groups::Lists),
    ("provision", Groups::One),
    ("walk", Groups::Runs),
    ("raise", Groups::One),
    ("request", Groups::Runs),
    ("scan_slots", Groups::Lists),
    ("provision", Groups::One),
    ("request", Groups::Runs),
    ("scan_slots", Groups::Lists),
    ("provision", Groups::One),
    ("release", Groups::Runs),
    ("assign", Groups::Runs),
];

/// Names of the kernels of a frame, in their order.
pub(super) fn kernel_names() -> impl Iterator<Item = &'static str> {
    FRAME.iter().map(|(name, _)| *name)
}

/// Everything of the atlas that lies on the GPU.
#[derive(Debug)]
pub(super) struct Passes {
    kernels: Vec<(wgpu::ComputePipeline, Groups)>,
    group: wgpu::BindGroup,
    parameters: wgpu::Buffer,
    wishes: wgpu::Buffer,
    blocks: wgpu::Buffer,
    tally: wgpu::Buffer,
    state: wgpu::Buffer,
    held: wgpu::Buffer,
    pub(super) outcomes: Outcomes<AtlasState, ActivePatch>,
    shape: AtlasShape,
    patches: u32,
    run: u32,
    levels: u32,
}

impl Passes {
    pub(super) fn new(
        gpu: &Gpu,
        shape: AtlasShape,
        patches: u32,
        pixels: &wgpu::Buffer,
        threads: Threads,
    ) -> Result<Self, GpuError> {
        let Threads { run, lanes } = threads;
        let log2_side = u32::from(shape.log2_side());
        let levels = log2_side * (log2_side + 1) / 2;
        let of_patches = |bytes: u64| u64::from(patches.max(1)) * bytes;
        let runs = u64::from(patches.div_ceil(run));
        let parameters = gpu.uniform("atlas parameters", size_of::<AtlasParameters>());
        let wishes = gpu.scratch("wishes of patches", of_patches(4))?;
        let blocks = gpu.scratch("blocks of patches", of_patches(8))?;
        let active = gpu.scratch(
            "active patches",
            of_patches(size_of::<ActivePatch>() as u64),
        )?;
        let listed = gpu.scratch("lists of runs", of_patches(4))?;
        let held = gpu.scratch(
            "patches with blocks",
            u64::from(patches.div_ceil(32).max(1)) * 4,
        )?;
        let run_counts = gpu.scratch("active patches of runs", runs * 8)?;
        let slots = gpu.scratch("slots of runs", runs * 4 * 3 * u64::from(levels))?;
        let tally = gpu.scratch("tally of the atlas", TALLY_BYTES)?;
        let state = gpu.scratch("state of the atlas", size_of::<AtlasState>() as u64)?;
        let stack_words = AtlasState::stack_words(shape.log2_side(), shape.texels());
        let stacks = gpu.scratch("stacks of free blocks", stack_words * 4)?;

        let own_layout = layout(
            gpu,
            ShaderStages::COMPUTE,
            &[
                Binding::Uniform,
                Binding::Read,
                Binding::Read,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
                Binding::Write,
            ],
        );
        let group = bind(
            gpu,
            &own_layout,
            &[
                &parameters,
                pixels,
                &wishes,
                &blocks,
                &active,
                &run_counts,
                &slots,
                &tally,
                &state,
                &stacks,
                &listed,
                &held,
            ],
        );
        let constants = [("RUN", f64::from(run)), ("LANES", f64::from(lanes))];
        let mut kernels: Vec<(&str, wgpu::ComputePipeline, Groups)> = Vec::new();
        for (name, groups) in FRAME {
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
            blocks,
            tally,
            state,
            held,
            shape,
            patches,
            run,
            levels,
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

    #[cfg(test)]
    pub(super) fn state(&self) -> &wgpu::Buffer {
        &self.state
    }

    /// Forgets all blocks, so that this is free.
    pub(super) fn clear(&self, gpu: &Gpu) -> FreeTexels {
        let none = vec![NONE; (self.blocks.size() / 4) as usize];
        gpu.queue
            .write_buffer(&self.blocks, 0, bytemuck::cast_slice(&none));
        let nobody = vec![0; self.held.size() as usize];
        gpu.queue.write_buffer(&self.held, 0, &nobody);
        let empty = AtlasState::empty(self.shape.log2_side(), self.shape.texels());
        gpu.queue
            .write_buffer(&self.state, 0, bytemuck::bytes_of(&empty));
        empty.free_texels(self.shape.log2_side(), self.shape.superblocks())
    }

    /// Records the placement of a frame. With `times`, each kernel has a pass of
    /// its own and writes there when it begins and ends.
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        parameters: &AtlasParameters,
        times: Option<&wgpu::QuerySet>,
    ) {
        gpu.queue
            .write_buffer(&self.parameters, 0, bytemuck::bytes_of(parameters));
        encoder.clear_buffer(&self.tally, 0, None);
        let Some(times) = times else {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("atlas"),
                timestamp_writes: None,
            });
            for kernel in &self.kernels {
                self.dispatch(&mut pass, kernel);
            }
            return;
        };
        for (index, kernel) in (0..).step_by(2).zip(&self.kernels) {
            let timestamps = wgpu::ComputePassTimestampWrites {
                query_set: times,
                beginning_of_pass_write_index: Some(index),
                end_of_pass_write_index: Some(index + 1),
            };
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("atlas"),
                timestamp_writes: Some(timestamps),
            });
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
            Groups::Lists => (3 * self.levels, 1),
            Groups::One => (1, 1),
        };
        pass.set_bind_group(0, &self.group, &[]);
        pass.set_pipeline(kernel);
        pass.dispatch_workgroups(x, y, 1);
    }
}

impl CountsActive for AtlasState {
    fn active_count(&self) -> u32 {
        self.active_count
    }
}
