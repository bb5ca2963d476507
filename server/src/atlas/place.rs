//! The atlas itself: one call a frame. Its twin gives the same on the CPU.

use std::time::Duration;

use shadecast_protocol::Epoch;
use shadecast_shaders::atlas::{Memory, Outcome, Placer, Seen, Superblocks, status};

use super::{
    Placed,
    passes::{Passes, kernel_names},
    policy::{AtlasShape, Policy},
};
use crate::{
    gpu::{Gpu, GpuError},
    packer::passes::Threads,
};

/// Kernels in their order, and how long the device took for each.
pub type KernelTimes = Vec<(&'static str, Duration)>;

/// The shading atlas's memory on the GPU, and who has which part of it.
#[derive(Debug)]
pub struct Atlas {
    policy: Policy,
    passes: Passes,
}

impl Atlas {
    /// An empty atlas for a scene of so many patches. `pixels` will hold
    /// what [`mark`](shadecast_shaders::visibility::MARK_SOURCE) leaves of the frame.
    ///
    /// # Errors
    /// When lists of so many patches are larger than the device binds.
    pub fn new(
        gpu: &Gpu,
        shape: AtlasShape,
        patches: u32,
        pixels: &wgpu::Buffer,
    ) -> Result<Self, GpuError> {
        Ok(Self {
            policy: Policy::new(shape),
            passes: Passes::new(gpu, shape, patches, pixels, Threads::best(gpu))?,
        })
    }

    /// What each patch deserves, as [`Wish::word`](shadecast_shaders::atlas::Wish::word):
    /// to be filled in for all visible ones.
    #[must_use]
    pub fn wishes(&self) -> &wgpu::Buffer {
        self.passes.wishes()
    }

    /// The current epoch.
    #[must_use]
    pub fn epoch(&self) -> Epoch {
        self.policy.epoch()
    }

    /// Makes the next [`place`](Self::place) reset the atlas, for a client
    /// that lost track.
    pub fn force_reset(&mut self) {
        self.policy.force_reset();
    }

    /// Gives every visible patch a block that suits it, and moves as few as
    /// possible. Submits what is recorded before.
    ///
    /// The same frames in the same order give the same placement.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn place(
        &mut self,
        gpu: &Gpu,
        mut encoder: wgpu::CommandEncoder,
    ) -> Result<Placed, GpuError> {
        let parameters = self.policy.parameters(self.passes.patches());
        self.passes.record(gpu, &mut encoder, &parameters, None);
        self.read(gpu, encoder)
    }

    /// The same, and how long each kernel ran; nothing where the device has no clock.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn place_timed(&mut self, gpu: &Gpu) -> Result<(Placed, KernelTimes), GpuError> {
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        if !gpu
            .device
            .features()
            .contains(wgpu::Features::TIMESTAMP_QUERY)
        {
            return Ok((self.place(gpu, encoder)?, KernelTimes::new()));
        }
        let count = 2 * kernel_names().count() as u32;
        let times = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("atlas"),
            ty: wgpu::QueryType::Timestamp,
            count,
        });
        let resolved = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("times of kernels"),
            size: u64::from(count) * 8,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let parameters = self.policy.parameters(self.passes.patches());
        self.passes
            .record(gpu, &mut encoder, &parameters, Some(&times));
        encoder.resolve_query_set(&times, 0..count, &resolved, 0);
        let placed = self.read(gpu, encoder)?;
        let ticks: Vec<u64> = gpu.read(&resolved, 0..resolved.size())?;
        let nanoseconds = f64::from(gpu.queue.get_timestamp_period());
        let spent = ticks.chunks_exact(2).map(|times| {
            let ticks = times[1].saturating_sub(times[0]);
            Duration::from_nanos((ticks as f64 * nanoseconds) as u64)
        });
        Ok((placed, kernel_names().zip(spent).collect()))
    }

    fn read(&mut self, gpu: &Gpu, encoder: wgpu::CommandEncoder) -> Result<Placed, GpuError> {
        let (state, active) = self.passes.outcomes.submit_and_read(gpu, encoder)?;
        let outcome = Outcome {
            active,
            visible: state.visible,
            bias: state.bias,
            status: state.status,
        };
        let shape = self.policy.shape();
        let free = if outcome.status & status::BROKEN == 0 {
            state.free_texels(shape.log2_side(), shape.superblocks())
        } else {
            tracing::error!("the atlas lost count of its blocks; it begins anew");
            self.passes.clear(gpu)
        };
        Ok(self.policy.placed(outcome, free))
    }

    #[cfg(test)]
    pub(super) fn with_threads(
        mut self,
        gpu: &Gpu,
        threads: Threads,
        pixels: &wgpu::Buffer,
    ) -> Self {
        let patches = self.passes.patches();
        self.passes =
            Passes::new(gpu, self.policy.shape(), patches, pixels, threads).expect("room");
        self
    }

    #[cfg(test)]
    pub(super) fn begin_anew(&mut self, gpu: &Gpu) {
        self.policy = Policy::new(self.policy.shape());
        self.passes.clear(gpu);
    }

    /// Puts more on the stacks than any atlas has room for.
    #[cfg(test)]
    pub(super) fn break_stacks(&self, gpu: &Gpu) {
        use shadecast_shaders::atlas::{AtlasState, LEVELS};
        let at = std::mem::offset_of!(AtlasState, stacked) as u64;
        let many = [1_u32 << 24; LEVELS];
        let queue = &gpu.queue;
        queue.write_buffer(self.passes.state(), at, bytemuck::cast_slice(&many));
    }
}

/// The same on the CPU, for tests and to be compared with; over another memory
/// it is another strategy.
#[derive(Clone, Debug)]
pub struct AtlasTwin<M = Superblocks> {
    policy: Policy,
    placer: Placer<M>,
}

impl AtlasTwin {
    /// An empty atlas.
    #[must_use]
    pub fn new(shape: AtlasShape) -> Self {
        let memory = Superblocks::new(shape.log2_side(), shape.per_row(), shape.superblocks());
        Self::over(shape, memory)
    }
}

impl<M: Memory> AtlasTwin<M> {
    /// An empty atlas over this memory.
    #[must_use]
    pub fn over(shape: AtlasShape, memory: M) -> Self {
        Self {
            policy: Policy::new(shape),
            placer: Placer::new(memory),
        }
    }

    /// As [`Atlas::epoch`].
    #[must_use]
    pub fn epoch(&self) -> Epoch {
        self.policy.epoch()
    }

    /// As [`Atlas::force_reset`].
    pub fn force_reset(&mut self) {
        self.policy.force_reset();
    }

    /// As [`Atlas::place`]; `seen` ascends by patch.
    pub fn place(&mut self, seen: &[Seen]) -> Placed {
        let outcome = self.placer.place(&self.policy.parameters(0), seen);
        self.policy.placed(outcome, self.placer.free_texels())
    }

    /// What lies behind it.
    #[must_use]
    pub fn memory(&self) -> &M {
        self.placer.memory()
    }
}
