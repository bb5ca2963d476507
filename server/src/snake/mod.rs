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

use thiserror::Error;

pub use footprints::SnakeFootprints;
pub use place::{Snake, SnakeTwin};
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
