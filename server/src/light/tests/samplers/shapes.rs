//! Samples that are even over a shape.

use glam::{Quat, Vec2, Vec4, vec3};
use shadecast_protocol::{ObjectId, Pose};

use super::{
    Bench, assert_likely, counts,
    lamps::{add_triangle, glowing},
};
use crate::scene::{RigidObject, Scene};

const SOURCE: &str = include_str!("shapes.wgsl");
const SAMPLES: usize = 1 << 20;
/// Cells along a side of the unit square.
const SIDE: usize = 16;

/// Fails unless the points of the unit square are even for each of so many shapes.
fn assert_even(what: &str, points: &[Vec2], shapes: usize) {
    let along = |x: f32| ((x * SIDE as f32) as usize).min(SIDE - 1);
    for points in points.chunks(points.len() / shapes) {
        let off = points.iter().map(|p| (*p - 0.5).abs().max_element());
        // The rounding of directions against the sine of the narrowest cone.
        assert!(off.fold(0.0, f32::max) < 0.5 + 1e-3, "{what}: outside");
        let cells = points.iter().map(|p| along(p.y) * SIDE + along(p.x));
        let even = [1.0 / (SIDE * SIDE) as f64; SIDE * SIDE];
        assert_likely(what, &counts(SIDE * SIDE, cells), &even, shapes);
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_hemisphere_is_sampled_by_cosine() {
    let bench = Bench::new(&Scene::default());
    let points: Vec<Vec2> = bench.run(SOURCE, "in_hemisphere", &[Vec4::ZERO], SAMPLES);
    assert_even("hemisphere", &points, 1);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn cones_are_sampled_evenly() {
    let axis = vec3(0.6, -0.3, -0.7).normalize();
    // The sun's half angle on Earth is 0.00465 rad.
    let cones = [0.00465_f32, 0.02, 0.5, 1.5].map(|angle| axis.extend(angle.cos()));
    let bench = Bench::new(&Scene::default());
    let points: Vec<Vec2> = bench.run(SOURCE, "in_cone", &cones, SAMPLES);
    assert_even("cones", &points, cones.len());
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn points_of_a_lamp_are_even_by_area() {
    let mut scene = Scene {
        objects: vec![RigidObject::default()],
        ..Scene::default()
    };
    let corners = [
        vec3(0.1, 2.0, 0.3),
        vec3(1.5, 2.5, 0.0),
        vec3(0.4, 3.0, 1.0),
    ];
    add_triangle(&mut scene, corners, glowing(1.0, true), ObjectId(1));
    let pose = Pose {
        position: vec3(-0.5, 0.3, 0.2),
        orientation: Quat::from_rotation_z(0.4),
    };
    let mut bench = Bench::new(&scene);
    bench.scene.set_poses(&bench.gpu, &[pose]);
    let [a, b, c] = corners.map(|corner| pose.transform_point(corner));
    let triangle = [a, b - a, c - a].map(|v| v.extend(0.0));
    let points: Vec<Vec2> = bench.run(SOURCE, "on_lamp", &triangle, SAMPLES);
    assert_even("lamp", &points, 1);
}
