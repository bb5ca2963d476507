//! Light that alternates, time that jumps, heads that leave and come back.

use std::time::Duration;

use anyhow::Result;
use glam::{Quat, Vec3, vec3};
use shadecast_protocol::{ObjectId, Pose};
use shadecast_server::{
    Integrator,
    scene::{RigidObject, Scene, SkyModel},
};

use super::{
    Case, Effort,
    property::{Property, greatest},
    scenes::{Picture, Tracer, View, add_wall, glowing, matte, picture, point_lamp},
    watched::Watched,
};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "alternating_light",
        what: "a glowing box that is near a wall in one frame and far from it in the next",
        measure: alternating_light,
    },
    Case {
        name: "leaping_shadow",
        what: "a block on a wall, whose shadow leaps as a glowing box does",
        measure: leaping_shadow,
    },
    Case {
        name: "uneven_time",
        what: "updates 5 ms and 5 s apart by turns, and time that starts over",
        measure: uneven_time,
    },
    Case {
        name: "distant_time",
        what: "a scene that has run for 1e9 s",
        measure: distant_time,
    },
    Case {
        name: "leaping_head",
        what: "a head that leaps 1e5 m away and back",
        measure: leaping_head,
    },
    Case {
        name: "head_on_a_surface",
        what: "a head exactly on a wall, and exactly in a corner",
        measure: head_on_a_surface,
    },
];

/// Of the glowing box's way: near in the first half, far in the second.
const PERIOD: Duration = Duration::from_secs(1);
const NEAR: Duration = Duration::from_millis(250);
const FAR: Duration = Duration::from_millis(750);

/// Near to the wall and far from it, both out of sight.
const ABOVE: [Vec3; 2] = [vec3(0.0, 1.5, -2.4), vec3(0.0, 4.0, 1.0)];

fn bounces() -> Integrator {
    Integrator::with_bounces(1)
}

/// A wall, and a glowing box that leaps between two places.
fn leaping_lamp([near, far]: [Vec3; 2]) -> (Scene, View) {
    let mut scene = Scene {
        sky: SkyModel::constant(Vec3::splat(0.02)),
        ..Scene::default()
    };
    let grey = scene.add_material(matte(0.5));
    add_wall(&mut scene, Vec3::NEG_Z * 3.0, 2.0, grey);
    let world = scene.triangles.len();
    let glow = scene.add_material(glowing(10.0));
    scene.add_box(Vec3::ZERO, Vec3::splat(0.15), glow);
    for triangle in &mut scene.triangles[world..] {
        triangle.object = ObjectId(1);
    }
    let at = |position: Vec3| Pose {
        position,
        orientation: Quat::IDENTITY,
    };
    let (near, far) = (at(near), at(far));
    let half = PERIOD / 2;
    let instant = Duration::from_millis(1);
    scene.objects.push(RigidObject {
        name: "lamp".to_owned(),
        keys: vec![
            (Duration::ZERO, near),
            (half - instant, near),
            (half, far),
            (PERIOD - instant, far),
            (PERIOD, near),
        ],
    });
    (scene, View::new(Vec3::ZERO, Vec3::NEG_Z, 0.5))
}

/// Mean radiance with the lamp near and far.
fn states(scene: &Scene, view: View, effort: Effort) -> Result<[f64; 2]> {
    let mut tracer = Tracer::with(scene, bounces())?;
    let mut mean = |time| -> Result<f64> {
        let picture = tracer.picture_at(view, time, effort.samples(1024), effort.seed)?;
        Ok(picture.mean())
    };
    Ok([mean(NEAR)?, mean(FAR)?])
}

fn between(pictures: &[Picture], [near, far]: [f64; 2]) -> Vec<Property> {
    let means: Vec<f64> = pictures.iter().map(Picture::mean).collect();
    let least = means.iter().copied().fold(f64::INFINITY, f64::min);
    let unsound = pictures.iter().map(Picture::unsound).sum();
    vec![
        Property::at_least("bright state over dark state", near / far, 2.0),
        Property::at_least("least mean shown over the dark state", least / far, 0.95),
        Property::at_most(
            "greatest mean shown over the bright state",
            greatest(means) / near,
            1.05,
        ),
        Property::at_most("pixels that are no radiance", unsound, 0.0),
    ]
}

fn alternating_light(effort: Effort) -> Result<Vec<Property>> {
    let (scene, view) = leaping_lamp(ABOVE);
    let states = states(&scene, view, effort)?;
    let mut watched = Watched::new(&scene, view, bounces(), 1.0)?;
    let mut shown = |frame: u32, in_loop: Duration| watched.shown(PERIOD * frame + in_loop);
    let count = effort.samples(160);
    let pictures = (0..count)
        .map(|frame| shown(frame, if frame % 2 == 0 { NEAR } else { FAR }))
        .collect::<Result<Vec<_>>>()?;
    let mut properties = between(&pictures, states);
    // Then it stays.
    let rest = (count..count + 40).map(|frame| shown(frame, FAR));
    let rest = rest.collect::<Result<Vec<_>>>()?;
    let settled = rest[rest.len() - 1].mean();
    properties.push(Property::near(
        "mean 40 frames after it stays far",
        settled,
        states[1],
        0.05,
    ));
    Ok(properties)
}

