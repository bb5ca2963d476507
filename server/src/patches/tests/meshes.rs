//! Scenes of one mesh to cut.

use std::collections::HashMap;

use glam::{Vec2, Vec3, Vec4};
use shadecast_protocol::ObjectId;

use crate::scene::{Corner, Material, Scene, Triangle};

/// Triangles of one material with texture coordinates from x and y.
pub(super) fn scene(positions: Vec<Vec3>, triangles: impl IntoIterator<Item = [u32; 3]>) -> Scene {
    let corner = |position: &Vec3| Corner {
        normal: Vec3::Z,
        tangent: Vec4::ZERO,
        uv: [position.truncate(), Vec2::ZERO],
        color: Vec4::ONE,
    };
    Scene {
        corners: positions.iter().map(corner).collect(),
        triangles: triangles
            .into_iter()
            .map(|positions| Triangle {
                positions,
                corners: positions,
                material: 0,
                object: ObjectId::WORLD,
            })
            .collect(),
        positions,
        materials: vec![Material::default()],
        ..Scene::default()
    }
}

/// A wavy sheet of `n` by `n` quads, one metre each.
pub(super) fn grid(n: u32) -> Scene {
    let at = |i: u32| {
        let (x, y) = ((i % (n + 1)) as f32, (i / (n + 1)) as f32);
        Vec3::new(x, y, (x * 0.3).sin() * (y * 0.2).cos() * 0.5)
    };
    let quads = (0..n * n).flat_map(move |q| {
        let a = q % n + q / n * (n + 1);
        let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
        [[a, b, c], [a, c, d]]
    });
    scene((0..(n + 1) * (n + 1)).map(at).collect(), quads)
}

/// A sphere of nearly equilateral triangles.
pub(super) fn icosphere(subdivisions: u32) -> Scene {
    let g = (1.0 + 5.0_f32.sqrt()) / 2.0;
    let mut positions: Vec<Vec3> = [
        (0.0, 1.0, g),
        (0.0, -1.0, g),
        (0.0, 1.0, -g),
        (0.0, -1.0, -g),
    ]
    .iter()
    .flat_map(|&(x, y, z)| [Vec3::new(x, y, z), Vec3::new(y, z, x), Vec3::new(z, x, y)])
    .map(Vec3::normalize)
    .collect();
    let edge = 2.0 / (1.0 + g * g).sqrt();
    let near = |a: Vec3, b: Vec3| (a.distance(b) - edge).abs() < 1e-3;
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [a, b, c].map(|i| positions[i]);
                if near(p, q) && near(q, r) && near(r, p) {
                    let outwards = (q - p).cross(r - p).dot(p) > 0.0;
                    let [a, b, c] = [a, b, c].map(|i| i as u32);
                    triangles.push(if outwards { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..subdivisions {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions.push((positions[a as usize] + positions[b as usize]).normalize());
                positions.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (x, y, z) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, x, z], [x, b, y], [z, y, c], [x, y, z]]
            })
            .collect();
    }
    scene(positions, triangles)
}
