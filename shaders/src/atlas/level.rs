//! How large a block a patch gets, in whole numbers. Twin of `level.wgsl`.
//!
//! Logarithms are counted in 256ths of an octave ([`OCTAVE`]), so that every
//! driver chooses the same level from the same wish.
//!
//! Source: Mueller et al., "Shading Atlas Streaming", 2018, section 4.3,
//! equation 2. We differ in [`steady_level`], which lets a block stay where
//! rounding alone would make it jump.

/// Steps of a binary logarithm to an octave.
pub const OCTAVE: i32 = 256;

/// log2 of the smallest side of a block, texels.
pub const MIN_LOG2_SIDE: u8 = 1;

/// log2 of the largest side of a superblock: positions have 16 bits.
pub const MAX_LOG2_SIDE: u8 = 15;

/// Levels of blocks as they lie in the atlas, landscape, at most.
pub const LEVELS: usize = 120;

/// log2 of the area of the smallest block, steps.
const LEAST_AREA: i32 = 2 * MIN_LOG2_SIDE as i32 * OCTAVE;

/// How far a wish may drift from a block before the block changes: twice the
/// drift of a side, in steps. Fresh rounding is off by at most half an octave
/// on a square patch, so that 0.65 lets an eye move by a tenth of its
/// distance, back and forth over any border, without moving a block.
const HYSTERESIS: i32 = 333;

/// What a patch deserves in an atlas without limits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wish {
    /// log2 of its texels, steps: from 0 to 32 octaves.
    area: u16,
    /// log2 of width over height, steps: 16 octaves either way.
    aspect: i16,
}

impl Wish {
    /// Takes log2 of the texels, and of width over height. What is no number
    /// counts as 0, what is out of range as the nearest that is not.
    #[must_use]
    pub fn new(log2_area: f32, log2_aspect: f32) -> Self {
        // Casts saturate, and turn NaN into 0.
        let steps = |log2: f32| (log2 * OCTAVE as f32).round() as i32;
        Self {
            area: steps(log2_area).clamp(0, 32 * OCTAVE) as u16,
            aspect: steps(log2_aspect).clamp(-16 * OCTAVE, 16 * OCTAVE) as i16,
        }
    }

    /// As kernels have it: area, and aspect in the upper half.
    #[must_use]
    pub fn word(self) -> u32 {
        u32::from(self.area) | u32::from(self.aspect as u16) << 16
    }

    /// The wish in this word.
    #[must_use]
    pub fn of_word(word: u32) -> Self {
        Self {
            area: word as u16,
            aspect: (word >> 16) as i16,
        }
    }

    /// log2 of the texels, steps.
    #[must_use]
    pub fn area(self) -> i32 {
        i32::from(self.area)
    }

    /// log2 of width over height, steps.
    #[must_use]
    pub fn aspect(self) -> i32 {
        i32::from(self.aspect)
    }
}

/// log2 of the texels along a patch's own axes. Blocks lie landscape: a patch
/// that is higher than wide lies in its block on its side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Level {
    /// Along the patch's u.
    pub width: u8,
    /// Along the patch's v.
    pub height: u8,
}

impl Level {
    /// Width and height of the block as it lies in the atlas.
    #[must_use]
    pub fn landscape(self) -> (u8, u8) {
        (self.width.max(self.height), self.width.min(self.height))
    }

    /// Among all levels of blocks that lie landscape: below [`LEVELS`].
    #[must_use]
    pub fn index(self) -> usize {
        let (width, height) = self.landscape();
        index(width, height)
    }

    /// As kernels have it: width, and height in the upper half of the byte.
    #[must_use]
    pub fn byte(self) -> u32 {
        u32::from(self.width) | u32::from(self.height) << 4
    }

    /// The level in the lowest byte.
    #[must_use]
    pub fn of_byte(byte: u32) -> Self {
        Self {
            width: (byte & 15) as u8,
            height: (byte >> 4 & 15) as u8,
        }
    }
}

/// The index of a landscape level.
pub(super) fn index(width: u8, height: u8) -> usize {
    let (width, height) = (usize::from(width), usize::from(height));
    width * (width - 1) / 2 + height - 1
}

/// The largest bias that means anything, steps: all blocks are smallest then.
#[must_use]
pub fn most_bias(log2_side: u8) -> i32 {
    2 * i32::from(log2_side) * OCTAVE - LEAST_AREA
}

/// The level that is nearest to a wish at a bias, steps (equation 2). No side
/// exceeds `2^log2_side` texels.
#[must_use]
pub fn level(wish: Wish, bias: i32, log2_side: u8) -> Level {
    Within::new(wish, bias, log2_side).rounded(log2_side)
}

/// As [`level`], but `current` stays while it is near the wish on both sides.
#[must_use]
pub fn steady_level(current: Option<Level>, wish: Wish, bias: i32, log2_side: u8) -> Level {
    let within = Within::new(wish, bias, log2_side);
    match current {
        Some(current) if within.tolerates(current) => current,
        _ => within.rounded(log2_side),
    }
}

