//! A patch's rectangle of texels in the atlas.

use serde::{Deserialize, Serialize};

/// Smallest log2 of a block's side. Two texels: then every block starts at an
/// even position and has even sides, and no chroma sample of 4:2:0 video
/// belongs to two blocks.
pub const MIN_LOG2_SIDE: u8 = 1;

/// log2 of a block's sides. Blocks are landscape: `width >= height`
/// (SAS 2018, section 4.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Level {
    /// log2 of the width in texels.
    pub width: u8,
    /// log2 of the height in texels.
    pub height: u8,
}

impl Level {
    /// Width and height in texels.
    #[must_use]
    pub fn size(self) -> (u32, u32) {
        (1 << self.width, 1 << self.height)
    }

    /// Texels in the block.
    #[must_use]
    pub fn area(self) -> u32 {
        1 << (self.width + self.height)
    }
}

/// Where a block lies in the atlas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Block {
    /// Left column of texels.
    pub x: u16,
    /// Upper row of texels.
    pub y: u16,
    /// Size.
    pub level: Level,
}
