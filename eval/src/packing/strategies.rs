//! What the parts of our memory management are worth: the same without columns
//! (S1), without block stacks besides (S2), and without atlas reset besides (S3).
//!
//! Without columns a superblock is a grid of blocks of one level. Without stacks a
//! block that comes back lies idle until its whole superblock is free. Where there
//! is no room for all requests even after a reset, some patches get no block: that
//! frame is out of memory.
//!
//! Source: SAS 2018, section 5.4 and figure 11. The paper says no more of the
//! simpler strategies than their names.

use shadecast_shaders::atlas::{
    Counts, FreeTexels, Full, LEVELS, Level, Memory, NONE, Superblocks,
};

use super::quadtree::levels;

/// What a strategy does without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Without {
    pub(super) stacks: bool,
    pub(super) resets: bool,
}

/// Superblocks of one level each.
pub(super) struct Grids {
    without: Without,
    /// How much room levels need is asked here, so that all strategies choose
    /// the same levels.
    yardstick: Superblocks,
    log2_side: u8,
    per_row: u32,
    total: u32,
    free: Vec<u32>,
    /// By superblock: its blocks in use.
    in_use: Vec<u32>,
    /// By index of level: the superblock that is being filled, and by how much.
    tails: Vec<Option<(u32, u32)>>,
    stacks: Vec<Vec<u32>>,
    used_texels: u64,
}

impl Grids {
    pub(super) fn new(without: Without, log2_side: u8, per_row: u32, total: u32) -> Self {
        let mut grids = Self {
            without,
            yardstick: Superblocks::new(log2_side, per_row, total),
            log2_side,
            per_row,
            total,
            free: Vec::new(),
            in_use: Vec::new(),
            tails: Vec::new(),
            stacks: Vec::new(),
            used_texels: 0,
        };
        grids.clear();
        grids
    }

    fn capacity(&self, level: Level) -> u32 {
        1 << (2 * self.log2_side - level.width - level.height)
    }

    fn missing(&self, level: Level, requested: &Counts) -> u32 {
        let stacked = self.stacks[level.index()].len() as u32;
        requested[level.index()].saturating_sub(stacked)
    }

    fn superblock_at(&self, position: u32) -> u32 {
        let (x, y) = (position & 0xffff, position >> 16);
        (y >> self.log2_side) * self.per_row + (x >> self.log2_side)
    }

    fn draw(&mut self, level: Level) -> Option<u32> {
        if let Some(position) = self.stacks[level.index()].pop() {
            return Some(position);
        }
        let (superblock, filled) = match self.tails[level.index()] {
            Some(tail) => tail,
            None => (self.free.pop()?, 0),
        };
        let across = 1 << (self.log2_side - level.width);
        let x =
            ((superblock % self.per_row) << self.log2_side) + ((filled % across) << level.width);
        let y =
            ((superblock / self.per_row) << self.log2_side) + ((filled / across) << level.height);
        let filled = filled + 1;
        self.tails[level.index()] = (filled < self.capacity(level)).then_some((superblock, filled));
        Some(x | y << 16)
    }
}

impl Memory for Grids {
    /// Positions by index of level.
    type Provision = Vec<Vec<u32>>;

    fn needed(&self, requested: &Counts) -> u64 {
        self.yardstick.needed(requested)
    }

    fn fresh(&self, requested: &Counts) -> u64 {
        levels(self.log2_side)
            .map(|level| {
                let tail = self.tails[level.index()];
                let filled = tail.map_or(0, |(_, filled)| filled);
                let blocks = filled + self.missing(level, requested);
                u64::from(blocks.div_ceil(self.capacity(level))) - u64::from(tail.is_some())
            })
            .sum()
    }

    fn free(&self) -> u32 {
        // What is never reset has no high-water mark.
        if self.without.resets {
            self.total
        } else {
            self.free.len() as u32
        }
    }

    fn release(&mut self, position: u32, level: Level) {
        self.used_texels -= 1 << (level.width + level.height);
        let superblock = self.superblock_at(position);
        let in_use = &mut self.in_use[superblock as usize];
        *in_use -= 1;
        if !self.without.stacks {
            self.stacks[level.index()].push(position);
        } else if *in_use == 0 {
            let tail = &mut self.tails[level.index()];
            if tail.is_some_and(|(filling, _)| filling == superblock) {
                *tail = None;
            }
            self.free.push(superblock);
        }
    }

    fn provision(&mut self, requested: &Counts) -> Result<Self::Provision, Full> {
        let is_empty = self.free.len() as u32 == self.total;
        let fits = self.fresh(requested) <= self.free.len() as u64;
        if !fits && !is_empty && !self.without.resets {
            return Err(Full);
        }
        let mut positions = vec![Vec::new(); LEVELS];
        let mut by_area: Vec<Level> = levels(self.log2_side).collect();
        by_area.sort_by_key(|level| std::cmp::Reverse((level.width, level.height)));
        for level in by_area {
            for _ in 0..requested[level.index()] {
                let position = self.draw(level);
                if let Some(position) = position {
                    let superblock = self.superblock_at(position);
                    self.in_use[superblock as usize] += 1;
                    self.used_texels += 1 << (level.width + level.height);
                }
                positions[level.index()].push(position.unwrap_or(NONE));
            }
        }
        Ok(positions)
    }

    fn assign(&mut self, provision: &Self::Provision, level: Level, slot: u32) -> u32 {
        provision[level.index()][slot as usize]
    }

    fn clear(&mut self) {
        self.free = (0..self.total).rev().collect();
        self.in_use = vec![0; self.total as usize];
        self.tails = vec![None; LEVELS];
        self.stacks = vec![Vec::new(); LEVELS];
        self.used_texels = 0;
    }

    fn free_texels(&self) -> FreeTexels {
        let superblocks = self.free.len() as u32;
        let in_superblocks = u64::from(superblocks) << (2 * self.log2_side);
        let in_tails: u64 = levels(self.log2_side)
            .filter_map(|level| {
                let (_, filled) = self.tails[level.index()]?;
                let rest = self.capacity(level) - filled;
                Some(u64::from(rest) << (level.width + level.height))
            })
            .sum();
        let all = u64::from(self.total) << (2 * self.log2_side);
        FreeTexels {
            superblocks,
            in_superblocks,
            in_tails,
            stacked: self.stacks.iter().map(|stack| stack.len() as u32).sum(),
            // On the stacks, or out of reach.
            in_stacks: all - in_superblocks - in_tails - self.used_texels,
        }
    }
}
