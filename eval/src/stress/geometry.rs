//! Geometry: tiny, huge and far scenes, slivers, walls in one place.

use anyhow::Result;
use glam::{Vec3, vec3};
use shadecast_server::scene::{Material, Scene, SkyModel};

use super::{
    Case, Effort,
    property::{Property, greatest},
    scenes::{Picture, View, add_wall, glowing, matte, picture, point_lamp},
};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "size_and_place",
        what: "a room of 1e-4 and 1e5 times the size, and one 1e5 m from the origin",
        measure: size_and_place,
    },
    Case {
        name: "slivers_and_doubles",
        what: "triangles of aspect 1e6, without area, and twice in one place",
        measure: slivers_and_doubles,
    },
    Case {
        name: "walls_in_one_place",
        what: "a wall behind another, in the same plane or 1e-5 of the scene behind it",
        measure: walls_in_one_place,
    },
    Case {
        name: "eye_on_a_surface",
        what: "an eye exactly on a wall, and exactly in a corner",
        measure: eye_on_a_surface,
    },
];

fn size_and_place(effort: Effort) -> Result<Vec<Property>> {
    let seen = |size: f32, place: Vec3| {
        let mut scene = Scene::default();
        let grey = scene.add_material(matte(0.6));
        scene.add_box(place, Vec3::splat(-4.0 * size), grey);
        scene.lights = vec![point_lamp(place + Vec3::Y * size, 10.0 * size * size)];
        let view = View::new(place, vec3(0.2, -0.3, -1.0), 0.8);
        picture(&scene, view, 2, effort.samples(256), effort.seed)
    };
    let usual = seen(1.0, Vec3::ZERO)?;
    let mut properties = vec![Property::at_least("mean radiance", usual.mean(), 0.1)];
    for (what, size, place, share) in [
        ("1e-4 times the size", 1e-4, Vec3::ZERO, 0.01),
        ("1e5 times the size", 1e5, Vec3::ZERO, 0.01),
        ("1e5 m from the origin", 1.0, Vec3::splat(1e5), 0.02),
    ] {
        let found = seen(size, place)?;
        properties.extend(as_before(what, &found, &usual, share));
    }
    Ok(properties)
}

/// The mean is as without the hardship.
fn as_before(what: &str, found: &Picture, plain: &Picture, share: f64) -> [Property; 2] {
    [
        Property::near(format!("mean, {what}"), found.mean(), plain.mean(), share),
        Property::at_most(
            format!("pixels that are no radiance, {what}"),
            found.unsound(),
            0.0,
        ),
    ]
}

fn slivers_and_doubles(effort: Effort) -> Result<Vec<Property>> {
    let room_with = |extra: &dyn Fn(&mut Scene, u32)| {
        let mut scene = Scene::default();
        let grey = scene.add_material(matte(0.5));
        scene.add_box(Vec3::ZERO, Vec3::splat(-4.0), grey);
        extra(&mut scene, grey);
        scene.lights = vec![point_lamp(Vec3::Y, 20.0)];
        let view = View::new(Vec3::ZERO, vec3(0.1, -0.2, -1.0), 0.8);
        picture(&scene, view, 2, effort.samples(256), effort.seed)
    };
    let again = |half: f32| {
        move |scene: &mut Scene, grey: u32| scene.add_box(Vec3::ZERO, Vec3::splat(-half), grey)
    };
    let plain = room_with(&|_, _| ())?;
    let doubled = room_with(&again(4.0))?;
    let nearly_doubled = room_with(&again(4.0 * (1.0 - 1e-5)))?;
    let degenerate = room_with(&|scene, grey| {
        let point = vec3(0.5, -1.0, -2.0);
        scene.add_quad([point; 4], grey);
        let along = |steps: f32, up: f32| point + Vec3::X * steps + Vec3::Y * up;
        scene.add_quad([0.0, 1.0, 2.0, 3.0].map(|x| along(x, 0.0)), grey);
        let thin = 4e-6;
        scene.add_quad(
            [
                along(0.0, 0.0),
                along(4.0, 0.0),
                along(4.0, thin),
                along(0.0, thin),
            ],
            grey,
        );
    })?;
    let mut properties = Vec::new();
    for (what, found) in [
        ("all walls twice", doubled),
        ("all walls nearly twice", nearly_doubled),
        ("slivers, lines and points", degenerate),
    ] {
        properties.extend(as_before(what, &found, &plain, 0.01));
    }
    Ok(properties)
}

