//! Directions drawn from a picture of all directions.

use std::f64::consts::{PI, TAU};

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3, Vec4};

use super::{Bench, assert_likely, counts};
use crate::scene::{EnvironmentMap, Scene};

const SOURCE: &str = include_str!("sky.wgsl");
const SAMPLES: usize = 1 << 17;
/// Of the picture: no multiples of anything.
const WIDTH: usize = 37;
const HEIGHT: usize = 19;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Drawn {
    direction: Vec3,
    density: f32,
    told: f32,
    padding: [u32; 3],
}

/// A dim sky with a bright spot, a bright pole and a black patch.
fn sky() -> EnvironmentMap {
    let mut pixels = Vec::new();
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            pixels.push(match (x, y) {
                (20, 7) => Vec3::splat(200.0),
                (_, 0) => Vec3::splat(3.0),
                (3..9, 10..16) => Vec3::ZERO,
                _ => Vec3::splat(0.2 + 0.02 * x as f32),
            });
        }
    }
    EnvironmentMap::new(WIDTH as u32, HEIGHT as u32, pixels).expect("a picture")
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn directions_of_the_sky_are_drawn_as_often_as_their_densities_say() {
    let bench = Bench::new(&Scene {
        environment: Some(sky().into()),
        ..Scene::default()
    });
    let drawn: Vec<Drawn> = bench.run(SOURCE, "draw", &[Vec4::ZERO], SAMPLES);
    for drawn in &drawn {
        assert!((drawn.direction.length() - 1.0).abs() < 1e-5, "{drawn:?}");
    }
    // At a cell's border rounding may tell of the neighbour.
    let off = |drawn: &&Drawn| (drawn.told / drawn.density - 1.0).abs() > 1e-4;
    assert!(drawn.iter().filter(off).count() < SAMPLES / 1000);

    // The density is the same all over a pixel.
    let middles = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| direction_of(x, y)));
    let middles: Vec<Vec4> = middles.collect();
    let told: Vec<f32> = bench.run(SOURCE, "tell", &middles, 1);
    let probabilities: Vec<f64> = (told.iter().enumerate())
        .map(|(pixel, density)| {
            let [above, below] = [0, 1].map(|i| (pixel / WIDTH + i) as f64 * PI / HEIGHT as f64);
            f64::from(*density) * (above.cos() - below.cos()) * TAU / WIDTH as f64
        })
        .collect();
    let sum: f64 = probabilities.iter().sum();
    assert!((sum - 1.0).abs() < 1e-5, "{sum}");

    let pixel_of = |drawn: &Drawn| {
        let [x, y, z] = drawn.direction.to_array().map(f64::from);
        let row = x.hypot(z).atan2(y) / PI * HEIGHT as f64;
        let column = (z.atan2(x) / TAU + 0.5) * WIDTH as f64;
        (row as usize).min(HEIGHT - 1) * WIDTH + (column as usize).min(WIDTH - 1)
    };
    let found = counts(WIDTH * HEIGHT, drawn.iter().map(pixel_of));
    assert_likely("sky", &found, &probabilities, 1);
}

/// The middle of a pixel.
fn direction_of(x: usize, y: usize) -> Vec4 {
    let polar = (y as f64 + 0.5) / HEIGHT as f64 * PI;
    let turn = ((x as f64 + 0.5) / WIDTH as f64 - 0.5) * TAU;
    let direction = DVec3::new(
        turn.cos() * polar.sin(),
        polar.cos(),
        turn.sin() * polar.sin(),
    );
    direction.as_vec3().extend(0.0)
}
