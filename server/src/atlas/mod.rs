//! Where in the atlas each visible patch is shaded.
//!
//! The GPU chooses levels and places blocks, in the same submission that finds
//! what is visible (`passes`, and the kernels in `shadecast_shaders::atlas`).
//! The CPU says how full the atlas may be and counts epochs (`policy`), and
//! reads one list back: what is visible, and what has moved ([`Placed`]).
//!
//! Free blocks are never merged, so that memory fragments until an **atlas
//! reset** drops all of it and places anew, largest blocks first: a new epoch,
//! which the caller starts on an IDR picture. Levels are chosen to fill only
//! [`FILL_TARGET`] of an empty atlas; what is left over is worn away by
//! changes of view and is what spaces resets apart. Where resets come too
//! soon all the same, the target falls: the bias rises and pictures get
//! coarser, rather than every picture becoming an IDR.
//!
//! Source: Mueller et al., "Shading Atlas Streaming", 2018, sections 4.2 and
//! 4.3; the kernels say where they depart.

mod footprints;
mod passes;
mod place;
mod policy;
#[cfg(test)]
pub(crate) mod tests;

use shadecast_protocol::{Epoch, PatchId, Placement, Slot};
use thiserror::Error;

pub use footprints::Footprints;
pub use place::{Atlas, AtlasTwin, KernelTimes};
pub use policy::{AtlasShape, FILL_TARGET, KEEP_UNSEEN};

/// Why there is no such atlas.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum AtlasError {
    /// The superblock's side cannot be halved down to a block's.
    #[error("a superblock of {0} texels: the side must be a power of two, at least 4")]
    Superblock(u16),
    /// The superblocks do not tile the atlas.
    #[error(
        "an atlas of {}x{} texels: both sides must be positive multiples of the superblock, {superblock}",
        size[0], size[1]
    )]
    Size {
        /// Width and height, texels.
        size: [u16; 2],
        /// Side of a superblock, texels.
        superblock: u16,
    },
}

/// What one frame of the atlas changed, whatever the method. All lists ascend by patch.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// The epoch that the placement belongs to.
    pub epoch: Epoch,
    /// True when the epoch begins with this frame: nothing that was placed
    /// before is any longer, and the picture must be an IDR.
    pub reset: bool,
    /// True when memory was too fragmented for the frame, and so the atlas was reset.
    pub out_of_memory: bool,
    /// What may be seen.
    pub visible: Vec<VisiblePatch>,
    /// Patches that lose their slot. Empty on a reset, which drops all.
    pub removals: Vec<PatchId>,
    /// Patches that get a slot; on a reset, all that have one.
    pub placements: Vec<Placement>,
    /// Those among the placements that had a slot before: old one, new one.
    /// After a reset the two may be equal.
    pub moved: Vec<(PatchId, Slot, Slot)>,
    /// Subtracted from log2 of all ideal areas.
    pub bias: f32,
    /// Visible patches without a slot.
    pub unplaced: u32,
    /// The atlas after the frame.
    pub stats: AtlasStats,
}

/// A patch that may be seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisiblePatch {
    /// Its name.
    pub patch: PatchId,
    /// Pixels of all id pictures that it covers.
    pub pixels: u32,
    /// Where it is shaded, if there is room.
    pub slot: Option<Slot>,
}

/// How full an atlas is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AtlasStats {
    /// Texels of the atlas.
    pub texels: u64,
    /// Texels in slots of patches.
    pub used_texels: u64,
    /// Texels in free blocks on the stacks.
    pub stacked_texels: u64,
    /// Texels at the ends of partly filled superblocks.
    pub tail_texels: u64,
    /// Superblocks, free or not.
    pub superblocks: u32,
    /// Superblocks without any block.
    pub free_superblocks: u32,
    /// Free blocks on the stacks.
    pub stacked_blocks: u32,
    /// Patches that have a slot.
    pub patches: u32,
    /// Atlas resets so far.
    pub resets: u32,
}

impl AtlasStats {
    /// Share of the texels that are in slots of patches.
    #[must_use]
    pub fn used_fraction(&self) -> f32 {
        self.used_texels as f32 / self.texels as f32
    }
}
