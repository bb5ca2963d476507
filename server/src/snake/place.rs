//! The packer itself: one call a frame. Its twin gives the same on the CPU.

use shadecast_protocol::Epoch;
use shadecast_shaders::snake::{Outcome, Packer, Seen, Superblock};

use super::{
    passes::Passes,
    policy::{Policy, SnakeShape},
};
use crate::{
    atlas::Placed,
    gpu::{Gpu, GpuError},
    packer::passes::Threads,
};

/// The shading atlas's memory on the GPU, and which triangle has which part of it.
#[derive(Debug)]
pub struct Snake {
    policy: Policy,
    passes: Passes,
}

impl Snake {
    /// An empty atlas for a scene of so many patches, each a triangle. `pixels` will
    /// hold those that each patch covers in this frame, as words.
    ///
    /// # Errors
    /// When lists of so many patches are larger than the device binds.
    pub fn new(
        gpu: &Gpu,
        shape: SnakeShape,
        patches: u32,
        pixels: &wgpu::Buffer,
    ) -> Result<Self, GpuError> {
        Ok(Self {
            policy: Policy::new(shape),
            passes: Passes::new(gpu, shape, patches, pixels, Threads::best(gpu))?,
        })
    }

    /// What each triangle deserves, as [`Wish::words`](shadecast_shaders::snake::Wish::words):
    /// to be filled in for all visible ones.
    #[must_use]
    pub fn wishes(&self) -> &wgpu::Buffer {
        self.passes.wishes()
    }

    /// The slot that each triangle has, for the footprints.
    pub(super) fn slots(&self) -> &wgpu::Buffer {
        self.passes.slots()
    }

    /// The current epoch.
    #[must_use]
    pub fn epoch(&self) -> Epoch {
        self.policy.epoch()
    }

    /// Makes the next [`place`](Self::place) reset the atlas, for a client that lost
    /// track.
    pub fn force_reset(&mut self) {
        self.policy.force_reset();
    }

    /// Gives every visible triangle a slot that suits it, and moves as few as
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
        self.passes.record(gpu, &mut encoder, &parameters);
        self.read(gpu, encoder)
    }

    fn read(&mut self, gpu: &Gpu, encoder: wgpu::CommandEncoder) -> Result<Placed, GpuError> {
        let (state, active) = self.passes.outcomes.submit_and_read(gpu, encoder)?;
        let count = state.superblock_count as usize;
        let superblocks = state.superblocks.iter().take(count);
        let outcome = Outcome {
            active,
            visible: state.visible,
            bias: state.bias,
            raised: state.raised,
            status: state.status,
            reserved: [state.bins, state.reserved, state.slots],
            superblocks: superblocks
                .map(|&[x, width, used, peak]| Superblock {
                    x,
                    width,
                    used,
                    peak,
                })
                .collect(),
        };
        Ok(self.policy.placed(&outcome))
    }

    #[cfg(test)]
    pub(super) fn with_threads(
        mut self,
        gpu: &Gpu,
        threads: Threads,
        pixels: &wgpu::Buffer,
    ) -> Self {
        let (shape, patches) = (self.policy.shape(), self.passes.patches());
        self.passes = Passes::new(gpu, shape, patches, pixels, threads).expect("room");
        self
    }

    #[cfg(test)]
    pub(super) fn begin_anew(&mut self, gpu: &Gpu) {
        self.policy = Policy::new(self.policy.shape());
        self.passes.clear(gpu);
    }
}

/// The same on the CPU, for tests and to be compared with.
#[derive(Clone, Debug)]
pub struct SnakeTwin {
    policy: Policy,
    packer: Packer,
}

impl SnakeTwin {
    /// An empty atlas.
    #[must_use]
    pub fn new(shape: SnakeShape) -> Self {
        let policy = Policy::new(shape);
        Self {
            packer: Packer::new(&policy.parameters(0)),
            policy,
        }
    }

    /// As [`Snake::epoch`].
    #[must_use]
    pub fn epoch(&self) -> Epoch {
        self.policy.epoch()
    }

    /// As [`Snake::force_reset`].
    pub fn force_reset(&mut self) {
        self.policy.force_reset();
    }

    /// As [`Snake::place`]; `seen` ascends by patch.
    pub fn place(&mut self, seen: &[Seen]) -> Placed {
        let outcome = self.packer.place(&self.policy.parameters(0), seen);
        self.policy.placed(&outcome)
    }
}
