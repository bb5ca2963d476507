//! The atlas's memory: superblocks, the columns they are cut into, and stacks
//! of free blocks. Twin of `provision.wgsl`.
//!
//! A superblock belongs to one width; its columns are filled top down, one
//! after another, with blocks of that width. So a place in it is one number,
//! the texels of column length before it, and many blocks are handed out by
//! one addition. Blocks that come back wait on the stack of their level.
//! Nothing is ever merged; that is what an atlas reset is for. So superblocks
//! only come back all at once, and their stack is a number.
//!
//! Source: Mueller et al., "Shading Atlas Streaming", 2018, section 4.2, table
//! 1 and figure 8. One thread does here in order what the kernels do with one
//! thread for many blocks; the numbers are the same.

use super::{
    NONE,
    level::{LEVELS, Level, MAX_LOG2_SIDE, MIN_LOG2_SIDE, index},
    memory::{Counts, FreeTexels, Full, Memory},
};

/// log2 of a side is below this.
const SIDES: usize = MAX_LOG2_SIDE as usize + 1;

/// All memory that no block occupies.
#[derive(Clone, Debug)]
pub struct Superblocks {
    /// log2 of a superblock's side.
    log2_side: u8,
    /// Superblocks side by side.
    per_row: u32,
    /// All of them, free or not.
    total: u32,
    /// Those that are not free, which are the first.
    taken: u32,
    /// The partly filled superblock of each width.
    tails: [Option<Tail>; SIDES],
    /// Positions of free blocks, by [`Level::index`].
    stacks: Vec<Vec<u32>>,
}

/// A superblock that the next provisioning tops up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tail {
    /// Which.
    pub superblock: u32,
    /// Texels of column length in use, a multiple of the width.
    pub filled: u32,
}

/// What provisioning found for one frame's requests.
#[derive(Clone, Debug, Default)]
pub struct Provision {
    widths: [Columns; SIDES],
}

/// The share of one width: the old tail, if any, then fresh superblocks.
#[derive(Clone, Debug, Default)]
struct Columns {
    tail: Option<u32>,
    /// The first fresh one; the others follow.
    first: u32,
    /// By log2 height: requests that the stack could not serve.
    required: [u32; SIDES],
    /// By log2 height: where those begin, in heights from the first superblock.
    offset: [u64; SIDES],
}

impl Superblocks {
    /// All free; `per_row` of `total` superblocks stand side by side.
    #[must_use]
    pub fn new(log2_side: u8, per_row: u32, total: u32) -> Self {
        Self {
            log2_side,
            per_row,
            total,
            taken: 0,
            tails: [None; SIDES],
            stacks: vec![Vec::new(); LEVELS],
        }
    }

    /// Free blocks of each level, the next to be handed out last.
    #[must_use]
    pub fn stacks(&self) -> &[Vec<u32>] {
        &self.stacks
    }

    /// The partly filled superblock of each log2 width.
    #[must_use]
    pub fn tails(&self) -> &[Option<Tail>] {
        &self.tails
    }

    /// Texels of column length in a superblock of this log2 width.
    fn capacity(&self, width: u8) -> u64 {
        1 << (2 * self.log2_side - width)
    }

    fn widths(&self) -> std::ops::RangeInclusive<u8> {
        MIN_LOG2_SIDE..=self.log2_side
    }

    /// By log2 height: blocks that the stacks of a width cannot serve.
    fn required(&self, width: u8, requested: &Counts) -> [u32; SIDES] {
        let mut required = [0; SIDES];
        for height in MIN_LOG2_SIDE..=width {
            let level = index(width, height);
            let stacked = self.stacks[level].len() as u32;
            required[usize::from(height)] = requested[level].saturating_sub(stacked);
        }
        required
    }

    fn fresh_of_width(&self, width: u8, required: &[u32; SIDES]) -> u64 {
        let tail = self.tails[usize::from(width)];
        let filled = tail.map_or(0, |tail| u64::from(tail.filled));
        (filled + column_length(required)).div_ceil(self.capacity(width))
            - u64::from(tail.is_some())
    }

