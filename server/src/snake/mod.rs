//! Where in the atlas each visible triangle is shaded, in the shape that it is
//! seen in: the packer `snake`.
//!
//! The GPU sorts triangles into bins of like shape and gives them their slots, in
//! the same submission that finds what is visible (`passes`, and the kernels in
//! [`shadecast_shaders::snake`]). The CPU says how full the atlas may be and counts
//! epochs (`policy`), and reads one list back: what is visible, and what has moved.
//!
//! Triangles are placed one by one, so the scene is to be cut without grouping: each
//! patch is a triangle. Texels that belong to no slot are left to the picture, which
//! gives them the average colour of those that do (section 3.8).
//!
//! Source: Hladky et al., "SnakeBinning: Efficient Temporally Coherent Triangle
//! Packing for Shading Streaming", 2021, section 3; the kernels say where they depart.

mod footprints;
mod passes;
mod place;
mod policy;
#[cfg(test)]
mod tests;

use shadecast_protocol::{Epoch, PatchId};
use thiserror::Error;

use crate::atlas::AtlasStats;

pub use footprints::SnakeFootprints;
pub use place::{KernelTimes, Snake, SnakeTwin};
pub use policy::SnakeShape;

/// Why there is no such atlas.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum SnakeError {
    /// No superblock fits, or positions would have more bits than slots tell.
    #[error(
        "an atlas of {}x{} texels: both sides must be even, at least 4 and at most 8190",
        .0[0], .0[1]
    )]
    Size([u16; 2]),
}

/// Where a triangle's corners lie in the atlas, and how it is foreshortened there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TriangleSlot {
    /// In eighths of a texel from the atlas's upper left corner, x and then y.
    pub corners: [[u16; 2]; 3],
    /// 1/depth of the corners, 65535 the largest.
    pub weights: [u16; 3],
}

/// What one frame of the atlas changed. All lists ascend by patch.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// The epoch that the placement belongs to.
    pub epoch: Epoch,
    /// True when the epoch begins with this frame: nothing that was placed
    /// before is any longer, and the picture must be an IDR.
    pub reset: bool,
    /// True when a bin found no room, and so the atlas was reset.
    pub out_of_memory: bool,
    /// What may be seen.
    pub visible: Vec<(PatchId, u32, Option<TriangleSlot>)>,
    /// Patches that lose their slot. Empty on a reset, which drops all.
    pub removals: Vec<PatchId>,
    /// Patches that get a slot, or another form of it; on a reset, all that have one.
    pub placements: Vec<(PatchId, TriangleSlot)>,
    /// Those among the placements that had a slot before: old one, new one.
    pub moved: Vec<(PatchId, TriangleSlot, TriangleSlot)>,
    /// Subtracted from log2 of all ideal areas.
    pub bias: f32,
    /// Visible patches without a slot, the least important ones.
    pub unplaced: u32,
    /// The atlas after the frame.
    pub stats: AtlasStats,
}
