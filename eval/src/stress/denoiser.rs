//! What accumulation and smoothing must not change: light that is the same everywhere.

use std::time::Duration;

use anyhow::Result;
use glam::Vec3;
use shadecast_server::{
    Integrator,
    scene::{Scene, SkyModel},
};

use super::{
    Case, Effort,
    property::{Property, greatest},
    scenes::{Picture, View, add_ball, add_wall, glowing, matte},
    watched::Watched,
};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "constant_light",
        what: "a white ball under an even sky of 1e-4, 1 and 1e4, exposed for it: shown at once and for 50 frames",
        measure: constant_light,
    },
    Case {
        name: "zero_variance",
        what: "a glowing wall and a black one, which no path makes noisy",
        measure: zero_variance,
    },
];

fn frames(watched: &mut Watched, count: u32) -> Result<Vec<Picture>> {
    (0..count).map(|_| watched.shown(Duration::ZERO)).collect()
}

fn constant_light(effort: Effort) -> Result<Vec<Property>> {
    let mut properties = Vec::new();
    for radiance in [1e-4_f32, 1.0, 1e4] {
        let mut scene = Scene {
            sky: SkyModel::constant(Vec3::splat(radiance)),
            ..Scene::default()
        };
        let white = scene.add_material(matte(1.0));
        add_ball(&mut scene, Vec3::ZERO, 1.0, white);
        // Far from the edge, where Schlick's term reflects: 0.1 % there.
        let view = View::new(Vec3::Z * 3.0, Vec3::NEG_Z, 0.35);
        let integrator = Integrator::with_bounces(1);
        let mut watched = Watched::new(&scene, view, integrator, 0.5 / radiance)?;
        let pictures = frames(&mut watched, if effort.quick { 50 } else { 200 })?;
        let of_sky = |picture: &Picture| (picture.mean() / f64::from(radiance) - 1.0).abs();
        let (first, later) = (of_sky(&pictures[0]), &pictures[1..]);
        let what = format!("under {radiance:e}: first mean, relative error");
        properties.push(Property::at_most(what, first, 0.01));
        let what = format!("under {radiance:e}: worst later mean, relative error");
        properties.push(Property::at_most(
            what,
            greatest(later.iter().map(of_sky)),
            0.01,
        ));
        let pixels = later
            .iter()
            .map(|picture| picture.farthest_from(f64::from(radiance)));
        let what = format!("under {radiance:e}: worst later pixel, relative error");
        properties.push(Property::at_most(what, greatest(pixels), 0.01));
    }
    Ok(properties)
}

fn zero_variance(_: Effort) -> Result<Vec<Property>> {
    let mut properties = Vec::new();
    for radiance in [0.0_f32, 0.25, 1e4] {
        let mut scene = Scene::default();
        let wall = scene.add_material(glowing(radiance));
        add_wall(&mut scene, Vec3::ZERO, 2.0, wall);
        let view = View::new(Vec3::Z, Vec3::NEG_Z, 0.5);
        let mut watched = Watched::new(&scene, view, Integrator::with_bounces(1), 1.0)?;
        let pictures = frames(&mut watched, 10)?;
        let pixels = pictures.iter().flat_map(|picture| &picture.0);
        let errors =
            pixels.map(|pixel| f64::from((pixel.y - radiance).abs() / radiance.max(1e-30)));
        let what = format!("glowing at {radiance}, worst pixel: relative error");
        properties.push(Property::at_most(what, greatest(errors), 1e-6));
    }
    Ok(properties)
}
