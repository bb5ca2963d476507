//! Host structs of `carry.wgsl`.

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
