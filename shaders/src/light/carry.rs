//! Host structs of `carry.wgsl` and `carry_triangles.wgsl`.

use bytemuck::{Pod, Zeroable};

/// Marks a patch that had no block before.
pub const NO_BLOCK: u32 = u32::MAX;

/// A block that gets its first content.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Move {
    /// x, and y in the upper half, of the new block.
    pub to: u32,
    /// log2 width, log2 height << 4 of the new block; << 8, << 12 of the old;
    /// 1 << 16 where the patch lies on its side in one of them.
    pub levels: u32,
    /// x, and y in the upper half, of the old block, or [`NO_BLOCK`].
    pub origin: u32,
    /// Zero.
    pub padding: u32,
}

/// A triangle's slot that gets its first content.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct TriangleMove {
    /// The new slot's corners, as in [`TriangleRecord`](super::TriangleRecord).
    pub to: [u32; 3],
    /// Its weights.
    pub to_weights: [u32; 2],
    /// The old slot's corners.
    pub origin: [u32; 3],
    /// Its weights.
    pub origin_weights: [u32; 2],
    /// See [`how`].
    pub how: u32,
    /// Where texels lie alike: the old one is the new one, or its opposite, and this.
    pub offset_x: i32,
    /// The same down.
    pub offset_y: i32,
}

/// How a triangle's light comes into its slot: [`TriangleMove::how`].
pub mod how {
    /// There was no slot before.
    pub const FROM_NOTHING: u32 = 0;
    /// Between the texels of the old slot.
    pub const RESAMPLED: u32 = 1;
    /// Texel by texel.
    pub const SHIFTED: u32 = 2;
    /// Texel by texel, after a half turn.
    pub const TURNED_ROUND: u32 = 3;
}

/// What is the same for all moves.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct CarryParameters {
    /// Length of the list.
    pub move_count: u32,
    /// In texels.
    pub atlas_width: u32,
    /// Zero.
    pub padding: [u32; 2],
}
