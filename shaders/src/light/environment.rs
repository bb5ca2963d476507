//! Host struct of `environment.wgsl`.

use bytemuck::{Pod, Zeroable};

/// A square of pixels of the picture of all directions, as it is sampled.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct EnvironmentCell {
    /// Below it the cell that was drawn is taken, above it the other one.
    pub threshold: f32,
    /// The other one.
    pub otherwise: u32,
    /// Probability by solid angle of its directions.
    pub density: f32,
    /// Zero.
    pub padding: u32,
}
