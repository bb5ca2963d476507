//! Bins of triangles that look alike, and the footprint that all of a bin share.
//! Twin of `bins.wgsl`.
//!
//! A bin is a height above the longest edge, the length of that edge, and where
//! the tip's foot divides it. Its triangles stand in a zigzag, every second one
//! upside down, on whole texels: base and tip lie on rows of texel centres. Every
//! triangle is stretched to the footprint of its bin, so that its corners stand
//! still while it stays in the bin, however the eye moves; nothing between
//! triangles is left to be filled up.
//!
//! Neighbours are as near as bilinear lookups allow: a texel belongs to a
//! triangle where a lookup inside of the triangle may touch it, that is, where
//! the open square of two texels about its centre meets the triangle.
//!
//! Source: Hladky et al., "SnakeBinning", 2021, sections 3.2, 3.8 and 5.1. We
//! differ in counting the length in place of the second angle ("any three
//! parameters describing a triangle would work"), in whole texels, and in
//! padding by what lookups touch, which for flat triangles is more than the
//! half texel of figure 6.

use bytemuck::{Pod, Zeroable};

/// Heights and lengths of footprints, in steps between texel centres: every
/// whole number, and from 8 on two to an octave: more would leave bins too few
/// triangles, each with half a row to spare. What is flatter than a texel lies
/// in a single row, and what is smaller than one has a single texel.
pub const SIZES: [u16; 20] = [
    0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 23, 32, 45, 64, 90, 128, 181, 256, 362,
];

/// Indices of the length above that of the height, and none: no triangle is flatter.
pub const STRETCHES: u32 = 12;

/// Places of the tip's foot: none to two quarters of the length.
pub const TIPS: u32 = 3;

/// All bins.
pub const BINS: usize = SIZES.len() * STRETCHES as usize * TIPS as usize;

/// Steps of a binary logarithm to an octave.
pub const OCTAVE: i32 = 256;

/// The logarithm of one pixel in a wish, steps: no less than a 16th of one is told.
pub const PIXEL: i32 = 4 * OCTAVE;

/// Largest length or height of a wish, steps.
pub const LONGEST: i32 = PIXEL + 12 * OCTAVE;

/// Logarithm of a length that is between two sizes as it is between their logarithms;
/// the first is of half an octave below a texel.
const BORDERS: [i32; SIZES.len() - 1] = borders();

/// Footprint of a bin, and its place in the zigzag.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Template {
    /// Rows from base to tip, less one.
    pub height: u32,
    /// Columns of the base, less one.
    pub length: u32,
    /// Column of the tip, from the end at the larger angle.
    pub tip: u32,
    /// The first bin with this very footprint.
    pub same: u32,
    /// Columns from an upright triangle's first to the next's, which is upside down; 0
    /// where there is no such bin.
    pub to_odd: u32,
    /// And from there to the next upright one.
    pub to_even: u32,
    /// Texels that a triangle takes in a long row.
    pub cost: u32,
    /// log2 of the height, and in the upper half of the length, as in wishes.
    pub logs: u32,
}

/// The footprint of each bin.
#[must_use]
pub fn templates() -> Vec<Template> {
    let mut templates: Vec<Template> = Vec::with_capacity(BINS);
    for bin in 0..BINS as u32 {
        let (height, length, tip) = parts(bin);
        let mut template = SIZES
            .get(length as usize)
            .map_or_else(Template::default, |&l| {
                let h = u32::from(SIZES[height as usize]);
                Template::new(h, u32::from(l), u32::from(l) * tip / 4)
            });
        let alike = |other: &Template| {
            (other.height, other.length, other.tip)
                == (template.height, template.length, template.tip)
        };
        let first = bin - tip;
        let same = templates[first as usize..].iter().position(alike);
        template.same = same.map_or(bin, |at| first + at as u32);
        templates.push(template);
    }
    templates
}

/// Indices of height and length, and the tip, of a bin.
#[must_use]
pub fn parts(bin: u32) -> (u32, u32, u32) {
    let height = bin / (STRETCHES * TIPS);
    (height, height + bin / TIPS % STRETCHES, bin % TIPS)
}