    /// The stacks come first. What they cannot serve tops up the tail of its
    /// width and then fresh superblocks, tallest blocks first, so that every
    /// block is aligned to its height. The end is rounded up to a square, and
    /// what lies between goes to the stacks (figure 8, e).
    fn provision_width(&mut self, width: u8, columns: &mut Columns) {
        let fresh = self.fresh_of_width(width, &columns.required);
        let tail = self.tails[usize::from(width)].take();
        columns.tail = tail.map(|tail| tail.superblock);
        columns.first = self.taken;
        self.taken += fresh as u32;

        let mut end = tail.map_or(0, |tail| u64::from(tail.filled));
        for height in (MIN_LOG2_SIDE..=width).rev().map(usize::from) {
            columns.offset[height] = end >> height;
            end += u64::from(columns.required[height]) << height;
        }
        for height in MIN_LOG2_SIDE..width {
            if end >> height & 1 == 1 {
                let rest = self.position(columns, width, end);
                self.stacks[index(width, height)].push(rest);
                end += 1 << height;
            }
        }
        let filled = (end % self.capacity(width)) as u32;
        self.tails[usize::from(width)] = (filled != 0).then(|| Tail {
            superblock: columns.superblock(end / self.capacity(width)),
            filled,
        });
    }

    /// Where the block begins that lies `start` texels of column length into
    /// the superblocks of a width.
    fn position(&self, columns: &Columns, width: u8, start: u64) -> u32 {
        let superblock = columns.superblock(start / self.capacity(width));
        let inside = (start % self.capacity(width)) as u32;
        let column = inside >> self.log2_side;
        let x = ((superblock % self.per_row) << self.log2_side) + (column << width);
        let y = ((superblock / self.per_row) << self.log2_side)
            + (inside & ((1 << self.log2_side) - 1));
        x | y << 16
    }
}

impl Memory for Superblocks {
    type Provision = Provision;

    fn needed(&self, requested: &Counts) -> u64 {
        let of_width = |width| {
            let heights = (MIN_LOG2_SIDE..=width).map(|height| {
                let blocks = u64::from(requested[index(width, height)]);
                blocks << height
            });
            heights.sum::<u64>().div_ceil(self.capacity(width))
        };
        self.widths().map(of_width).sum()
    }

    fn fresh(&self, requested: &Counts) -> u64 {
        self.widths()
            .map(|width| self.fresh_of_width(width, &self.required(width, requested)))
            .sum()
    }

    fn free(&self) -> u32 {
        self.total - self.taken
    }

    fn release(&mut self, position: u32, level: Level) {
        self.stacks[level.index()].push(position);
    }

    fn provision(&mut self, requested: &Counts) -> Result<Provision, Full> {
        if self.fresh(requested) > u64::from(self.free()) {
            return Err(Full);
        }
        let mut provision = Provision::default();
        for width in self.widths().rev() {
            let columns = &mut provision.widths[usize::from(width)];
            columns.required = self.required(width, requested);
            self.provision_width(width, columns);
        }
        Ok(provision)
    }

    fn assign(&mut self, provision: &Provision, level: Level, slot: u32) -> u32 {
        let (width, height) = level.landscape();
        let columns = &provision.widths[usize::from(width)];
        if slot < columns.required[usize::from(height)] {
            let start = (columns.offset[usize::from(height)] + u64::from(slot)) << height;
            return self.position(columns, width, start);
        }
        // Provisioning counted a block on the stack for every other request.
        self.stacks[level.index()].pop().unwrap_or(NONE)
    }

    fn clear(&mut self) {
        self.taken = 0;
        self.tails = [None; SIDES];
        self.stacks.iter_mut().for_each(Vec::clear);
    }

    fn free_texels(&self) -> FreeTexels {
        let stacked: Vec<u32> = self.stacks.iter().map(|stack| stack.len() as u32).collect();
        free_texels(self.log2_side, self.free(), &self.tails, &stacked)
    }
}

/// Counts what no block occupies: `free` superblocks, the rest of the tails by
/// log2 width, and so many blocks on the stacks by [`Level::index`].
#[must_use]
pub fn free_texels(
    log2_side: u8,
    free: u32,
    tails: &[Option<Tail>],
    stacked: &[u32],
) -> FreeTexels {
    let mut texels = FreeTexels {
        superblocks: free,
        in_superblocks: u64::from(free) << (2 * log2_side),
        stacked: stacked.iter().sum(),
        ..FreeTexels::default()
    };
    for width in MIN_LOG2_SIDE..=log2_side {
        if let Some(tail) = tails[usize::from(width)] {
            let capacity = 1_u64 << (2 * log2_side - width);
            texels.in_tails += (capacity - u64::from(tail.filled)) << width;
        }
        for height in MIN_LOG2_SIDE..=width {
            texels.in_stacks += u64::from(stacked[index(width, height)]) << (width + height);
        }
    }
    texels
}

