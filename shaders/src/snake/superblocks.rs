//! Superblocks: full-height columns of the atlas, in which bins lie one below
//! another. Twin of `superblocks.wgsl`.
//!
//! A bin has up to [`MOST_EXTENTS`] **extents**, each so many rows of a superblock, in
//! units of two rows of texels or more. Its slots are numbered through all of them. A
//! bin that grows takes the units below its last extent if they are free, else
//! another extent wherever rows cost the fewest texels; so nobody moves for another's
//! sake, and little has to be kept free beforehand. Where no rows in one piece are
//! left, those of several are taken. Superblocks stand side by side and are as wide
//! as their first bin asks for; the last ones are given back when they are empty.
//!
//! Source: Hladky et al., "SnakeBinning", 2021, section 3.5, algorithm 2. We differ
//! in extents: there, a bin is in one piece and leaves when it outgrows it. And in
//! filling holes, in passing over superblocks of which a bin's rows would leave more
//! than a quarter empty, and in placing large bins first, the largest first of all.

use super::{
    bins::Template,
    columns::{Columns, MOST_SUPERBLOCKS, Superblock},
    sheet::Sheet,
};

/// Pieces of a bin at most.
pub const MOST_EXTENTS: usize = 8;
/// Rows of a superblock that a bin has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// Which superblock.
    pub superblock: u32,
    /// First of its units there.
    pub first: u32,
    /// Units.
    pub units: u32,
    /// Triangles that have room.
    pub capacity: u32,
}

/// Triangles that have room in a bin.
#[must_use]
pub fn capacity_of(extents: &[Extent]) -> u32 {
    extents.iter().map(|extent| extent.capacity).sum()
}

/// Who has which rows.
#[derive(Clone, Debug)]
pub struct Superblocks {
    sheet: Sheet,
    pub(super) columns: Columns,
}

impl Superblocks {
    /// An empty atlas.
    #[must_use]
    pub fn new(sheet: Sheet) -> Self {
        Self {
            sheet,
            columns: Columns::new(sheet.units),
        }
    }

    /// All superblocks, from left to right.
    #[must_use]
    pub fn blocks(&self) -> &[Superblock] {
        self.columns.blocks()
    }

    /// Size of the atlas.
    #[must_use]
    pub fn sheet(&self) -> Sheet {
        self.sheet
    }

    /// Gives all rows of a bin back.
    pub fn release(&mut self, extents: &mut Vec<Extent>) {
        for extent in extents.drain(..) {
            self.mark(extent, false);
        }
    }

    /// Whether a bin that were laid anew for so many triangles would give a third of
    /// its texels back.
    #[must_use]
    pub fn is_sparse(&self, template: &Template, extents: &[Extent], triangles: u32) -> bool {
        let width = |extent: &Extent| self.columns.blocks()[extent.superblock as usize].width;
        let texels: u32 = (extents.iter())
            .map(|extent| extent.units * width(extent))
            .sum();
        extents.first().is_some_and(|first| {
            let per = template.in_row(width(first));
            let anew = self.sheet.units_for(template, triangles, per) * width(first);
            anew * 3 < texels * 2
        })
    }

    /// Gives back what a bin has beyond room for so many triangles, from its end.
    pub fn shrink(&mut self, template: &Template, extents: &mut Vec<Extent>, triangles: u32) {
        let mut before = capacity_of(extents);
        while let Some(last) = extents.last_mut() {
            before -= last.capacity;
            let own = triangles.saturating_sub(before);
            let per = template.in_row(self.columns.blocks()[last.superblock as usize].width);
            let units = self.sheet.units_for(template, own, per).min(last.units);
            let gone = Extent {
                first: last.first + units,
                units: last.units - units,
                ..*last
            };
            last.units = units;
            last.capacity = self.sheet.capacity(template, units, per);
            self.mark(gone, false);
            if units > 0 {
                break;
            }
            extents.pop();
        }
    }

    /// Makes room for so many more triangles of a bin; false if there is none, and
    /// then it may have got some of it.
    pub fn extend(&mut self, template: &Template, extents: &mut Vec<Extent>, more: u32) -> bool {
        // More than the atlas has texels overflow nothing.
        if more > self.sheet.texels() / template.cost.max(1) {
            return false;
        }
        self.grow_last(template, extents, more)
            || extents.len() < MOST_EXTENTS
                && (self.place_in_one(template, extents, more, true)
                    || self.place_in_new(template, extents, more)
                    || self.place_in_one(template, extents, more, false)
                    || self.place_in_pieces(template, extents, more))
    }