/// Half a second after the box has leapt from one side to the other, at 30 updates a
/// second, the shadow that came and the one that went have changed: each is on a small
/// part of a patch.
fn leaping_shadow(effort: Effort) -> Result<Vec<Property>> {
    let (mut scene, view) = leaping_lamp([vec3(-0.5, 0.0, -2.2), vec3(0.5, 0.0, -2.2)]);
    scene.add_box(vec3(0.0, 0.0, -2.7), Vec3::splat(0.12), 0);
    let mut tracer = Tracer::with(&scene, bounces())?;
    let truth = tracer.picture_at(view, FAR, effort.samples(1024), effort.seed)?;
    let mut watched = Watched::new(&scene, view, bounces(), 1.0)?;
    for _ in 0..30 {
        watched.shown(NEAR)?;
    }
    let before = watched.shown(NEAR)?;
    let mut after = before.clone();
    for _ in 0..15 {
        after = watched.shown(FAR)?;
    }
    let mut properties = Vec::new();
    for (what, columns) in [("that came", 4..6), ("that went", 10..12)] {
        let mean = |picture: &Picture| picture.part(columns.clone(), 7..9).mean();
        let missing = (mean(&after) - mean(&truth)) / (mean(&before) - mean(&truth));
        let name = format!("change still missing of the shadow {what}");
        properties.push(Property::at_most(name, missing.abs(), 0.15));
        let changed = (mean(&before) / mean(&truth)).ln().abs();
        let name = format!("change of the shadow {what}, in powers of e");
        properties.push(Property::at_least(name, changed, 0.5));
    }
    Ok(properties)
}

fn uneven_time(effort: Effort) -> Result<Vec<Property>> {
    let (scene, view) = leaping_lamp(ABOVE);
    let states = states(&scene, view, effort)?;
    let mut watched = Watched::new(&scene, view, bounces(), 1.0)?;
    let mut time = Duration::ZERO;
    let mut pictures = Vec::new();
    for frame in 0..effort.samples(160) {
        pictures.push(watched.shown(time)?);
        time += Duration::from_millis(if frame % 4 == 3 { 5485 } else { 5 });
        if frame % 16 == 15 {
            time = Duration::ZERO;
        }
    }
    Ok(between(&pictures, states))
}

fn distant_time(effort: Effort) -> Result<Vec<Property>> {
    const LATE: Duration = Duration::from_secs(1_000_000_000);
    let (scene, view) = leaping_lamp(ABOVE);
    let states = states(&scene, view, effort)?;
    let object = &scene.objects[0];
    let mut properties = Vec::new();
    for (what, in_loop, expected) in [("near", NEAR, states[0]), ("far", FAR, states[1])] {
        let (early, late) = (object.motion(in_loop), object.motion(LATE + in_loop));
        let off = late.pose.position.distance(early.pose.position);
        let what_of = |it: &str| format!("{it} with the lamp {what}");
        let what = what_of("metres between its places now and 1e9 s later");
        properties.push(Property::at_most(what, off.into(), 1e-6));
        let mut watched = Watched::new(&scene, view, bounces(), 1.0)?;
        let mut found = f64::NAN;
        for _ in 0..20 {
            found = watched.shown(LATE + in_loop)?.mean();
        }
        properties.push(Property::near(what_of("mean"), found, expected, 0.05));
    }
    Ok(properties)
}

/// A lit room, and its view from `eye` towards its middle.
fn room() -> Scene {
    let mut scene = Scene::default();
    let grey = scene.add_material(matte(0.5));
    scene.add_box(Vec3::ZERO, Vec3::splat(-4.0), grey);
    scene.lights = vec![point_lamp(Vec3::Y, 20.0)];
    scene
}

fn leaping_head(effort: Effort) -> Result<Vec<Property>> {
    let scene = room();
    let home = View::new(vec3(0.0, 0.0, 2.0), Vec3::NEG_Z, 0.6);
    let away = View::new(Vec3::splat(1e5), Vec3::NEG_ONE, 0.6);
    let truth = picture(&scene, home, 1, effort.samples(1024), effort.seed)?;
    let mut watched = Watched::new(&scene, home, bounces(), 1.0)?;
    let mut means = Vec::new();
    let mut unsound = 0.0;
    for leap in 0..4 {
        watched.look(home);
        for frame in 0..10 {
            let shown = watched.shown(Duration::ZERO)?;
            unsound += shown.unsound();
            if leap > 0 || frame > 3 {
                means.push(shown.mean() / truth.mean());
            }
        }
        watched.look(away);
        for _ in 0..10 * leap {
            unsound += watched.shown(Duration::ZERO)?.unsound();
        }
    }
    let errors = means.iter().map(|mean| (mean - 1.0).abs());
    Ok(vec![
        Property::at_most("worst mean at home, relative error", greatest(errors), 0.05),
        Property::at_most("pixels that are no radiance", unsound, 0.0),
    ])
}

fn head_on_a_surface(effort: Effort) -> Result<Vec<Property>> {
    let scene = room();
    let mut properties = Vec::new();
    for (what, eye) in [
        ("on a wall", vec3(0.0, 0.0, 4.0)),
        ("in a corner", vec3(4.0, -4.0, 4.0)),
    ] {
        let view = View::new(eye, -eye, 0.4);
        let truth = picture(&scene, view, 1, effort.samples(1024), effort.seed)?;
        let mut watched = Watched::new(&scene, view, bounces(), 1.0)?;
        let mut unsound = 0.0;
        let mut found = f64::NAN;
        for _ in 0..20 {
            let shown = watched.shown(Duration::ZERO)?;
            unsound += shown.unsound();
            found = shown.mean();
        }
        let mean = format!("mean {what}");
        properties.push(Property::near(mean, found, truth.mean(), 0.05));
        let pixels = format!("pixels that are no radiance {what}");
        properties.push(Property::at_most(pixels, unsound, 0.0));
    }
    Ok(properties)
}
