//! Tessellated Shading Streaming: every visible triangle by itself, placed anew for
//! every picture. The baseline that SAS and SnakeBinning are compared with.
//!
//! The GPU measures triangles and packs them in the submission that finds what is
//! visible (`passes`, and the kernels in `shadecast_shaders::tss`, which say where they
//! come from). The CPU compares the result with that of the frame before: a slot that
//! happens to be the same is told to nobody, so that a still head leaves light and
//! video alone.

mod passes;
#[cfg(test)]
mod tests;

use glam::Vec3;
use shadecast_protocol::{Epoch, PatchId, Placement, Slot, TriangleSlot};
use shadecast_shaders::tss::{ActiveTriangle, NONE, TssState};

use crate::{
    atlas::{AtlasStats, Placed, VisiblePatch},
    gpu::{Gpu, GpuError, GpuScene},
    packer::passes::Threads,
    patches::PatchedScene,
};
use passes::Passes;

/// Where each visible triangle is shaded.
#[derive(Debug)]
pub struct Tss {
    passes: Passes,
    told: Told,
}

impl Tss {
    /// An empty atlas of `size` texels for the triangles of a scene. `pixels` will hold
    /// those that each patch covers in a frame, as words.
    ///
    /// # Errors
    /// When lists of so many triangles are larger than the device binds.
    pub fn new(
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        scene: &PatchedScene,
        size: [u16; 2],
        pixels: &wgpu::Buffer,
    ) -> Result<Self, GpuError> {
        let threads = Threads::best(gpu);
        Ok(Self {
            passes: Passes::new(gpu, gpu_scene, scene, size, pixels, threads)?,
            told: Told::nothing(scene.patches.len(), size),
        })
    }

    /// Makes the next [`place`](Self::place) begin a new epoch, for a client that lost
    /// track.
    pub fn force_reset(&mut self) {
        self.told.reset_asked = true;
    }

    /// Gives every visible triangle a slot. Submits what is recorded before; `eyes[n]` is
    /// the eye in the space of `ObjectId(n)`.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn place(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        mut encoder: wgpu::CommandEncoder,
        eyes: &[Vec3],
        pixels_per_radian: f32,
    ) -> Result<Placed, GpuError> {
        self.passes
            .record(gpu, gpu_scene, &mut encoder, eyes, pixels_per_radian);
        let (state, active) = self.passes.outcomes.submit_and_read(gpu, encoder)?;
        Ok(self.told.placed(&state, &active))
    }
}

/// What the client was told.
#[derive(Debug)]
struct Told {
    texels: u64,
    epoch: Epoch,
    resets: u32,
    reset_asked: bool,
    /// By patch.
    slots: Vec<Option<TriangleSlot>>,
    /// Those that have one, ascending.
    holders: Vec<PatchId>,
}

impl Told {
    fn nothing(patches: usize, size: [u16; 2]) -> Self {
        Self {
            texels: u64::from(size[0]) * u64::from(size[1]),
            epoch: Epoch(0),
            resets: 0,
            reset_asked: false,
            slots: vec![None; patches],
            holders: Vec::new(),
        }
    }

    /// Takes in what became of a frame; `active` ascends by patch.
    fn placed(&mut self, state: &TssState, active: &[ActiveTriangle]) -> Placed {
        /// Steps of scaling in an octave of a side.
        const OCTAVE: f32 = 4.0;
        let reset = std::mem::take(&mut self.reset_asked);
        self.epoch.0 += u32::from(reset);
        self.resets += u32::from(reset);
        let mut placed = Placed {
            epoch: self.epoch,
            reset,
            out_of_memory: false,
            visible: Vec::with_capacity(state.seen as usize),
            removals: Vec::new(),
            placements: Vec::new(),
            moved: Vec::new(),
            // An octave of a side is two of an area.
            bias: 2.0 * state.steps as f32 / OCTAVE,
            unplaced: 0,
            stats: AtlasStats::default(),
        };
        let mut before = std::mem::take(&mut self.holders).into_iter().peekable();
        for triangle in active {
            let patch = PatchId(triangle.patch_id);
            // Long out of sight: not in the list any more.
            while let Some(gone) = before.next_if(|gone| *gone < patch) {
                self.remove(gone, &mut placed);
            }
            let had = before.next_if_eq(&patch).is_some();
            let slot = slot_of(triangle);
            if triangle.pixels > 0 {
                placed.visible.push(VisiblePatch {
                    patch,
                    pixels: triangle.pixels,
                    slot: slot.map(Slot::Triangle),
                });
                placed.unplaced += u32::from(slot.is_none());
            }
            let Some(slot) = slot else {
                if had {
                    self.remove(patch, &mut placed);
                }
                continue;
            };
            self.holders.push(patch);
            let old = self.slots[triangle.patch_id as usize].replace(slot);
            if old != Some(slot) || reset {
                let slot = Slot::Triangle(slot);
                placed.placements.push(Placement { patch, slot });
                let old = old.map(Slot::Triangle);
                placed.moved.extend(old.map(|old| (patch, old, slot)));
            }
        }
        for gone in before {
            self.remove(gone, &mut placed);
        }
        placed.stats = AtlasStats {
            texels: self.texels,
            used_texels: u64::from(state.used_texels).min(self.texels),
            patches: self.holders.len() as u32,
            resets: self.resets,
            ..AtlasStats::default()
        };
        placed
    }

    fn remove(&mut self, patch: PatchId, placed: &mut Placed) {
        self.slots[patch.0 as usize] = None;
        if !placed.reset {
            placed.removals.push(patch);
        }
    }
}

fn slot_of(triangle: &ActiveTriangle) -> Option<TriangleSlot> {
    let [first, last] = triangle.weights;
    (triangle.corners[0] != NONE).then(|| TriangleSlot {
        corners: (triangle.corners).map(|corner| [corner as u16, (corner >> 16) as u16]),
        weights: [first as u16, (first >> 16) as u16, last as u16],
    })
}
