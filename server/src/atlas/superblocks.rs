//! The atlas's memory: superblocks, the columns they are cut into, and stacks
//! of free blocks.
//!
//! A superblock belongs to one width; its columns are filled top down, one
//! after another, with blocks of that width. So a place in it is one number,
//! the texels of column length before it, and many blocks are handed out by
//! one addition. Blocks that come back wait on the stack of their level.
//! Nothing is ever merged; that is what an atlas reset is for.
//!
//! Source: Mueller et al., "Shading Atlas Streaming", 2018, section 4.2, table
//! 1 and figure 8. One thread does here in order what a kernel may do with one
//! thread a block; the numbers are the same.

use shadecast_protocol::{Block, Level, MIN_LOG2_SIDE};

/// log2 of a side is below this: sides are 16 bits.
const SIDES: usize = 16;

/// A number of blocks for each level, `[log2 width][log2 height]` of the block.
pub(super) type Counts = [[u32; SIDES]; SIDES];

/// Where `level` is counted.
pub(super) fn count_of(counts: &mut Counts, level: Level) -> &mut u32 {
    let Level { width, height } = level.landscape();
    &mut counts[usize::from(width)][usize::from(height)]
}

/// All memory that no block occupies.
#[derive(Clone, Debug)]
pub(super) struct Superblocks {
    /// log2 of a superblock's side.
    log2_side: u8,
    /// Superblocks side by side.
    per_row: u32,
    /// All of them, free or not.
    total: u32,
    /// Free ones; the next to be taken is the last.
    free: Vec<u32>,
    /// The partly filled superblock of each width.
    tails: [Option<Tail>; SIDES],
    /// Positions of free blocks, `[log2 width][log2 height]`.
    stacks: [[Vec<[u16; 2]>; SIDES]; SIDES],
}

/// A superblock that the next provisioning tops up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Tail {
    superblock: u32,
    /// Texels of column length in use, a multiple of the width.
    filled: u64,
}

/// What provisioning found for one frame's requests.
#[derive(Debug)]
pub(super) struct Provision {
    widths: [Columns; SIDES],
}

/// The share of one width.
#[derive(Clone, Debug, Default)]
struct Columns {
    /// The old tail, if any, then fresh ones.
    superblocks: Vec<u32>,
    /// By log2 height: requests that the stack could not serve.
    required: [u32; SIDES],
    /// By log2 height: where those begin, in heights from the first superblock.
    offset: [u64; SIDES],
}

/// There are fewer free superblocks than the requests need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Full;

/// Where the texels without a block are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct FreeTexels {
    /// Free superblocks.
    pub(super) superblocks: u32,
    /// Texels in those.
    pub(super) in_superblocks: u64,
    /// Texels at the ends of partly filled superblocks.
    pub(super) in_tails: u64,
    /// Blocks on the stacks.
    pub(super) stacked: u32,
    /// Texels in those.
    pub(super) in_stacks: u64,
}

impl Superblocks {
    /// All free. `size` is a multiple of the superblock's side.
    pub(super) fn new(size: [u16; 2], log2_side: u8) -> Self {
        let [columns, rows] = size.map(|side| u32::from(side) >> log2_side);
        let mut superblocks = Self {
            log2_side,
            per_row: columns,
            total: columns * rows,
            free: Vec::new(),
            tails: [None; SIDES],
            stacks: Default::default(),
        };
        superblocks.clear();
        superblocks
    }

    /// log2 of the largest side of a block.
    pub(super) fn log2_side(&self) -> u8 {
        self.log2_side
    }

    /// Superblocks, free or not.
    pub(super) fn total(&self) -> u32 {
        self.total
    }

    /// Superblocks on the superblock stack.
    pub(super) fn free(&self) -> u32 {
        self.free.len() as u32
    }

    /// Takes every block back (atlas reset).
    pub(super) fn clear(&mut self) {
        self.free = (0..self.total).rev().collect();
        self.tails = [None; SIDES];
        self.stacks.iter_mut().flatten().for_each(Vec::clear);
    }

    /// Takes one block back (request phase).
    pub(super) fn release(&mut self, block: Block) {
        self.stack(block.level.landscape()).push([block.x, block.y]);
    }

    fn stack(&mut self, level: Level) -> &mut Vec<[u16; 2]> {
        &mut self.stacks[usize::from(level.width)][usize::from(level.height)]
    }

    /// Superblocks that these blocks would need in an empty atlas.
    pub(super) fn needed(&self, requested: &Counts) -> u64 {
        let lengths = requested.iter().map(column_length);
        (0_u8..)
            .zip(lengths)
            .map(|(width, length)| length.div_ceil(self.capacity(width)))
            .sum()
    }

    /// Texels of column length in a superblock of this log2 width.
    fn capacity(&self, width: u8) -> u64 {
        (1 << self.log2_side) << self.log2_side.saturating_sub(width)
    }

