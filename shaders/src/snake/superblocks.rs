//! Superblocks: full-height columns of the atlas, in which bins lie one below
//! another. Twin of `superblocks.wgsl`.
//!
//! A bin has so many rows of its superblock, in **units** of two rows of texels or
//! more; which units are taken is a bit each, so that room that comes back is room
//! for any other bin. Superblocks stand side by side and are as wide as their first
//! bin asks for; the last ones are given back when they are empty.
//!
//! Source: Hladky et al., "SnakeBinning", 2021, section 3.5, algorithm 2. We differ
//! in letting a bin grow where it stands if the units below are free, in filling
//! holes, in passing over superblocks of which a bin's rows would leave more than a
//! quarter empty, and in placing large bins first, the largest first of all.

use super::bins::Template;

/// Superblocks at most.
pub const MOST_SUPERBLOCKS: usize = 32;
/// Words of a superblock's units.
pub const UNIT_WORDS: usize = 16;
/// Bins that take more than this fraction of the atlas are placed first; of so many
/// there cannot be more.
pub const MOST_LARGE: usize = 64;
/// Looks for room that one frame takes: Mesa's software driver ends all loops of a
/// thread after 65,535 turns.
pub const MOST_LOOKS: u32 = 40_000;

/// Size of an atlas, as bins see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sheet {
    /// Columns of texels.
    pub width: u32,
    /// Units of height.
    pub units: u32,
    /// Rows of texels in a unit; even.
    pub unit: u32,
    /// Columns of the narrowest superblock, where there are so many.
    pub least_width: u32,
}

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

/// Where a bin lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Which superblock.
    pub superblock: u32,
    /// First of its units there.
    pub first: u32,
    /// Units.
    pub units: u32,
    /// Triangles that have room.
    pub capacity: u32,
}

/// Who has which rows.
#[derive(Clone, Debug)]
pub struct Superblocks {
    sheet: Sheet,
    blocks: Vec<Superblock>,
    rows: Vec<[u32; UNIT_WORDS]>,
    looks: u32,
}

impl Superblocks {
    /// An empty atlas.
    #[must_use]
    pub fn new(sheet: Sheet) -> Self {
        Self {
            sheet,
            blocks: Vec::new(),
            rows: Vec::new(),
            looks: 0,
        }
    }

    /// All superblocks, from left to right.
    #[must_use]
    pub fn blocks(&self) -> &[Superblock] {
        &self.blocks
    }

    /// Size of the atlas.
    pub(super) fn sheet(&self) -> Sheet {
        self.sheet
    }

    /// The same, to be changed.
    pub(super) fn blocks_mut(&mut self) -> &mut [Superblock] {
        &mut self.blocks
    }

    /// Begins a frame.
    pub(super) fn begin(&mut self) {
        self.looks = 0;
    }

    /// Takes everything back (atlas reset).
    pub fn clear(&mut self) {
        self.blocks.clear();
        self.rows.clear();
        self.looks = 0;
    }

    /// Units for so many triangles of which `per` stand side by side.
    fn units_for(&self, template: &Template, triangles: u32, per: u32) -> u32 {
        let rows = triangles.div_ceil(per) * (template.height + 1);
        rows.div_ceil(self.sheet.unit)
    }

    fn capacity(&self, template: &Template, units: u32, per: u32) -> u32 {
        units * self.sheet.unit / (template.height + 1) * per
    }

    /// Gives the rows of a bin back.
    pub fn release(&mut self, place: Place) {
        self.mark(place.superblock, place.first, place.units, false);
    }

    /// Gives back what a bin has beyond room for so many triangles.
    pub fn shrink(&mut self, template: &Template, place: &mut Place, triangles: u32) {
        let per = template.in_row(self.blocks[place.superblock as usize].width);
        let units = self.units_for(template, triangles, per);
        if units < place.units {
            self.mark(
                place.superblock,
                place.first + units,
                place.units - units,
                false,
            );
            place.units = units;
            place.capacity = self.capacity(template, units, per);
        }
    }

    /// Whether a bin that were laid anew for so many triangles would give a third of
    /// its units back.
    #[must_use]
    pub fn is_sparse(&self, template: &Template, place: &Place, triangles: u32) -> bool {
        let per = template.in_row(self.blocks[place.superblock as usize].width);
        self.units_for(template, triangles, per) * 3 < place.units * 2
    }

    /// Makes room for so many triangles where the bin stands; false if there is none.
    pub fn grow(&mut self, template: &Template, place: &mut Place, triangles: u32) -> bool {
        let per = template.in_row(self.blocks[place.superblock as usize].width);
        // More than the atlas has texels overflow nothing.
        if triangles > per * self.sheet.units * self.sheet.unit {
            return false;
        }
        let units = self.units_for(template, triangles, per);
        let (end, more) = (place.first + place.units, units - place.units);
        if end + more > self.sheet.units || !self.is_free(place.superblock, end, more) {
            return false;
        }
        self.mark(place.superblock, end, more, true);
        place.units = units;
        place.capacity = self.capacity(template, units, per);
        true
    }

