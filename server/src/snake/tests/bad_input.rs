//! Input that no good scene has: the promises hold all the same.

use std::f32::consts::PI;

use glam::Vec3;
use shadecast_protocol::PatchId;
use shadecast_shaders::snake::{NO_TURN, Seen, SnakeFootprintParameters, Wish, snake_footprint};

use super::{
    super::SnakeTwin,
    both::Both,
    seen, shape, view,
    watched::{Watched, texels_of},
};
use crate::atlas::tests::watched::Noise;

fn measured(corners: [Vec3; 3], eye: Vec3, pixels_per_radian: f32) -> Wish {
    let parameters = SnakeFootprintParameters {
        patch_count: 1,
        pixels_per_radian,
        padding: [0; 2],
    };
    snake_footprint(corners, eye, &parameters, NO_TURN)
}

#[test]
fn nothing_visible_is_placed_nowhere() {
    let mut atlas = Watched::new(shape(64, 64));
    for _ in 0..20 {
        let placed = atlas.place(&[]);
        assert!(placed.placements.is_empty() && !placed.reset);
    }
}

/// An atlas with room for a single superblock, and hardly for that.
#[test]
fn four_by_four_texels_are_shared() {
    let mut atlas = Watched::new(shape(4, 4));
    let placed = atlas.place(&[seen(3, 500.0, 900.0)]);
    assert!((1..=16).contains(&texels_of(placed.placements[0].slot).len()));
    let placed = atlas.place(&view(&mut Noise(1), 2, [0.0, 9.0]));
    assert_eq!(placed.unplaced, 0);
    let placed = atlas.place(&view(&mut Noise(1), 100, [0.0, 9.0]));
    assert_eq!((placed.unplaced, placed.stats.patches), (96, 4));
}

#[test]
fn footprints_that_are_no_numbers_get_the_smallest_slot() {
    let line = [Vec3::X, Vec3::X, Vec3::Y];
    let wishes = [
        measured([Vec3::NAN, Vec3::X, Vec3::Y], Vec3::ZERO, 500.0),
        measured([Vec3::ZERO, Vec3::X, Vec3::Y], Vec3::NAN, 500.0),
        measured([Vec3::ZERO; 3], Vec3::ZERO, f32::NAN),
        measured([Vec3::INFINITY, Vec3::X, Vec3::Y], Vec3::ZERO, 500.0),
        measured([Vec3::X; 3], Vec3::ZERO, 500.0),
    ];
    let visible: Vec<_> = (0..)
        .zip(wishes)
        .map(|(patch, wish)| Seen {
            patch,
            pixels: 1,
            wish,
        })
        .collect();
    let placed = Watched::new(shape(64, 64)).place(&visible);
    assert_eq!(placed.unplaced, 0);
    for placement in &placed.placements {
        assert_eq!(texels_of(placement.slot).len(), 1, "{placement:?}");
    }
    let flat = measured(line, Vec3::ZERO, 500.0);
    assert!(flat.height < 100 && flat.length > 3000, "{flat:?}");
}

/// About the head, behind it, and with a corner in the eye: there is a size, and it
/// is the same wherever the head looks.
#[test]
fn a_triangle_about_the_head_has_a_size() {
    let around = [
        Vec3::new(-2.0, -1.0, 0.1),
        Vec3::new(2.0, -1.0, 0.1),
        Vec3::new(0.0, 2.0, 0.1),
    ];
    let within = measured(around, Vec3::ZERO, 500.0);
    // The camera stands back until the triangle fills its view of 1000 pixels.
    let length = (f32::from(within.length) / 256.0 - 4.0).exp2();
    assert!((700.0..1100.0).contains(&length), "{length}");
    let in_plane = measured(
        around.map(|corner| corner - Vec3::Z * 0.1),
        Vec3::ZERO,
        500.0,
    );
    assert!(in_plane.length > 3000);
    let front = [
        Vec3::new(-0.2, 0.0, -2.0),
        Vec3::new(0.3, 0.0, -2.0),
        Vec3::new(0.0, 0.2, -2.0),
    ];
    let behind = front.map(|corner| -corner);
    let [front, behind] = [front, behind].map(|corners| measured(corners, Vec3::ZERO, 500.0));
    assert_eq!((front.height, front.length), (behind.height, behind.length));
    assert!(measured(around, around[0], 500.0).length > 2500);
    let mut atlas = Watched::new(shape(256, 256));
    let wishes = [within, in_plane, front, behind];
    let visible: Vec<_> = (0..)
        .zip(wishes)
        .map(|(patch, wish)| Seen {
            patch,
            pixels: 9000,
            wish,
        })
        .collect();
    assert_eq!(atlas.place(&visible).unplaced, 0);
}

/// Pixels per radian of pictures as wide as a degree, and nearly as half the world.
#[test]
fn any_field_of_view_has_room() {
    for opening in [PI / 180.0, 170.0 * PI / 180.0, 0.0, f32::INFINITY, -1.0] {
        let mut atlas = Watched::new(shape(256, 256));
        let visible: Vec<_> = (0..500)
            .map(|patch| {
                let at = Vec3::new(patch as f32 * 0.1 - 25.0, 0.0, -0.5);
                let corners = [at, at + Vec3::X * 0.1, at + Vec3::Y * 0.1];
                Seen {
                    patch,
                    pixels: 1 + patch,
                    wish: measured(corners, Vec3::ZERO, 1920.0 / opening),
                }
            })
            .collect();
        assert_eq!(atlas.place(&visible).unplaced, 0, "{opening} rad");
        assert_eq!(atlas.place(&visible).placements.len(), 0);
    }
}

fn millions() -> Vec<Seen> {
    let mut noise = Noise(11);
    (0..4_000_000)
        .map(|patch| {
            let height = noise.between(0.0, 4.0).exp2();
            Seen {
                pixels: 1 + noise.below(40),
                ..seen(patch, height, height * 1.5)
            }
        })
        .collect()
}

/// A quarter of the texels.
const MOST_OF_MILLIONS: u32 = 1 << 18;

#[test]
fn four_million_triangles_leave_out_the_least_important() {
    let mut atlas = SnakeTwin::new(shape(1024, 1024));
    let placed = atlas.place(&millions());
    assert_eq!(placed.stats.patches, MOST_OF_MILLIONS);
    assert_eq!(placed.unplaced, 4_000_000 - MOST_OF_MILLIONS);
    let of = |is_placed: bool| {
        let those = placed
            .visible
            .iter()
            .filter(move |found| found.slot.is_some() == is_placed);
        those.map(|found| found.pixels)
    };
    // Within one class of importance, here up to four pixels, the first come first.
    assert!(of(false).max() <= of(true).min().map(|pixels| pixels + 4));
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn four_million_triangles_on_the_gpu() {
    let millions = millions();
    let mut both = Both::new(shape(1024, 1024), millions.len() as u32);
    let placed = both.place_alike(&millions);
    assert_eq!(placed.stats.patches, MOST_OF_MILLIONS);
    let few = view(&mut Noise(2), 100, [0.0, 4.0]);
    assert_eq!(both.place_alike(&few).unplaced, 0);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn bad_input_on_the_gpu() {
    let mut both = Both::new(shape(4, 4), 100);
    for _ in 0..3 {
        assert!(both.place(&[]).placements.is_empty());
    }
    both.place(&[seen(3, 500.0, 900.0)]);
    both.place(&view(&mut Noise(1), 100, [0.0, 9.0]));
    let mut empty = Both::new(shape(64, 64), 0);
    assert_eq!(empty.place(&[]).removals, Vec::<PatchId>::new());
}