    /// The provisioning phase: finds room for all requests, or changes nothing.
    ///
    /// The stacks come first. What they cannot serve tops up the tail of its
    /// width and then fresh superblocks, tallest blocks first, so that every
    /// block is aligned to its height. The end is rounded up to a square, and
    /// what lies between goes to the stacks (figure 8, e).
    pub(super) fn provision(&mut self, requested: &Counts) -> Result<Provision, Full> {
        if self.fresh_superblocks(requested) > self.free.len() as u64 {
            return Err(Full);
        }
        let mut widths: [Columns; SIDES] = Default::default();
        for width in (0..SIDES).rev() {
            widths[width].required = self.required(width as u8, requested);
            self.provision_width(width as u8, &mut widths[width]);
        }
        Ok(Provision { widths })
    }

    /// Superblocks that provisioning would draw for these requests.
    pub(super) fn fresh_superblocks(&self, requested: &Counts) -> u64 {
        (0..SIDES as u8)
            .map(|width| self.fresh_of_width(width, &self.required(width, requested)))
            .sum()
    }

    /// By log2 height: blocks that the stacks of a width cannot serve.
    fn required(&self, width: u8, requested: &Counts) -> [u32; SIDES] {
        let width = usize::from(width);
        std::array::from_fn(|height| {
            let stacked = self.stacks[width][height].len() as u32;
            requested[width][height].saturating_sub(stacked)
        })
    }

    fn fresh_of_width(&self, width: u8, required: &[u32; SIDES]) -> u64 {
        let tail = self.tails[usize::from(width)];
        let filled = tail.map_or(0, |tail| tail.filled);
        (filled + column_length(required)).div_ceil(self.capacity(width))
            - u64::from(tail.is_some())
    }

    fn provision_width(&mut self, width: u8, columns: &mut Columns) {
        let fresh = self.fresh_of_width(width, &columns.required) as usize;
        let tail = self.tails[usize::from(width)].take();
        columns.superblocks.extend(tail.map(|tail| tail.superblock));
        let left = self.free.len() - fresh;
        columns.superblocks.extend(self.free.drain(left..).rev());

        let mut end = tail.map_or(0, |tail| tail.filled);
        for height in (0..=usize::from(width)).rev() {
            columns.offset[height] = end >> height;
            end += u64::from(columns.required[height]) << height;
        }
        for height in MIN_LOG2_SIDE..width {
            if end >> height & 1 == 1 {
                let level = Level { width, height };
                let rest = self.block_at(&columns.superblocks, end, level);
                self.release(rest);
                end += 1 << height;
            }
        }
        let filled = end % self.capacity(width);
        self.tails[usize::from(width)] = columns
            .superblocks
            .last()
            .filter(|_| filled != 0)
            .map(|&superblock| Tail { superblock, filled });
    }

    /// The assignment phase for one request: the block of the `slot`th request
    /// of a level, each slot once, in ascending order.
    pub(super) fn assign(&mut self, provision: &Provision, level: Level, slot: u32) -> Block {
        let Level { width, height } = level.landscape();
        let columns = &provision.widths[usize::from(width)];
        let required = columns.required[usize::from(height)];
        if slot < required {
            let start = (columns.offset[usize::from(height)] + u64::from(slot)) << height;
            return self.block_at(&columns.superblocks, start, level);
        }
        let [x, y] = self
            .stack(level.landscape())
            .pop()
            .expect("provisioning counted a block on the stack for every other request");
        Block { x, y, level }
    }

    /// The block that begins `start` texels of column length into `superblocks`.
    fn block_at(&self, superblocks: &[u32], start: u64, level: Level) -> Block {
        let Level { width, .. } = level.landscape();
        let capacity = self.capacity(width);
        let superblock = superblocks[(start / capacity) as usize];
        let inside = (start % capacity) as u32;
        let column = inside >> self.log2_side;
        let x = ((superblock % self.per_row) << self.log2_side) + (column << width);
        let y = ((superblock / self.per_row) << self.log2_side)
            + (inside & ((1 << self.log2_side) - 1));
        Block {
            x: x as u16,
            y: y as u16,
            level,
        }
    }

    /// Counts what no block occupies.
    pub(super) fn free_texels(&self) -> FreeTexels {
        let side = 1_u64 << self.log2_side;
        let mut texels = FreeTexels {
            superblocks: self.free(),
            in_superblocks: u64::from(self.free()) * side * side,
            ..FreeTexels::default()
        };
        for (width, stacks) in (0_u8..).zip(&self.stacks) {
            if let Some(tail) = self.tails[usize::from(width)] {
                texels.in_tails += (self.capacity(width) - tail.filled) << width;
            }
            for (height, stack) in (0_u8..).zip(stacks) {
                texels.stacked += stack.len() as u32;
                texels.in_stacks += (stack.len() as u64) << (width + height);
            }
        }
        texels
    }
}

