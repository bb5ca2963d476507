//! Scenes to measure with: the built-in one, two that each make one part of the
//! integrator earn its keep, and whatever file is named.

use std::path::Path;

use anyhow::{Context, Result};
use glam::{Quat, Vec3, vec3};
use shadecast_protocol::Pose;
use shadecast_server::scene::{self, Light, Material, Scene};

/// Triangles of the courtyard, about: its default.
const TRIANGLES: usize = 15_000;
/// Height of the eye above the floor, metres.
const EYE_HEIGHT: f32 = 1.6;

/// The scene of this name: `courtyard`, `lamps`, `plates`, or a file.
pub(crate) fn named(name: &str) -> Result<Scene> {
    match name {
        "courtyard" => Ok(scene::courtyard(TRIANGLES)),
        "lamps" => Ok(lamps()),
        "plates" => Ok(plates()),
        path => scene::load(Path::new(path)).with_context(|| format!("cannot load {path}")),
    }
}

fn matte(name: &str, color: Vec3) -> Material {
    Material {
        name: name.to_owned(),
        base_color: color.extend(1.0),
        metallic: 0.0,
        ..Material::default()
    }
}

fn standing_at(position: Vec3, turned: Quat) -> Option<Pose> {
    Some(Pose {
        position,
        orientation: turned,
    })
}

/// A long hall with hundreds of unequal lamps, of which few light any one place.
fn lamps() -> Scene {
    const ROWS: u32 = 24;
    const COLUMNS: u32 = 16;
    let mut scene = Scene {
        name: "lamps".to_owned(),
        spawn: standing_at(vec3(0.0, 0.0, 10.0), Quat::IDENTITY),
        ..Scene::default()
    };
    let plaster = scene.add_material(matte("plaster", vec3(0.7, 0.66, 0.6)));
    let stone = scene.add_material(matte("stone", vec3(0.35, 0.35, 0.4)));
    scene.add_box(vec3(0.0, 2.0, 0.0), vec3(-8.0, -2.0, -12.0), plaster);
    for pillar in 0..8 {
        let side = if pillar % 2 == 0 { -5.0 } else { 5.0 };
        let place = vec3(side * 0.6, 2.0, 3.0 - 4.0 * (pillar / 2) as f32);
        scene.add_box(place, vec3(0.5, 2.0, 0.5), stone);
    }
    for lamp in 0..ROWS * COLUMNS {
        let (row, column) = ((lamp / COLUMNS) as f32, (lamp % COLUMNS) as f32);
        // Every ninth shines twenty times as bright.
        let power = if lamp % 9 == 0 { 2.0 } else { 0.1 };
        let warmth = (lamp % 5) as f32 * 0.2;
        scene.lights.push(Light::Point {
            position: vec3(column - 7.5, 3.6, row - 11.5),
            intensity: vec3(1.0, 0.9 - 0.3 * warmth, 0.8 - 0.7 * warmth) * power,
            range: f32::INFINITY,
        });
    }
    scene
}

/// Four plates from mirror to matte below four lamps from tiny to wide, after
/// Veach and Guibas, "Optimally Combining Sampling Techniques for Monte Carlo
/// Rendering", 1995, figure 2.
fn plates() -> Scene {
    let mut scene = Scene {
        name: "plates".to_owned(),
        spawn: standing_at(Vec3::ZERO, Quat::IDENTITY),
        ..Scene::default()
    };
    let wall = scene.add_material(matte("wall", Vec3::splat(0.4)));
    scene.add_box(vec3(0.0, 3.0, -4.0), vec3(-6.0, -3.0, -6.0), wall);
    let eye = Vec3::Y * EYE_HEIGHT;
    let lamps_height = 4.5;
    let lamps_depth = -7.0;
    for (plate, roughness) in [0.08_f32, 0.2, 0.35, 0.55].into_iter().enumerate() {
        let steel = scene.add_material(Material {
            roughness,
            ..matte("steel", Vec3::splat(0.8))
        });
        scene.materials[steel as usize].metallic = 1.0;
        // Each mirrors the row of lamps into the eye.
        let middle = vec3(0.0, 0.8 + 0.45 * plate as f32, -3.0 - 0.5 * plate as f32);
        let to_lamps = (vec3(0.0, lamps_height, lamps_depth) - middle).normalize();
        let normal = (to_lamps + (eye - middle).normalize()).normalize();
        let (across, along) = (Vec3::X * 1.4, Vec3::X.cross(normal) * 0.22);
        let corners = [
            middle - across + along,
            middle + across + along,
            middle + across - along,
            middle - across - along,
        ];
        scene.add_quad(corners, steel);
    }
    for (lamp, half) in [0.02_f32, 0.08, 0.25, 0.6].into_iter().enumerate() {
        // All send the same power.
        let glow = scene.add_material(Material {
            emissive: Vec3::splat(1.5 / (half * half)),
            double_sided: true,
            ..matte("lamp", Vec3::ZERO)
        });
        let middle = vec3(lamp as f32 * 1.5 - 2.25, lamps_height, lamps_depth);
        let (u, v) = (Vec3::X * half, vec3(0.0, half, half) / 2.0_f32.sqrt());
        let corners = [
            middle - u - v,
            middle + u - v,
            middle + u + v,
            middle - u + v,
        ];
        scene.add_quad(corners, glow);
    }
    scene
}
