//! How much smaller than ideal blocks must be so that all of them fit. Twin of
//! `bias.wgsl`.
//!
//! The bias is subtracted from log2 of every block's area. It rises as far as
//! it must, so that a crowded view gets coarser and nothing of it is lost;
//! only where the smallest blocks are too many are the least important
//! patches left out.
//!
//! Source: Mueller et al., "Shading Atlas Streaming", 2018, section 4.3,
//! equation 3, `b = log2((I - d) / (S - d))`. We differ in solving it also for
//! blocks that only become smallest because of the bias (`d` depends on `b`),
//! and in doing so in whole numbers: areas are sorted into bins of 1/32 octave,
//! whose sums from the top give both sides for every `b` on that grid.

use super::level::{Wish, area_bin, most_bias};

/// Steps of the bias to a bin.
const BIN: i32 = 8;

/// 256 times the powers of two between 1 and 2, a 32nd of an octave apart.
const MANTISSAS: [u32; 32] = [
    256, 262, 267, 273, 279, 285, 292, 298, 304, 311, 318, 325, 332, 339, 347, 354, 362, 370, 378,
    386, 395, 403, 412, 421, 431, 440, 450, 459, 470, 480, 490, 501,
];

/// The least bias, steps, at which the blocks that these patches wish for take
/// no more than `space` smallest blocks, as far as areas tell.
#[must_use]
pub fn equation_3(wishes: impl Iterator<Item = Wish>, log2_side: u8, space: u32) -> i32 {
    let bins = (most_bias(log2_side) / BIN) as usize + 1;
    let mut patches = vec![0_u32; bins];
    let mut all = 0;
    for wish in wishes {
        patches[area_bin(wish, log2_side)] += 1;
        all += 1;
    }
    // Of the patches that a bias leaves larger than smallest.
    let (mut larger, mut area) = (0_u32, 0_u64);
    let mut least = bins - 1;
    for bin in (0..bins).rev() {
        let (mantissa, octave) = (u64::from(MANTISSAS[bin & 31]), bin >> 5);
        let smallest = all - larger;
        let fits = smallest <= space && area >> octave <= u64::from(space - smallest) * mantissa;
        if !fits {
            break;
        }
        least = bin;
        larger += patches[bin];
        area += (u64::from(patches[bin]) * mantissa) << octave;
    }
    least as i32 * BIN
}

/// How important so many pixels are, roughly: their logarithm in steps of an
/// eighth of an octave or less, below 256. Patches are left out by class, so
/// that they need not be sorted.
#[must_use]
pub fn importance(pixels: u32) -> u32 {
    if pixels == 0 {
        return 0;
    }
    let octave = pixels.ilog2();
    let mantissa = if octave < 3 {
        pixels << (3 - octave)
    } else {
        pixels >> (octave - 3)
    };
    octave << 3 | mantissa & 7
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::atlas::OCTAVE;
    use proptest::prelude::*;

    fn bias(areas: &[f32], space: u32) -> f32 {
        let wishes = areas.iter().map(|area| Wish::new(area.log2(), 0.0));
        equation_3(wishes, 6, space) as f32 / OCTAVE as f32
    }

    #[test]
    fn mantissas_are_powers() {
        for (n, mantissa) in (0..).zip(MANTISSAS) {
            let exact = 256.0 * (n as f64 / 32.0).exp2();
            assert!((f64::from(mantissa) - exact).abs() <= 0.5);
        }
    }

    #[test]
    fn ideal_sizes_that_fit_are_accepted() {
        assert_eq!(bias(&[], 25), 0.0);
        assert_eq!(bias(&[64.0, 32.0], 25), 0.0);
    }

    #[test]
    fn is_log2_of_the_excess_where_nothing_is_smallest() {
        assert_eq!(bias(&[1024.0; 64], 2048), 3.0);
    }

    #[test]
    fn smallest_blocks_are_taken_out_of_both_sides() {
        // In smallest blocks: I = 200 + 128, d = 100, S = 132; b = log2(128 / 32).
        let areas: Vec<f32> = std::iter::repeat_n(4.0, 100).chain([256.0; 2]).collect();
        assert_eq!(bias(&areas, 132), 2.0);
    }

    #[test]
    fn space_of_the_smallest_blocks_alone_makes_all_smallest() {
        let areas: Vec<f32> = std::iter::repeat_n(4.0, 100).chain([512.0; 2]).collect();
        assert_eq!(bias(&areas, 102), 7.0);
        assert_eq!(bias(&areas, 0), 10.0);
    }

    #[test]
    fn importance_ascends() {
        let classes: Vec<u32> = (0..10_000).map(importance).collect();
        assert!(classes.is_sorted() && classes[1..9].is_sorted_by(|a, b| a < b));
        assert_eq!(importance(u32::MAX), 255);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn is_the_least_that_fits(
            areas in prop::collection::vec(1.0_f32..8192.0, 1..300),
            share in 0.05_f64..1.5,
        ) {
            let total = |b: f32| -> f64 {
                let one = |area: &f32| f64::from((area.min(4096.0) * (-b).exp2()).max(4.0));
                areas.iter().map(one).sum()
            };
            let space = ((total(0.0) * share / 4.0) as u32).max(areas.len() as u32);
            let b = bias(&areas, space);
            // Bins round areas by up to half of 1/32 octave.
            prop_assert!(total(b) <= f64::from(space) * 4.0 * 1.015);
            prop_assert!(b == 0.0 || total(b - 1.0 / 32.0) >= f64::from(space) * 4.0 * 0.985);
        }
    }
}