impl Columns {
    fn superblock(&self, nth: u64) -> u32 {
        match (self.tail, nth as u32) {
            (Some(tail), 0) => tail,
            (tail, nth) => self.first + nth - u32::from(tail.is_some()),
        }
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

    fn requested(levels: &[(u8, u8, u32)]) -> Counts {
        let mut counts = [0; LEVELS];
        for &(width, height, count) in levels {
            counts[index(width, height)] = count;
        }
        counts
    }

    /// The example of table 1 and figure 8 with every length doubled, since
    /// our smallest side is two texels: superblocks of 16, columns of width 8,
    /// heights 8, 4 and 2.
    fn figure_8() -> Superblocks {
        let mut superblocks = Superblocks::new(4, 3, 9);
        let start = superblocks
            .provision(&requested(&[(3, 3, 3)]))
            .expect("empty");
        assert_eq!((start.widths[3].tail, start.widths[3].first), (None, 0));
        assert_eq!(superblocks.free(), 8);
        // Free blocks from elsewhere; where they lie does not matter here.
        for (height, free) in [(3, 5), (2, 7), (1, 7)] {
            for _ in 0..free {
                superblocks.release(32 | 32 << 16, Level { width: 3, height });
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
        let provision = superblocks
            .provision(&requested(&[(3, 1, 10), (3, 2, 14), (3, 3, 7)]))
            .expect("room");
        let columns = &provision.widths[3];
        assert_eq!(columns.required[1..=3], [3, 7, 2]);
        assert_eq!(columns.offset[1..=3], [34, 10, 3]);
        assert_eq!((columns.tail, columns.first), (Some(0), 1), "S1, S2 and S3");
        assert_eq!(superblocks.free(), 6);
        let stacked = [1, 2, 3].map(|height| superblocks.stacks[index(3, height)].len());
        assert_eq!(stacked, [8, 8, 5]);
        // (f): two blocks of the largest height are left in S3.
        let tail = superblocks.tails[3].expect("S3 is not full");
        assert_eq!((tail.superblock, tail.filled), (2, 16));
        assert_eq!((superblocks.capacity(3) - u64::from(tail.filled)) >> 3, 2);

        // b1 is the last of S1, b2 the first of S2; b13 and b14 lie behind b12.
        let mut at = |height, slot| {
            let position = superblocks.assign(&provision, Level { width: 3, height }, slot);
            (position & 0xffff, position >> 16)
        };
        assert_eq!(at(3, 0), (8, 8));
        assert_eq!(at(3, 1), (16, 0));
        assert_eq!(at(2, 0), (16, 8));
        assert_eq!(at(2, 6), (32, 0), "b9, alone in S3");
        assert_eq!(at(1, 2), (32, 8), "b12");
        assert_eq!(at(1, 3), (32, 10), "b13");
        assert_eq!(at(2, 7), (32, 12), "b14");
    }

    #[test]
    fn provisions_the_requests_that_table_1_prints() {
        let mut superblocks = figure_8();
        let provision = superblocks
            .provision(&requested(&[(3, 1, 10), (3, 2, 16), (3, 3, 7)]))
            .expect("room");
        let columns = &provision.widths[3];
        assert_eq!(columns.required[1..=3], [3, 9, 2]);
        assert_eq!(columns.offset[1..=3], [38, 10, 3]);
        let total =
            |h: u8| superblocks.stacks[index(3, h)].len() as u32 + columns.required[usize::from(h)];
        assert_eq!([total(1), total(2), total(3)], [11, 17, 7]);
    }

    #[test]
    fn a_request_for_too_much_changes_nothing() {
        let mut superblocks = Superblocks::new(4, 2, 4);
        let counts = requested(&[(4, 4, 4), (1, 1, 1)]);
        let before = superblocks.free_texels();
        assert_eq!(superblocks.needed(&counts), 5);
        assert_eq!(superblocks.provision(&counts).err(), Some(Full));
        assert_eq!(superblocks.free_texels(), before);
    }

    #[test]
    fn wide_blocks_come_first_and_superblocks_in_reading_order() {
        let mut superblocks = Superblocks::new(4, 2, 4);
        let provision = superblocks
            .provision(&requested(&[(4, 4, 3), (1, 1, 1)]))
            .expect("room");
        let mut at = |side, slot| {
            let level = Level {
                width: side,
                height: side,
            };
            let position = superblocks.assign(&provision, level, slot);
            (position & 0xffff, position >> 16)
        };
        assert_eq!([at(4, 0), at(4, 1), at(4, 2)], [(0, 0), (16, 0), (0, 16)]);
        assert_eq!(at(1, 0), (16, 16));
    }
}
