//! How much of an atlas the rows of a bin take. Twin: `superblocks.wgsl`.

use super::bins::Template;

/// Bins that ask for more than this fraction of the atlas are placed first; of so many
/// there cannot be more.
pub const MOST_LARGE: usize = 64;

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

impl Sheet {
    pub(super) fn texels(&self) -> u32 {
        self.width * self.units * self.unit
    }

    /// Units for so many triangles of which `per` stand side by side.
    pub(super) fn units_for(&self, template: &Template, triangles: u32, per: u32) -> u32 {
        let rows = triangles.div_ceil(per) * (template.height + 1);
        rows.div_ceil(self.unit)
    }

    /// Triangles that have room in so many units.
    pub(super) fn capacity(&self, template: &Template, units: u32, per: u32) -> u32 {
        units * self.unit / (template.height + 1) * per
    }

    /// Texels that so many triangles of a bin cost, at most all.
    #[must_use]
    pub fn area(&self, template: &Template, triangles: u32) -> u32 {
        if triangles > self.texels() / template.cost.max(1) {
            self.texels()
        } else {
            triangles * template.cost
        }
    }

    /// Whether a bin that asks for so many texels is placed before the others.
    #[must_use]
    pub fn is_large(&self, area: u32) -> bool {
        area > self.texels() / MOST_LARGE as u32
    }
}