    /// Texels that so many triangles of a bin cost, at most all.
    #[must_use]
    pub fn area(&self, template: &Template, triangles: u32) -> u32 {
        let all = self.sheet.width * self.sheet.units * self.sheet.unit;
        if triangles > all / template.cost.max(1) {
            all
        } else {
            triangles * template.cost
        }
    }

    /// Whether a bin of that area is placed before the others.
    #[must_use]
    pub fn is_large(&self, area: u32) -> bool {
        area > self.sheet.width * self.sheet.units * self.sheet.unit / MOST_LARGE as u32
    }

    /// Finds room for so many triangles of a bin.
    pub fn place(&mut self, template: &Template, triangles: u32) -> Option<Place> {
        let all = self.sheet.width * self.sheet.units * self.sheet.unit;
        if triangles > all / template.cost.max(1) {
            return None;
        }
        self.place_in_one(template, triangles, true)
            .or_else(|| self.place_in_new(template, triangles))
            .or_else(|| self.place_in_one(template, triangles, false))
    }

    /// Where the rows take the fewest texels.
    fn place_in_one(
        &mut self,
        template: &Template,
        triangles: u32,
        is_choosy: bool,
    ) -> Option<Place> {
        let (mut least, mut best) = (u32::MAX, None);
        for superblock in 0..self.blocks.len() {
            self.looks += 1;
            let Superblock { width, used, .. } = self.blocks[superblock];
            let per = template.in_row(width);
            if self.looks > MOST_LOOKS || per == 0 {
                continue;
            }
            if is_choosy && template.columns(per) * 4 < width * 3 {
                continue;
            }
            let units = self.units_for(template, triangles, per);
            if units > self.sheet.units - used || units * width >= least {
                continue;
            }
            if let Some(first) = self.first_fit(superblock as u32, units) {
                (least, best) = (units * width, Some((superblock as u32, first, units, per)));
            }
        }
        best.map(|(superblock, first, units, per)| {
            self.take(template, superblock, first, units, per)
        })
    }

    /// About as wide as the bin in a square, but so that bins of this size fill
    /// the height.
    fn place_in_new(&mut self, template: &Template, triangles: u32) -> Option<Place> {
        let x = self.blocks.last().map_or(0, |last| last.x + last.width);
        let left = self.sheet.width - x;
        let pair = template.to_odd + template.length + 1;
        let area = triangles * template.cost;
        let (side, height) = (square_root(area), self.sheet.units * self.sheet.unit);
        let rows = height / ((2 * height + side) / (2 * side)).max(1);
        let filling = area.div_ceil(rows) + template.length / 2;
        let mut width = filling.max(self.sheet.least_width).max(pair);
        width = width.next_multiple_of(2).min(left);
        let room = |width: u32| {
            let per = template.in_row(width);
            per > 0 && self.units_for(template, triangles, per) <= self.sheet.units
        };
        // What would be left over has to be of use.
        if !room(width) || left - width < self.sheet.least_width {
            width = left;
        }
        if self.blocks.len() == MOST_SUPERBLOCKS || !room(width) {
            return None;
        }
        let per = template.in_row(width);
        let units = self.units_for(template, triangles, per);
        let superblock = self.blocks.len() as u32;
        self.blocks.push(Superblock {
            x,
            width,
            used: 0,
            peak: 0,
        });
        self.rows.push([0; UNIT_WORDS]);
        Some(self.take(template, superblock, 0, units, per))
    }

    fn take(
        &mut self,
        template: &Template,
        superblock: u32,
        first: u32,
        units: u32,
        per: u32,
    ) -> Place {
        self.mark(superblock, first, units, true);
        Place {
            superblock,
            first,
            units,
            capacity: self.capacity(template, units, per),
        }
    }

    /// Gives empty superblocks at the end back.
    pub fn drop_last(&mut self) {
        while self.blocks.last().is_some_and(|last| last.used == 0) {
            self.blocks.pop();
            self.rows.pop();
        }
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

    fn mark(&mut self, superblock: u32, first: u32, units: u32, is_taken: bool) {
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

    fn is_free(&self, superblock: u32, first: u32, units: u32) -> bool {
        let rows = &self.rows[superblock as usize];
        (first / 32..(first + units).div_ceil(32))
            .all(|word| rows[word as usize] & Self::mask(word, first, units) == 0)
    }

    /// The first of so many free units in a row.
    fn first_fit(&mut self, superblock: u32, units: u32) -> Option<u32> {
        let rows = &self.rows[superblock as usize];
        let (mut at, mut run) = (0, 0);
        while at < self.sheet.units && self.looks <= MOST_LOOKS {
            self.looks += 1;
            let inside = at % 32;
            let word = rows[(at / 32) as usize] >> inside;
            let left = 32 - inside;
            if word & 1 == 0 {
                let free = word.trailing_zeros().min(left).min(self.sheet.units - at);
                run += free;
                at += free;
                if run >= units {
                    return Some(at - run);
                }
            } else {
                at += word.trailing_ones().min(left);
                run = 0;
            }
        }
        None
    }
}

/// The least number whose square is no less.
fn square_root(area: u32) -> u32 {
    let mut root = 0_u32;
    for bit in (0..16).rev() {
        let larger = root | 1 << bit;
        if larger * larger <= area {
            root = larger;
        }
    }
    root + u32::from(root * root < area)
}
