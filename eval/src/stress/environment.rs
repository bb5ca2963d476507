//! Pictures of all directions: one glaring pixel, one pixel at all, no number.

use std::f64::consts::{PI, TAU};

use anyhow::Result;
use glam::{DVec3, Vec3, vec3};
use shadecast_server::scene::{EnvironmentMap, Scene};

use super::{
    Case, Effort,
    property::Property,
    scenes::{View, add_floor, matte, picture},
};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "glaring_pixel",
        what: "one pixel of 1e6 among 1e-3: contrast 1e9, against the integral over all",
        measure: glaring_pixel,
    },
    Case {
        name: "one_pixel",
        what: "a picture of 1 x 1: an even sky",
        measure: one_pixel,
    },
    Case {
        name: "pixels_that_are_no_number",
        what: "pictures with a pixel that is infinite or no number",
        measure: no_number,
    },
];

const ALBEDO: f32 = 0.5;

/// The floor's radiance under the picture, without and with a bounce.
fn lit_by(map: EnvironmentMap, expected: f64, effort: Effort) -> Result<Vec<Property>> {
    let mut scene = Scene {
        environment: Some(map.into()),
        ..Scene::default()
    };
    let grey = scene.add_material(matte(ALBEDO));
    add_floor(&mut scene, Vec3::ZERO, 1.0, grey);
    let view = View::new(Vec3::Y, vec3(0.0, -1.0, 1e-3), 0.1);
    let mut properties = Vec::new();
    for (bounces, light) in [(0, "direct light"), (1, "with a bounce")] {
        let found = picture(&scene, view, bounces, effort.samples(256), effort.seed)?;
        let what = format!("mean radiance, {light}");
        properties.push(Property::near(what, found.mean(), expected, 0.01));
        let what = format!("pixels that are no radiance, {light}");
        properties.push(Property::at_most(what, found.unsound(), 0.0));
    }
    Ok(properties)
}

fn glaring_pixel(effort: Effort) -> Result<Vec<Property>> {
    const SIZE: [u32; 2] = [64, 32];
    const GLARE: [u32; 2] = [20, 9];
    let [width, height] = SIZE;
    let pixel = |x: u32, y: u32| if [x, y] == GLARE { 1e6 } else { 1e-3 };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| Vec3::splat(pixel(x, y))));
    let map = EnvironmentMap::new(width, height, pixels.collect())?;
    // Read bilinearly, the pixel is a tent of two pixels by two; all else is even.
    let steps = 256;
    let mut tent = 0.0;
    for i in 0..steps {
        for j in 0..steps {
            let [u, v] = [i, j].map(|step| (f64::from(step) + 0.5) * 2.0 / f64::from(steps) - 1.0);
            let polar = PI * (f64::from(GLARE[1]) + 0.5 + v) / f64::from(height);
            let direction = DVec3::new(polar.sin(), polar.cos(), 0.0);
            let weight = (1.0 - u.abs()) * (1.0 - v.abs());
            // A direction's share of the sphere, and its cosine above the floor.
            tent += weight * direction.x * direction.y.max(0.0);
        }
    }
    tent *= (2.0 / f64::from(steps)).powi(2) * TAU / f64::from(width) * PI / f64::from(height);
    let irradiance = 1e-3 * PI + (1e6 - 1e-3) * tent;
    lit_by(map, f64::from(ALBEDO) * irradiance / PI, effort)
}

fn one_pixel(effort: Effort) -> Result<Vec<Property>> {
    let map = EnvironmentMap::new(1, 1, vec![Vec3::splat(3.0)])?;
    lit_by(map, f64::from(ALBEDO) * 3.0, effort)
}

fn no_number(_: Effort) -> Result<Vec<Property>> {
    let named = |wrong: f32| {
        let mut pixels = vec![Vec3::ONE; 8];
        pixels[6].y = wrong;
        let error = EnvironmentMap::new(4, 2, pixels).err();
        let named = error.is_some_and(|error| error.to_string().contains("column 2 of row 1"));
        f64::from(u8::from(named))
    };
    let property = |what: &str, wrong: f32| {
        let what = format!("{what} is refused by its column and row (1 is yes)");
        Property::at_least(what, named(wrong), 1.0)
    };
    Ok(vec![
        property("a pixel that is no number", f32::NAN),
        property("an infinite pixel", f32::INFINITY),
    ])
}
