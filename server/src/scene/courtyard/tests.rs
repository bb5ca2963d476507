use std::hash::{DefaultHasher, Hash, Hasher};

use crate::scene::{Scene, courtyard};
use glam::Vec3;

fn fingerprint(scene: &Scene) -> u64 {
    let mut hasher = DefaultHasher::new();
    for position in &scene.positions {
        position.to_array().map(f32::to_bits).hash(&mut hasher);
    }
    for triangle in &scene.triangles {
        (triangle.positions, triangle.corners, triangle.material).hash(&mut hasher);
    }
    for image in &scene.images {
        image.rgba.hash(&mut hasher);
    }
    hasher.finish()
}

#[test]
fn same_request_same_scene() {
    assert_eq!(
        fingerprint(&courtyard(15_000)),
        fingerprint(&courtyard(15_000))
    );
}

#[test]
fn triangle_count_follows_the_request() {
    for wanted in [10_000, 15_000, 100_000, 1_000_000] {
        let count = courtyard(wanted).triangles.len();
        let ratio = count as f64 / wanted as f64;
        assert!(
            (0.75..=1.25).contains(&ratio),
            "{count} triangles for {wanted}"
        );
    }
}

#[test]
fn every_face_looks_where_its_normals_look() {
    let scene = courtyard(15_000);
    for triangle in &scene.triangles {
        let [a, b, c] = triangle.positions.map(|i| scene.positions[i as usize]);
        let face = (b - a).cross(c - a);
        assert!(face.length_squared() > 0.0);
        let normals: Vec3 = triangle
            .corners
            .map(|i| scene.corners[i as usize].normal)
            .iter()
            .sum();
        assert!(face.dot(normals) > 0.0, "a face turns its back at {a}");
    }
}

#[test]
fn everything_is_finite_and_normals_are_unit() {
    let scene = courtyard(10_000);
    assert!(scene.positions.iter().all(|position| position.is_finite()));
    for corner in &scene.corners {
        assert!(corner.normal.is_normalized());
        assert!(corner.uv[0].is_finite() && corner.tangent.is_finite());
    }
}

#[test]
fn no_position_exists_twice() {
    let scene = courtyard(10_000);
    let moving = |i: u32| {
        scene
            .triangles
            .iter()
            .any(|t| t.object.0 == 1 && t.positions.contains(&i))
    };
    let mut seen = std::collections::HashMap::new();
    for (index, position) in scene.positions.iter().enumerate() {
        let key = position.to_array().map(f32::to_bits);
        if let Some(first) = seen.insert(key, index as u32) {
            assert_ne!(moving(first), moving(index as u32));
        }
    }
}