/// log2 of the ideal area in smallest blocks, as equation 3 counts it: steps of
/// 1/32 octave, within what blocks can be.
pub(super) fn area_bin(wish: Wish, log2_side: u8) -> usize {
    let most = 2 * i32::from(log2_side) * OCTAVE;
    ((wish.area().clamp(LEAST_AREA, most) - LEAST_AREA + 4) >> 3) as usize
}

/// A wish within what blocks can be, not yet rounded.
struct Within {
    area: i32,
    aspect: i32,
}

impl Within {
    fn new(wish: Wish, bias: i32, log2_side: u8) -> Self {
        let most = 2 * i32::from(log2_side) * OCTAVE;
        let area = (wish.area().min(most) - bias).clamp(LEAST_AREA, most);
        let widest = (area - LEAST_AREA).min(most - area);
        Self {
            area,
            aspect: wish.aspect().clamp(-widest, widest),
        }
    }

    /// The aspect takes the parity of the area, so that both sides come out whole.
    fn rounded(&self, log2_side: u8) -> Level {
        let area = (self.area + OCTAVE / 2) >> 8;
        let parity = area & 1;
        let aspect = 2 * ((self.aspect.abs() - parity * OCTAVE + OCTAVE) >> 9) + parity;
        let (least, most) = (2 * i32::from(MIN_LOG2_SIDE), 2 * i32::from(log2_side));
        let aspect = aspect.min(area - least).min(most - area).max(parity);
        let aspect = if self.aspect < 0 { -aspect } else { aspect };
        Level {
            width: ((area + aspect) / 2) as u8,
            height: ((area - aspect) / 2) as u8,
        }
    }

    fn tolerates(&self, level: Level) -> bool {
        let near = |twice_side: i32, log2: u8| {
            (twice_side - 2 * OCTAVE * i32::from(log2)).abs() <= HYSTERESIS
        };
        near(self.area + self.aspect, level.width) && near(self.area - self.aspect, level.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(width: u8, height: u8) -> Level {
        Level { width, height }
    }

    fn fresh(log2_area: f32, log2_aspect: f32, bias: f32) -> Level {
        let bias = (bias * OCTAVE as f32) as i32;
        level(Wish::new(log2_area, log2_aspect), bias, 6)
    }

    #[test]
    fn levels_are_equation_2() {
        assert_eq!(fresh(8.0, 0.0, 0.0), at(4, 4));
        assert_eq!(fresh(8.0, 0.0, 2.0), at(3, 3));
        assert_eq!(fresh(7.0, 0.0, 0.0), at(4, 3), "odd areas cannot be square");
        assert_eq!(fresh(7.0, 2.6, 0.0), at(5, 2));
        assert_eq!(fresh(8.0, -2.0, 0.0), at(3, 5), "on its side");
        assert_eq!(fresh(7.0, -0.1, 0.0), at(3, 4));
        assert_eq!(fresh(8.0, 16.0, 0.0), at(6, 2));
        assert_eq!(fresh(4.0, 16.0, 0.0), at(3, 1));
        assert_eq!(fresh(32.0, 0.0, 0.0), at(6, 6));
        assert_eq!(fresh(0.0, 5.0, 100.0), at(1, 1));
    }

    #[test]
    fn a_level_stays_until_the_wish_is_well_past_the_border() {
        let stays = |area| steady_level(Some(at(4, 4)), Wish::new(area, 0.0), 0, 6) == at(4, 4);
        assert!(stays(8.0) && stays(9.29) && stays(6.71));
        assert!(!stays(9.5) && !stays(6.5));
    }

    #[test]
    fn levels_are_numbered_without_gaps() {
        let all = (1..=MAX_LOG2_SIDE).flat_map(|w| (1..=w).map(move |h| at(w, h)));
        assert!(all.map(Level::index).eq(0..LEVELS));
        assert_eq!(at(2, 5).index(), at(5, 2).index());
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_wish_has_a_level(
            area in prop::num::f32::ANY,
            aspect in prop::num::f32::ANY,
            bias in 0..40 * OCTAVE,
            log2_side in 2..=MAX_LOG2_SIDE,
        ) {
            let wish = Wish::new(area, aspect);
            prop_assert_eq!(Wish::of_word(wish.word()), wish);
            let level = level(wish, bias, log2_side);
            let sides = MIN_LOG2_SIDE..=log2_side;
            prop_assert!(sides.contains(&level.width) && sides.contains(&level.height));
            prop_assert_eq!(Level::of_byte(level.byte()), level);
        }

        #[test]
        fn a_level_is_near_its_wish(area in 2.0_f32..12.0, aspect in -8.0_f32..8.0) {
            let found = fresh(area, aspect, 0.0);
            let found_area = f32::from(found.width + found.height);
            prop_assert!((found_area - area).abs() <= 0.51);
            let found_aspect = f32::from(found.width) - f32::from(found.height);
            let widest = (area - 2.0).min(12.0 - area);
            let possible = aspect.clamp(-widest, widest);
            prop_assert!((found_aspect - possible).abs() <= 1.51);
        }
    }
}