    fn grow_last(&mut self, template: &Template, extents: &mut [Extent], more: u32) -> bool {
        let Some(last) = extents.last_mut() else {
            return false;
        };
        let per = template.in_row(self.columns.blocks()[last.superblock as usize].width);
        let units = (self.sheet).units_for(template, last.capacity + more, per);
        let (end, added) = (last.first + last.units, units - last.units);
        if end + added > self.sheet.units || !self.columns.is_free(last.superblock, end, added) {
            return false;
        }
        self.columns.mark(last.superblock, end, added, true);
        last.units = units;
        last.capacity = self.sheet.capacity(template, units, per);
        true
    }

    /// Where the rows take the fewest texels.
    fn place_in_one(
        &mut self,
        template: &Template,
        extents: &mut Vec<Extent>,
        more: u32,
        is_choosy: bool,
    ) -> bool {
        let (mut least, mut best) = (u32::MAX, None);
        for superblock in 0..self.columns.blocks().len() {
            let may_look = self.columns.may_look();
            let Superblock { width, used, .. } = self.columns.blocks()[superblock];
            let per = template.in_row(width);
            if !may_look || per == 0 {
                continue;
            }
            if is_choosy && template.columns(per) * 4 < width * 3 {
                continue;
            }
            let units = self.sheet.units_for(template, more, per);
            if units > self.sheet.units - used || units * width >= least {
                continue;
            }
            let (first, found) = self.columns.run(superblock as u32, units);
            if found == units {
                (least, best) = (units * width, Some((superblock as u32, first, units, per)));
            }
        }
        if let Some((superblock, first, units, per)) = best {
            self.take(template, extents, superblock, [first, units, per]);
        }
        best.is_some()
    }

    /// About as wide as the bin in a square, but so that bins of this size fill
    /// the height.
    fn place_in_new(&mut self, template: &Template, extents: &mut Vec<Extent>, more: u32) -> bool {
        let last = self.columns.blocks().last();
        let x = last.map_or(0, |last| last.x + last.width);
        let left = self.sheet.width - x;
        let pair = template.to_odd + template.length + 1;
        let area = more * template.cost;
        let (side, height) = (square_root(area), self.sheet.units * self.sheet.unit);
        let rows = height / ((2 * height + side) / (2 * side)).max(1);
        let filling = area.div_ceil(rows) + template.length / 2;
        let mut width = filling.max(self.sheet.least_width).max(pair);
        width = width.next_multiple_of(2).min(left);
        let room = |width: u32| {
            let per = template.in_row(width);
            per > 0 && self.sheet.units_for(template, more, per) <= self.sheet.units
        };
        // What would be left over has to be of use.
        if !room(width) || left - width < self.sheet.least_width {
            width = left;
        }
        if self.columns.blocks().len() == MOST_SUPERBLOCKS || !room(width) {
            return false;
        }
        let per = template.in_row(width);
        let units = self.sheet.units_for(template, more, per);
        let superblock = self.columns.blocks().len() as u32;
        self.columns.push(x, width);
        self.take(template, extents, superblock, [0, units, per]);
        true
    }

    /// The longest pieces that there are, one after another.
    fn place_in_pieces(
        &mut self,
        template: &Template,
        extents: &mut Vec<Extent>,
        more: u32,
    ) -> bool {
        let mut missing = more;
        while extents.len() < MOST_EXTENTS {
            let (mut most, mut best) = (0, (0, [0; 3]));
            for superblock in 0..self.columns.blocks().len() {
                let may_look = self.columns.may_look();
                let Superblock { width, used, .. } = self.columns.blocks()[superblock];
                let per = template.in_row(width);
                if !may_look || per == 0 || used == self.sheet.units {
                    continue;
                }
                let units = self.sheet.units_for(template, missing, per);
                let (first, found) = self.columns.run(superblock as u32, units);
                let room = self.sheet.capacity(template, found, per).min(missing);
                if room > most {
                    let units = self.sheet.units_for(template, room, per);
                    (most, best) = (room, (superblock as u32, [first, units, per]));
                }
            }
            if most == 0 {
                return false;
            }
            self.take(template, extents, best.0, best.1);
            missing -= most;
            if missing == 0 {
                return true;
            }
        }
        false
    }

    fn take(
        &mut self,
        template: &Template,
        extents: &mut Vec<Extent>,
        superblock: u32,
        [first, units, per]: [u32; 3],
    ) {
        let extent = Extent {
            superblock,
            first,
            units,
            capacity: self.sheet.capacity(template, units, per),
        };
        self.mark(extent, true);
        extents.push(extent);
    }

    fn mark(&mut self, extent: Extent, is_taken: bool) {
        let Extent {
            superblock,
            first,
            units,
            ..
        } = extent;
        self.columns.mark(superblock, first, units, is_taken);
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

#[cfg(test)]
mod tests;
