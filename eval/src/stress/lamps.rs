//! Lamps: tiny and glaring, thousands, and shut away.

use std::f64::consts::PI;

use anyhow::Result;
use glam::{Vec3, vec3};
use shadecast_server::scene::{Material, Scene, SkyModel};

use super::{
    Case, Effort,
    property::Property,
    scenes::{View, add_ball, add_floor, add_wall, glowing, matte, picture, point_lamp},
};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "glaring_square",
        what: "a square lamp of 0.1 mm and radiance 1e7 far above a floor under a dim sky",
        measure: glaring_square,
    },
    Case {
        name: "glaring_ball",
        what: "a ball of radius 0.1 mm and radiance 1e7 beside a sky of 1e-2: contrast 1e9",
        measure: glaring_ball,
    },
    Case {
        name: "thousands_of_lamps",
        what: "2000 unequal lamps in a spiral, a few of them below the plane",
        measure: thousands_of_lamps,
    },
    Case {
        name: "lamp_in_a_box",
        what: "a lamp of 1e6 W/sr in a closed box in a room",
        measure: lamp_in_a_box,
    },
];

/// Of the floor.
const ALBEDO: f32 = 0.5;
const GLARE: f32 = 1e7;
const SKY: f32 = 0.01;

fn floor_under_dim_sky() -> Scene {
    let mut scene = Scene {
        sky: SkyModel::constant(Vec3::splat(SKY)),
        ..Scene::default()
    };
    let grey = scene.add_material(matte(ALBEDO));
    add_floor(&mut scene, Vec3::ZERO, 50.0, grey);
    scene
}

/// The floor that `view` sees receives this besides the sky's light.
fn irradiance(scene: &Scene, view: View, expected: f64, effort: Effort) -> Result<Vec<Property>> {
    let expected = f64::from(ALBEDO) * (expected / PI + f64::from(SKY));
    let mut properties = Vec::new();
    for (bounces, light) in [(0, "direct light"), (1, "with a bounce")] {
        let found = picture(scene, view, bounces, effort.samples(256), effort.seed)?;
        let what = format!("mean radiance, {light}");
        properties.push(Property::near(what, found.mean(), expected, 0.01));
        let what = format!("pixels that are no radiance, {light}");
        properties.push(Property::at_most(what, found.unsound(), 0.0));
    }
    Ok(properties)
}

fn glaring_square(effort: Effort) -> Result<Vec<Property>> {
    let mut scene = floor_under_dim_sky();
    let glare = scene.add_material(glowing(GLARE));
    let (half, height) = (0.5e-4_f32, 40.0);
    // It faces down.
    let lamp = [(-half, -half), (half, -half), (half, half), (-half, half)];
    scene.add_quad(lamp.map(|(x, z)| vec3(x, height, z)), glare);
    let view = View::new(Vec3::Y, vec3(0.0, -1.0, 1e-3), 0.8);
    let area = (2.0 * f64::from(half)).powi(2);
    let expected = f64::from(GLARE) * area / f64::from(height).powi(2);
    irradiance(&scene, view, expected, effort)
}

fn glaring_ball(effort: Effort) -> Result<Vec<Property>> {
    let mut scene = floor_under_dim_sky();
    let glare = scene.add_material(glowing(GLARE));
    let (radius, lamp) = (1e-4_f32, vec3(0.6, 1.0, 0.3));
    add_ball(&mut scene, lamp, radius, glare);
    let view = View::new(vec3(0.0, 1.0, 0.0), vec3(0.0, -1.0, 1e-3), 0.01);
    let cosine_by_square = f64::from(lamp.y) / f64::from(lamp.length()).powi(3);
    let expected = PI * f64::from(GLARE) * f64::from(radius).powi(2) * cosine_by_square;
    irradiance(&scene, view, expected, effort)
}

fn thousands_of_lamps(effort: Effort) -> Result<Vec<Property>> {
    let mut scene = Scene::default();
    let grey = scene.add_material(matte(ALBEDO));
    add_wall(&mut scene, Vec3::ZERO, 1.0, grey);
    let mut irradiance = 0.0;
    for lamp in 0..2000_u32 {
        // A golden spiral.
        let turn = 2.399_963 * lamp as f32;
        let distance = 0.25 * (lamp as f32).sqrt();
        let height = (lamp % 17) as f32 * 0.5 - 0.5 + 0.11;
        let position = vec3(distance * turn.cos(), distance * turn.sin(), height);
        let intensity = 0.001 * (1 + lamp % 5) as f32 * (height * height);
        let cosine_by_square =
            f64::from(position.z.max(0.0)) / f64::from(position.length()).powi(3);
        irradiance += f64::from(intensity) * cosine_by_square;
        scene.lights.push(point_lamp(position, intensity));
    }
    let to_eye = vec3(0.0, -0.3_f32.sin(), 0.3_f32.cos());
    let view = View::new(to_eye * 3.0, -to_eye, 0.1);
    let found = picture(&scene, view, 1, effort.samples(256), effort.seed)?;
    let expected = f64::from(ALBEDO) * irradiance / PI;
    Ok(vec![
        Property::near("mean radiance", found.mean(), expected, 0.02),
        Property::at_most("pixels that are no radiance", found.unsound(), 0.0),
    ])
}

fn lamp_in_a_box(effort: Effort) -> Result<Vec<Property>> {
    let mut scene = Scene::default();
    let grey = scene.add_material(matte(0.8));
    scene.add_box(Vec3::ZERO, Vec3::splat(-5.0), grey);
    let shell = scene.add_material(Material {
        double_sided: true,
        ..matte(0.8)
    });
    let lamp = vec3(0.0, 0.0, -3.0);
    scene.add_box(lamp, Vec3::splat(-0.5), shell);
    scene.lights = vec![point_lamp(lamp, 1e6)];
    let view = View::new(Vec3::ZERO, Vec3::NEG_Z, 0.8);
    let found = picture(&scene, view, 3, effort.samples(64), effort.seed)?;
    Ok(vec![
        // Without the box it would be 1e4.
        Property::at_most("mean radiance outside", found.mean(), 1e-4),
        Property::at_most("pixels that are no radiance", found.unsound(), 0.0),
    ])
}
