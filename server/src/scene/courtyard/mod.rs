//! The built-in scene: an Andalusian courtyard at noon, grown by code.
//!
//! Everything follows from one number, the density of tessellation; nothing
//! is random but a hash of fixed seeds, so the same request gives the same
//! scene, bit for bit.

mod building;
mod furnish;
mod materials;
mod mesh;
mod paint;
mod roof;
#[cfg(test)]
mod tests;
mod wall;

use std::f32::consts::TAU;
use std::time::Duration;

use glam::{Quat, Vec3, vec3};
use shadecast_protocol::{ObjectId, Pose};

use super::tangents::complete_tangents;
use super::{Light, RigidObject, Scene, SkyModel};
use materials::Palette;
use mesh::Mesh;

/// Triangles at density 1.
const DEFAULT_TRIANGLES: f32 = 15_000.0;
/// A count this close to the request is good enough.
const TOLERANCE: f32 = 0.04;
/// Rounds of correcting the density; each meshes the scene once.
const ROUNDS: usize = 6;

/// Along the sunlight: over the right shoulder of whoever stands at the
/// spawn, steep enough for the sun to reach the court's floor.
const SUNLIGHT: Vec3 = Vec3::new(-0.40, -0.84, -0.37);
/// The armillary sphere turns once in this time.
const TURN: Duration = Duration::from_secs(12);
/// Keys of the turn, 15 degrees apart.
const TURN_KEYS: u32 = 24;

/// Builds the courtyard with about `triangles` triangles, from 10 000 up to
/// millions; fewer than its plainest form needs are not possible.
#[must_use]
pub fn courtyard(triangles: usize) -> Scene {
    let mut scene = Scene::default();
    let palette = materials::palette(&mut scene);
    let grown = grow(&palette, triangles as f32);
    let spin = |key: u32| {
        let turned = key as f32 / TURN_KEYS as f32;
        let pose = Pose {
            position: vec3(0.0, 1.95, 0.0),
            orientation: Quat::from_rotation_y(turned * TAU),
        };
        (TURN * key / TURN_KEYS, pose)
    };
    let mut scene = Scene {
        name: "courtyard".to_owned(),
        positions: grown.positions,
        corners: grown.corners,
        triangles: grown.triangles,
        lights: lights(),
        sky: SkyModel {
            zenith: vec3(0.25, 0.45, 0.90),
            horizon: vec3(0.80, 0.85, 0.90),
            ground: vec3(0.25, 0.22, 0.18),
        },
        objects: vec![RigidObject {
            name: "armillary sphere".to_owned(),
            keys: (0..=TURN_KEYS).map(spin).collect(),
        }],
        spawn: Some(Pose {
            position: vec3(0.5, 0.0, 3.1),
            orientation: Quat::IDENTITY,
        }),
        ..scene
    };
    complete_tangents(&mut scene);
    scene
}

fn lights() -> Vec<Light> {
    let sun = Light::Directional {
        direction: SUNLIGHT.normalize(),
        irradiance: vec3(3.6, 3.3, 2.8),
        angular_radius: 0.0047 * 2.0,
    };
    let lamps = furnish::POINT_LIGHTS.map(|position| Light::Point {
        position,
        intensity: vec3(2.4, 1.5, 0.7),
        range: f32::INFINITY,
    });
    std::iter::once(sun).chain(lamps).collect()
}

/// The geometry whose number of triangles is closest to `wanted`.
fn grow(palette: &Palette, wanted: f32) -> Scene {
    let off = |scene: &Scene| (scene.triangles.len() as f32 / wanted - 1.0).abs();
    let mut density = (wanted / DEFAULT_TRIANGLES).sqrt();
    let mut best = geometry(palette, density);
    let mut last = best.triangles.len() as f32;
    for _ in 1..ROUNDS {
        if off(&best) < TOLERANCE {
            break;
        }
        density *= (wanted / last).sqrt();
        let next = geometry(palette, density);
        last = next.triangles.len() as f32;
        if off(&next) < off(&best) {
            best = next;
        }
    }
    best
}

fn geometry(palette: &Palette, density: f32) -> Scene {
    let mut mesh = Mesh::new(density);
    building::building(&mut mesh, palette);
    furnish::furnish(&mut mesh, palette);
    mesh.moving(ObjectId(1), |mesh| furnish::armillary(mesh, palette));
    mesh.scene
}