/// The bin of these parts; the length is no less than the height and at most 11 more.
#[must_use]
pub fn bin(height: u32, length: u32, tip: u32) -> u32 {
    (height * STRETCHES + length - height) * TIPS + tip
}

/// Texels of one row, from the upper one, that belong to an upright triangle: first
/// and last column.
fn owned(height: u32, length: u32, tip: u32, row: u32) -> (i32, i32) {
    if height == 0 {
        return (0, length as i32);
    }
    // The widest place that a lookup in reach of the row may be at.
    let from_tip = (row + 1).min(height);
    let first = tip - (tip * from_tip).div_ceil(height);
    let last = tip + ((length - tip) * from_tip).div_ceil(height);
    (first as i32, last as i32)
}

impl Template {
    fn new(height: u32, length: u32, tip: u32) -> Self {
        let upright = |row| owned(height, length, tip, row);
        let turned = |row: u32| {
            let (first, last) = upright(height - row);
            (length as i32 - last, length as i32 - first)
        };
        let rows = || 0..=height;
        let to_odd = rows().map(|row| upright(row).1 + 1 - turned(row).0).max();
        let to_even = rows().map(|row| turned(row).1 + 1 - upright(row).0).max();
        let (to_odd, to_even) = (to_odd.unwrap_or(1) as u32, to_even.unwrap_or(1) as u32);
        let to_even = to_even.max(length + 1 - to_odd.min(length + 1));
        let log = |size: u32| {
            let size = if size == 0 { LEAST } else { f64::from(size) };
            (size.log2() * f64::from(OCTAVE)).round() as i32 + PIXEL
        };
        Self {
            height,
            length,
            tip,
            same: 0,
            to_odd,
            to_even,
            cost: ((to_odd + to_even) * (height + 1)).div_ceil(2),
            logs: (log(height) | log(length) << 16) as u32,
        }
    }

    /// Triangles that stand side by side in so many columns.
    #[must_use]
    pub fn in_row(&self, columns: u32) -> u32 {
        let (first, pair) = (self.length + 1, self.to_odd + self.to_even);
        if columns < first {
            return 0;
        }
        let odd = 1 + 2 * ((columns - first) / pair);
        if columns < first + self.to_odd {
            return odd;
        }
        odd.max(2 + 2 * ((columns - first - self.to_odd) / pair))
    }

    /// Columns that so many triangles take, at least one.
    #[must_use]
    pub fn columns(&self, triangles: u32) -> u32 {
        let before = triangles - 1;
        let pair = self.to_odd + self.to_even;
        before / 2 * pair + before % 2 * self.to_odd + self.length + 1
    }

    /// Texels of the corners at the larger angle, at the smaller one, and of the
    /// tip, of a triangle with its first texel at `x`, `y`.
    #[must_use]
    pub fn corners(&self, [x, y]: [u32; 2], is_odd: bool) -> [[u32; 2]; 3] {
        let Self {
            height,
            length,
            tip,
            ..
        } = *self;
        if is_odd {
            [[x + length, y], [x, y], [x + length - tip, y + height]]
        } else {
            [[x, y + height], [x + length, y + height], [x + tip, y]]
        }
    }
}

/// What a triangle deserves in an atlas without limits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wish {
    /// log2 of pixels from the longest edge to the tip, steps, and [`PIXEL`].
    pub height: u16,
    /// log2 of the pixels of the longest edge, likewise.
    pub length: u16,
    /// Where the tip's foot divides that edge, 512ths, from the larger angle.
    pub tip: u8,
    /// Which corner is the tip, and whether the one after it or (1) the one before
    /// it is at the larger angle: `2 * corner + before`, at most 5.
    pub turn: u8,
    /// log2 of the depth of each corner over the least, eighths of an octave below 32.
    pub depths: [u8; 3],
}

impl Wish {
    /// As kernels have it.
    #[must_use]
    pub fn words(self) -> [u32; 2] {
        let [a, b, c] = self.depths.map(u32::from);
        let depths = a | b << 5 | c << 10;
        let turn = u32::from(self.turn);
        [
            u32::from(self.length) | u32::from(self.height) << 16,
            turn << 12 | depths << 15 | u32::from(self.tip),
        ]
    }

    /// What of the wish goes into a slot as it is.
    #[must_use]
    pub fn form(self) -> u32 {
        self.words()[1] & FORM
    }
}

