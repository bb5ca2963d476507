//! Which units of each superblock are taken, a bit each. Twin of `columns.wgsl`.

/// Superblocks at most.
pub const MOST_SUPERBLOCKS: usize = 32;
/// Words of a superblock's units.
pub const UNIT_WORDS: usize = 16;
/// Looks for room that one frame takes: Mesa's software driver ends all loops of a
/// thread after 65,535 turns.
pub const MOST_LOOKS: u32 = 30_000;

/// A column of the atlas.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Superblock {
    /// First column of texels.
    pub x: u32,
    /// Columns.
    pub width: u32,
    /// Units that bins have.
    pub used: u32,
    /// The most that they had since it was made or collapsed.
    pub peak: u32,
}

/// All superblocks, and what is taken of them.
#[derive(Clone, Debug)]
pub struct Columns {
    units: u32,
    blocks: Vec<Superblock>,
    rows: Vec<[u32; UNIT_WORDS]>,
    looks: u32,
}

impl Columns {
    pub(super) fn new(units: u32) -> Self {
        Self {
            units,
            blocks: Vec::new(),
            rows: Vec::new(),
            looks: 0,
        }
    }

    pub(super) fn blocks(&self) -> &[Superblock] {
        &self.blocks
    }

    /// Begins a frame.
    pub(super) fn begin(&mut self) {
        self.looks = 0;
    }

    /// Counts a look; false where there were too many.
    pub(super) fn may_look(&mut self) -> bool {
        self.looks += 1;
        self.looks <= MOST_LOOKS
    }

    pub(super) fn clear(&mut self) {
        self.blocks.clear();
        self.rows.clear();
        self.looks = 0;
    }

    /// Adds an empty superblock to the right of the others.
    pub(super) fn push(&mut self, x: u32, width: u32) {
        self.blocks.push(Superblock {
            x,
            width,
            used: 0,
            peak: 0,
        });
        self.rows.push([0; UNIT_WORDS]);
    }

    /// Gives empty superblocks at the end back.
    pub(super) fn drop_last(&mut self) {
        while self.blocks.last().is_some_and(|last| last.used == 0) {
            self.blocks.pop();
            self.rows.pop();
        }
    }

    /// Begins a superblock's peak anew.
    pub(super) fn forget_peak(&mut self, superblock: usize) {
        self.blocks[superblock].peak = 0;
    }

    /// Which of 32 units from `32 * word` on are among these.
    fn mask(word: u32, first: u32, units: u32) -> u32 {
        let below = |end: u32| {
            let bits = end.clamp(32 * word, 32 * word + 32) - 32 * word;
            if bits == 32 {
                u32::MAX
            } else {
                (1 << bits) - 1
            }
        };
        below(first + units) & !below(first)
    }

    /// Takes units, or gives them back.
    pub(super) fn mark(&mut self, superblock: u32, first: u32, units: u32, is_taken: bool) {
        let rows = &mut self.rows[superblock as usize];
        for word in first / 32..(first + units).div_ceil(32) {
            let mask = Self::mask(word, first, units);
            let row = &mut rows[word as usize];
            *row = if is_taken { *row | mask } else { *row & !mask };
        }
        let block = &mut self.blocks[superblock as usize];
        block.used = if is_taken {
            block.used + units
        } else {
            block.used - units
        };
        block.peak = block.peak.max(block.used);
    }

    /// Whether all of these units are free.
    pub(super) fn is_free(&self, superblock: u32, first: u32, units: u32) -> bool {
        let rows = &self.rows[superblock as usize];
        (first / 32..(first + units).div_ceil(32))
            .all(|word| rows[word as usize] & Self::mask(word, first, units) == 0)
    }

    /// The first of so many free units in a row or, where there are not so many, the
    /// longest run of them; and how many there are.
    pub(super) fn run(&mut self, superblock: u32, units: u32) -> (u32, u32) {
        let rows = self.rows[superblock as usize];
        let (mut at, mut run, mut best) = (0, 0, (0, 0));
        while at < self.units && self.may_look() {
            let inside = at % 32;
            let word = rows[(at / 32) as usize] >> inside;
            let left = 32 - inside;
            if word & 1 == 0 {
                let free = word.trailing_zeros().min(left).min(self.units - at);
                run += free;
                at += free;
                if run > best.1 {
                    best = (at - run, run.min(units));
                }
                if run >= units {
                    break;
                }
            } else {
                at += word.trailing_ones().min(left);
                run = 0;
            }
        }
        best
    }
}