fn walls_in_one_place(effort: Effort) -> Result<Vec<Property>> {
    const SIZE: f32 = 10.0;
    // Seen from before it and along it.
    let views = [
        View::new(vec3(0.0, 0.0, 5.0), Vec3::NEG_Z, 0.8),
        View::new(vec3(-4.0, 0.0, 0.3), vec3(1.0, 0.0, -0.1), 0.05),
    ];
    let seen = |view: View, bounces: u32, behind: Option<(f32, Material)>| {
        // Under an even sky a matte wall is free of noise.
        let mut scene = Scene {
            sky: SkyModel::constant(Vec3::ONE),
            ..Scene::default()
        };
        let grey = scene.add_material(matte(0.5));
        add_wall(&mut scene, Vec3::ZERO, SIZE * 0.5, grey);
        if let Some((depth, material)) = behind {
            let other = scene.add_material(material);
            add_wall(&mut scene, Vec3::NEG_Z * depth, SIZE * 0.5, other);
        }
        picture(&scene, view, bounces, effort.samples(256), effort.seed)
    };
    let mut properties = Vec::new();
    let near = SIZE * 1e-5;
    for (what, depth, material) in [
        ("one like it in its plane", 0.0, matte(0.5)),
        ("a black one 1e-5 of the scene behind it", near, matte(0.0)),
        (
            "a glaring one 1e-5 of the scene behind it",
            near,
            glowing(1e4),
        ),
    ] {
        let (mut means, mut pixels, mut unsound) = (Vec::new(), Vec::new(), 0.0);
        for (view, bounces) in [(views[0], 0), (views[0], 1), (views[1], 0), (views[1], 1)] {
            let plain = seen(view, bounces, None)?;
            let found = seen(view, bounces, Some((depth, material.clone())))?;
            means.push((found.mean() / plain.mean() - 1.0).abs());
            let pairs = found.0.iter().zip(&plain.0);
            pixels.extend(pairs.map(|(pixel, plain)| f64::from((pixel.y / plain.y - 1.0).abs())));
            unsound += found.unsound();
        }
        properties.extend([
            Property::at_most(
                format!("mean, {what}: relative error"),
                greatest(means),
                0.01,
            ),
            Property::at_most(
                format!("worst pixel, {what}: relative error"),
                greatest(pixels),
                0.05,
            ),
            Property::at_most(format!("pixels that are no radiance, {what}"), unsound, 0.0),
        ]);
    }
    Ok(properties)
}

fn eye_on_a_surface(effort: Effort) -> Result<Vec<Property>> {
    let half = 4.0_f32;
    let mut scene = Scene::default();
    let grey = scene.add_material(matte(0.5));
    scene.add_box(Vec3::ZERO, Vec3::splat(-half), grey);
    scene.lights = vec![point_lamp(Vec3::Y, 20.0)];
    let mut properties = Vec::new();
    for (what, eye) in [
        ("on a wall", vec3(0.0, 0.0, half)),
        ("in a corner", vec3(half, -half, half)),
    ] {
        let seen = |eye: Vec3| {
            let view = View::new(eye, -eye, 0.4);
            picture(&scene, view, 2, effort.samples(256), effort.seed)
        };
        let (found, before) = (seen(eye)?, seen(eye * 0.999)?);
        properties.extend(as_before(what, &found, &before, 0.01));
    }
    Ok(properties)
}
