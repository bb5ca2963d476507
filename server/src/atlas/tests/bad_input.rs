//! Input that no good scene has: the promises hold all the same.

use std::f32::consts::PI;

use glam::Vec3;
use shadecast_protocol::PatchId;
use shadecast_shaders::atlas::{Seen, Wish, footprint};

use super::{
    super::AtlasTwin,
    both::Both,
    seen, shape, view,
    watched::{Noise, Watched, block_of},
};

#[test]
fn nothing_visible_is_placed_nowhere() {
    let mut atlas = Watched::new(shape([64, 64], 16));
    for _ in 0..20 {
        let placed = atlas.place(&[]);
        assert!(placed.placements.is_empty() && !placed.reset);
    }
}

/// An atlas of a single superblock, in which one width has room at a time.
#[test]
fn one_superblock_is_shared() {
    let mut atlas = Watched::new(shape([4, 4], 4));
    let placed = atlas.place(&[seen(3, 20.0, 0.0)]);
    assert_eq!(block_of(placed.placements[0].slot).level.size(), (4, 4));
    let placed = atlas.place(&view(&mut Noise(1), 4, [-3.0, 3.0]));
    assert_eq!(placed.unplaced, 0);
    let placed = atlas.place(&view(&mut Noise(1), 100, [-3.0, 3.0]));
    assert_eq!((placed.unplaced, placed.stats.patches), (96, 4));
}

#[test]
fn footprints_that_are_no_numbers_get_the_smallest_block() {
    let corners = [Vec3::NAN, Vec3::X, Vec3::Y, Vec3::Y, Vec3::Y];
    let wishes = [
        footprint(0, &corners, Vec3::ZERO, 500.0),
        footprint(1, &corners, Vec3::NAN, 500.0),
        footprint(2, &[Vec3::ZERO; 5], Vec3::ZERO, f32::NAN),
        Wish::new(f32::NAN, f32::NAN),
    ];
    let visible: Vec<_> = (0..)
        .zip(wishes)
        .map(|(patch, wish)| Seen {
            patch,
            pixels: 1,
            wish,
        })
        .collect();
    let placed = Watched::new(shape([64, 64], 16)).place(&visible);
    assert_eq!(placed.unplaced, 0);
    let smallest = placed
        .placements
        .iter()
        .filter(|p| p.slot.bounds().area() == 4);
    assert!(smallest.count() >= 2);
}

/// Pixels per radian of pictures as wide as a degree, and nearly as half the world.
#[test]
fn any_field_of_view_has_room() {
    let quad = |at: Vec3| {
        let (x, y) = (Vec3::X * 0.1, Vec3::Y * 0.1);
        [at, at + x, at + x + y, at + y, at + y]
    };
    for opening in [PI / 180.0, 170.0 * PI / 180.0, 0.0, f32::INFINITY, -1.0] {
        let mut atlas = Watched::new(shape([256, 256], 32));
        let visible: Vec<_> = (0..500)
            .map(|patch| Seen {
                patch,
                pixels: 1 + patch,
                wish: footprint(
                    1,
                    &quad(Vec3::new(patch as f32 * 0.1 - 25.0, 0.0, -0.5)),
                    Vec3::ZERO,
                    1920.0 / opening,
                ),
            })
            .collect();
        assert_eq!(atlas.place(&visible).unplaced, 0, "{opening} rad");
        assert_eq!(atlas.place(&visible).placements.len(), 0);
    }
}

fn millions() -> Vec<Seen> {
    let mut noise = Noise(11);
    (0..4_000_000)
        .map(|patch| Seen {
            patch,
            pixels: 1 + noise.below(40),
            wish: Wish::new(noise.between(0.0, 9.0), noise.between(-3.0, 3.0)),
        })
        .collect()
}

#[test]
fn four_million_patches_leave_out_the_least_important() {
    let mut atlas = AtlasTwin::new(shape([1024, 1024], 128));
    let placed = atlas.place(&millions());
    // 51 of 64 superblocks, 4096 smallest blocks in each.
    assert_eq!(placed.stats.patches, 51 * 4096);
    assert_eq!(placed.unplaced, 4_000_000 - 51 * 4096);
    let waiting = placed.visible.iter().filter(|v| v.slot.is_none());
    let waits_most = waiting.map(|visible| visible.pixels).max();
    let placed_least = placed
        .visible
        .iter()
        .filter(|visible| visible.slot.is_some())
        .map(|visible| visible.pixels)
        .min();
    // Within one class of importance, here up to four pixels, the first come first.
    assert!(waits_most <= placed_least.map(|pixels| pixels + 4));
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn four_million_patches_on_the_gpu() {
    let millions = millions();
    let mut both = Both::new(shape([1024, 1024], 128), millions.len() as u32);
    let placed = both.place_alike(&millions);
    assert_eq!(placed.stats.patches, 51 * 4096);
    let few = view(&mut Noise(2), 100, [-1.0, 1.0]);
    assert_eq!(both.place_alike(&few).unplaced, 0);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn bad_input_on_the_gpu() {
    let mut both = Both::new(shape([4, 4], 4), 100);
    for _ in 0..3 {
        assert!(both.place(&[]).placements.is_empty());
    }
    both.place(&[seen(3, 20.0, 0.0)]);
    both.place(&view(&mut Noise(1), 100, [-3.0, 3.0]));
    // Words that `Wish::word` never gives.
    let wild = [0xffff_ffff, 0x8000_0000, 0x7fff_ffff, 0x8000_ffff];
    let visible: Vec<_> = (0..)
        .zip(wild)
        .map(|(patch, word)| Seen {
            patch,
            pixels: u32::MAX,
            wish: Wish::of_word(word),
        })
        .collect();
    assert_eq!(both.place(&visible).unplaced, 0);
    let mut empty = Both::new(shape([64, 64], 16), 0);
    assert_eq!(empty.place(&[]).removals, Vec::<PatchId>::new());
}