/// Texels of column length that these blocks of one width take.
fn column_length(by_height: &[u32; SIDES]) -> u64 {
    (0..)
        .zip(by_height)
        .map(|(height, &count): (u32, _)| u64::from(count) << height)
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of table 1 and figure 8 with every length doubled, since
    /// our smallest side is two texels: superblocks of 16, columns of width 8,
    /// heights 8, 4 and 2.
    fn figure_8() -> Superblocks {
        let mut superblocks = Superblocks::new([48, 48], 4);
        let mut requested = Counts::default();
        requested[3][3] = 3;
        let start = superblocks.provision(&requested).expect("empty");
        assert_eq!(start.widths[3].superblocks, [0]);
        // Free blocks from elsewhere; where they lie does not matter here.
        for (height, free) in [(3, 5), (2, 7), (1, 7)] {
            for _ in 0..free {
                superblocks.stacks[3][height].push([32, 32]);
            }
        }
        superblocks
    }

    /// Figure 8 and its text need seven blocks of the middle height ("b3 to
    /// b9"), that is 14 requests. Table 1 prints 16 requests and nine blocks,
    /// which contradicts its own offset of 34; see the next test.
    #[test]
    fn provisions_the_example_of_figure_8() {
        let mut superblocks = figure_8();
        let mut requested = Counts::default();
        requested[3][1..=3].copy_from_slice(&[10, 14, 7]);
        let provision = superblocks.provision(&requested).expect("room");
        let columns = &provision.widths[3];
        assert_eq!(columns.required[1..=3], [3, 7, 2]);
        assert_eq!(columns.offset[1..=3], [34, 10, 3]);
        assert_eq!(columns.superblocks, [0, 1, 2], "S1, S2 and S3");
        let stacked = |height: usize| superblocks.stacks[3][height].len();
        assert_eq!([stacked(1), stacked(2), stacked(3)], [8, 8, 5]);
        // (f): two blocks of the largest height are left in S3.
        let tail = superblocks.tails[3].expect("S3 is not full");
        assert_eq!((tail.superblock, tail.filled), (2, 16));
        assert_eq!((superblocks.capacity(3) - tail.filled) >> 3, 2);

        // b1 is the last of S1, b2 the first of S2; b13 and b14 lie behind b12.
        let at = |blocks: &mut Superblocks, height, slot| {
            let level = Level { width: 3, height };
            let block = blocks.assign(&provision, level, slot);
            (block.x, block.y)
        };
        let mut blocks = superblocks.clone();
        assert_eq!(at(&mut blocks, 3, 0), (8, 8));
        assert_eq!(at(&mut blocks, 3, 1), (16, 0));
        assert_eq!(at(&mut blocks, 2, 0), (16, 8));
        assert_eq!(at(&mut blocks, 2, 6), (32, 0), "b9, alone in S3");
        assert_eq!(at(&mut blocks, 1, 2), (32, 8), "b12");
        assert_eq!(at(&mut blocks, 1, 3), (32, 10), "b13");
        assert_eq!(at(&mut blocks, 2, 7), (32, 12), "b14");
    }

    #[test]
    fn provisions_the_requests_that_table_1_prints() {
        let mut superblocks = figure_8();
        let mut requested = Counts::default();
        requested[3][1..=3].copy_from_slice(&[10, 16, 7]);
        let provision = superblocks.provision(&requested).expect("room");
        let columns = &provision.widths[3];
        assert_eq!(columns.required[1..=3], [3, 9, 2]);
        assert_eq!(columns.offset[1..=3], [38, 10, 3]);
        let total = |h: usize| superblocks.stacks[3][h].len() as u32 + columns.required[h];
        assert_eq!([total(1), total(2), total(3)], [11, 17, 7]);
    }

    #[test]
    fn a_request_for_too_much_changes_nothing() {
        let mut superblocks = Superblocks::new([32, 32], 4);
        let mut requested = Counts::default();
        requested[4][4] = 4;
        requested[1][1] = 1;
        let before = superblocks.free_texels();
        assert_eq!(superblocks.needed(&requested), 5);
        assert_eq!(superblocks.provision(&requested).err(), Some(Full));
        assert_eq!(superblocks.free_texels(), before);
    }

    #[test]
    fn wide_blocks_come_first_and_superblocks_in_reading_order() {
        let mut superblocks = Superblocks::new([32, 32], 4);
        let level = Level {
            width: 4,
            height: 4,
        };
        let mut requested = Counts::default();
        requested[4][4] = 3;
        requested[1][1] = 1;
        let provision = superblocks.provision(&requested).expect("room");
        let blocks = [0, 1, 2].map(|slot| superblocks.assign(&provision, level, slot));
        assert_eq!(blocks.map(|b| (b.x, b.y)), [(0, 0), (16, 0), (0, 16)]);
        let level = Level {
            width: 1,
            height: 1,
        };
        let narrow = superblocks.assign(&provision, level, 0);
        assert_eq!((narrow.x, narrow.y), (16, 16));
    }
}