/// Bits of a slot's shape that tell its bin.
pub const BIN: u32 = 0xfff;
/// Bits of a slot's shape that tell its turn, from 12 on, and depths, 5 each from 15 on.
pub const FORM: u32 = 0x3fff_f000;
/// Bits of the turn among those.
pub const TURN: u32 = 0x7000;

/// The bin that is nearest to a wish at a bias, steps of log2 of an area. `largest`
/// is the index of the largest size that has room.
#[must_use]
pub fn bin_of(templates: &[Template], wish: Wish, bias: i32, largest: u32) -> u32 {
    let shrink = bias / 2 + PIXEL;
    let height = size_of(i32::from(wish.height).min(LONGEST) - shrink);
    let length = size_of(i32::from(wish.length).min(LONGEST) - shrink).min(largest);
    let length = length.max(height.min(largest));
    let height = height
        .min(length)
        .max(length.max(STRETCHES - 1) - (STRETCHES - 1));
    // From 512ths to quarters.
    let tip = (u32::from(wish.tip) + 64) >> 7;
    templates[bin(height, length, tip) as usize].same
}

/// How much shorter than wished a footprint may be before the triangle moves, steps.
const TOO_SMALL: i32 = 110;
/// Halves of its own bin's cost that a triangle's footprint may have; one that it is
/// mapped to has four at most.
const TOO_LARGE: u32 = 6;
/// How many tips further the tip may be.
pub const ASIDE: u32 = 1;

/// Whether a triangle may stay in a bin: the hysteresis of section 3.6.
#[must_use]
pub fn is_near(templates: &[Template], old: u32, wish: Wish, bias: i32, largest: u32) -> bool {
    let own = bin_of(templates, wish, bias, largest);
    let most = (templates[bin(largest, largest, 0) as usize].logs >> 16) as i32;
    let template = &templates[old as usize];
    let is_long = |wish: u16, log: u32| {
        (i32::from(wish).min(LONGEST) - bias / 2).min(most) - log as i32 <= TOO_SMALL
    };
    is_long(wish.height, template.logs & 0xffff)
        && is_long(wish.length, template.logs >> 16)
        && template.cost * 2 <= templates[own as usize].cost * TOO_LARGE
        && parts(old).2.abs_diff(parts(own).2) <= ASIDE
}

/// Whether corners lie so deep that the slot's own foreshortening still serves.
#[must_use]
pub fn is_foreshortened_alike(shape: u32, form: u32) -> bool {
    [15, 20, 25].iter().all(|shift| {
        let depth = |word: u32| (word >> shift & 31) as i32;
        (depth(shape) - depth(form)).abs() <= 2
    })
}

/// Pixels that the size 0 stands for.
const LEAST: f64 = 0.6;

/// Index of the size nearest to a length, by its logarithm in steps.
#[must_use]
pub fn size_of(log: i32) -> u32 {
    BORDERS.partition_point(|&border| border <= log) as u32
}

/// Half the sum of the logarithms of neighbours, in whole numbers: 512 log2(x) is
/// found by squaring.
const fn borders() -> [i32; SIZES.len() - 1] {
    let mut borders = [-OCTAVE / 2; SIZES.len() - 1];
    let mut i = 1;
    while i < borders.len() {
        // log2(sqrt(a b)) = log2(a b) / 2.
        borders[i] = (log2_fixed(SIZES[i] as u64 * SIZES[i + 1] as u64) + 1) / 2;
        i += 1;
    }
    borders
}

/// 256 log2 of a whole number, rounded down.
const fn log2_fixed(x: u64) -> i32 {
    let octave = x.ilog2();
    let mut mantissa = (x as u128) << (62 - octave);
    let mut log = octave as i32;
    let mut bit = 0;
    while bit < 8 {
        mantissa = (mantissa * mantissa) >> 62;
        log *= 2;
        if mantissa >> 63 != 0 {
            mantissa >>= 1;
            log += 1;
        }
        bit += 1;
    }
    log
}

/// The borders between sizes, for the kernel.
#[must_use]
pub fn size_borders() -> &'static [i32] {
    &BORDERS
}

#[cfg(test)]
mod tests;
