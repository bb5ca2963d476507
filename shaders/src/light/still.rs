//! Host struct of `still.wgsl`.

use bytemuck::{Pod, Zeroable};

/// A camera and which sample of each pixel is taken.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct StillParameters {
    /// Rows of the affine transform.
    pub world_from_eye: [[f32; 4]; 3],
    /// Tangents of left, right, up and down.
    pub tangents: [f32; 4],
    /// In pixels.
    pub size: [u32; 2],
    /// Which sample of the sequence.
    pub sample_index: u32,
    /// Of the sampler.
    pub seed: u32,
}
