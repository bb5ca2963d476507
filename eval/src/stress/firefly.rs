//! Rare paths that bring far more than the mean.

use std::time::Duration;

use anyhow::Result;
use glam::{Vec3, vec3};
use shadecast_server::{Integrator, scene::Scene};

use super::{
    Case, Effort,
    property::{Property, greatest},
    scenes::{View, add_ball, glowing, matte, metal, picture},
    watched::Watched,
};

pub(super) const CASES: &[Case] = &[Case {
    name: "lamp_in_a_mirror",
    what: "a tiny lamp beside mirrors, that few paths from a wall find",
    measure: lamp_in_a_mirror,
}];

/// A room with mirrors for a ceiling and a wall, and a lamp below the ceiling.
fn room() -> Scene {
    let mut scene = Scene::default();
    let grey = scene.add_material(matte(0.5));
    scene.add_box(Vec3::ZERO, Vec3::splat(-2.0), grey);
    let mirror = scene.add_material(metal(0.0));
    scene.add_box(vec3(0.0, 2.0, 0.0), vec3(1.5, 0.1, 1.5), mirror);
    scene.add_box(vec3(-2.0, 0.0, 0.0), vec3(0.1, 1.5, 1.5), mirror);
    let lamp = scene.add_material(glowing(400.0));
    add_ball(&mut scene, vec3(0.0, 1.2, 0.0), 0.05, lamp);
    scene
}

fn lamp_in_a_mirror(effort: Effort) -> Result<Vec<Property>> {
    let scene = room();
    let view = View::new(vec3(0.0, -0.5, 1.5), vec3(0.0, -0.3, -1.0), 0.6);
    let truth = picture(&scene, view, 1, effort.samples(16_384), effort.seed)?;
    let shown = |smoothing: bool| -> Result<Vec<f64>> {
        let integrator = Integrator {
            smoothing,
            ..Integrator::with_bounces(1)
        };
        let mut watched = Watched::new(&scene, view, integrator, 1.0)?;
        (0..effort.samples(256))
            .map(|_| Ok(watched.shown(Duration::ZERO)?.mean() / truth.mean()))
            .collect()
    };
    let (smooth, rough) = (shown(true)?, shown(false)?);
    let ratios = smooth
        .iter()
        .zip(&rough)
        .map(|(smooth, rough)| smooth / rough);
    Ok(vec![
        Property::at_most(
            "greatest mean shown over the truth",
            greatest(smooth.iter().copied()),
            2.0,
        ),
        Property::at_most(
            "the same without smoothing",
            greatest(rough.iter().copied()),
            4.0,
        ),
        Property::at_most(
            "smoothed over not smoothed, greatest mean",
            greatest(ratios),
            1.25,
        ),
        // About a hundred rare paths make a third of it.
        Property::within(
            "last mean over the truth",
            smooth[smooth.len() - 1],
            0.75,
            1.25,
        ),
    ])
}
