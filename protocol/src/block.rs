//! A patch's rectangle of texels in the atlas.

use serde::{Deserialize, Serialize};

/// Smallest log2 of a block's side. Two texels: then every block starts at an
/// even position and has even sides, and no chroma sample of 4:2:0 video
/// belongs to two blocks.
pub const MIN_LOG2_SIDE: u8 = 1;

/// How finely a patch is sampled: log2 of the texels along its own axes.
///
/// Blocks lie landscape in the atlas (SAS 2018, section 4.1). A patch that is
/// higher than wide is laid into its block on its side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Level {
    /// log2 of the texels along the patch's u.
    pub width: u8,
    /// log2 of the texels along the patch's v.
    pub height: u8,
}

impl Level {
    /// Whether the patch lies on its side: its u runs down the block, its v along it.
    #[must_use]
    pub fn is_turned(self) -> bool {
        self.height > self.width
    }

    /// The level of a patch that lies in the same block unturned.
    #[must_use]
    pub fn landscape(self) -> Self {
        Self {
            width: self.width.max(self.height),
            height: self.width.min(self.height),
        }
    }

    /// Width and height of the block in texels.
    #[must_use]
    pub fn size(self) -> (u32, u32) {
        let Self { width, height } = self.landscape();
        (1 << width, 1 << height)
    }

    /// Where in the block, from 0 to 1 on either axis, the patch has its `uv`;
    /// and as well where in the patch the block has its `uv`.
    #[must_use]
    pub fn turn<T>(self, [u, v]: [T; 2]) -> [T; 2] {
        if self.is_turned() { [v, u] } else { [u, v] }
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
