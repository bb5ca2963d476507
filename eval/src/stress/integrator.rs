//! Light transport: white rooms, furnaces, mirrors, grazing rays.

use std::f64::consts::PI;

use anyhow::Result;
use glam::{DVec3, Vec3, vec3};
use shadecast_server::scene::{Light, Material, Scene, SkyModel};

use super::{
    Case, Effort,
    brdf::Surface,
    property::{Property, greatest},
    scenes::{Tracer, View, add_floor, add_wall, glowing, matte, metal, picture, point_lamp},
};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "white_room",
        what: "a closed room of albedo 0.999 or 1 that glows, 64 bounces",
        measure: white_room,
    },
    Case {
        name: "furnace",
        what: "surfaces of roughness 0, 1e-4 and 1 under an even sky, against the BRDF's integral",
        measure: furnace,
    },
    Case {
        name: "grazing_light",
        what: "a sun 1e-6 rad above the plane that it lights, against the BRDF",
        measure: grazing_light,
    },
    Case {
        name: "grazing_eye",
        what: "an eye 1e-6 rad above the plane that it sees",
        measure: grazing_eye,
    },
    Case {
        name: "mirror_room",
        what: "mirrors of roughness 0, 1e-4 and 1 that face each other, 16 bounces",
        measure: mirror_room,
    },
    Case {
        name: "black_walls",
        what: "a strong lamp in a room that reflects nothing",
        measure: black_walls,
    },
];

fn white_room(effort: Effort) -> Result<Vec<Property>> {
    let mut properties = Vec::new();
    for albedo in [0.999_f32, 1.0] {
        let mut scene = Scene::default();
        let white = scene.add_material(Material {
            emissive: Vec3::splat(0.5),
            ..matte(albedo)
        });
        scene.add_box(Vec3::ZERO, Vec3::splat(-3.0), white);
        // Schlick's term reflects at grazing angles even here, and rough facets hide
        // some of that: glTF's BSDF integrates to 0.99907, mean over a hemisphere.
        let kept = f64::from(albedo) - 0.000_93;
        // Emission at 65 vertices, and what the last of them receives.
        let sum: f64 = (0..=65).map(|k| 0.5 * kept.powi(k)).sum();
        let view = View::new(Vec3::ZERO, Vec3::NEG_Z, 0.8);
        let found = picture(&scene, view, 64, effort.samples(256), effort.seed)?;
        let what = format!("mean radiance at albedo {albedo}");
        properties.push(Property::near(what, found.mean(), sum, 0.01));
        let what = format!("pixels that are no radiance at albedo {albedo}");
        properties.push(Property::at_most(what, found.unsound(), 0.0));
    }
    Ok(properties)
}

fn furnace(effort: Effort) -> Result<Vec<Property>> {
    // Between the middles of squares, metres: no point of a plane sees another.
    const SPACING: f32 = 4.0;
    // Noise of the samples included.
    let bound = if effort.quick { 0.003 } else { 0.001 };
    let mut scene = Scene {
        sky: SkyModel::constant(Vec3::ONE),
        ..Scene::default()
    };
    let mut surfaces = Vec::new();
    for (name, base, metallic) in [
        ("white metal", 1.0_f32, 1.0_f32),
        ("grey metal", 0.5, 1.0),
        ("white dielectric", 1.0, 0.0),
        ("black dielectric", 0.0, 0.0),
    ] {
        for roughness in [0.0_f32, 1e-4, 1.0] {
            let material = scene.add_material(Material {
                base_color: Vec3::splat(base).extend(1.0),
                metallic,
                roughness,
                ..Material::default()
            });
            let middle = Vec3::X * SPACING * surfaces.len() as f32;
            add_wall(&mut scene, middle, 1.0, material);
            let surface = Surface {
                base: base.into(),
                metallic: metallic.into(),
                alpha: f64::from(roughness).powi(2),
                ior: 1.5,
            };
            surfaces.push((format!("{name}, roughness {roughness}"), middle, surface));
        }
    }
    let mut tracers = [Tracer::new(&scene, 0)?, Tracer::new(&scene, 1)?];
    let mut properties = Vec::new();
    for (name, middle, surface) in surfaces {
        let mut errors = Vec::new();
        for angle in [0.0_f32, 1.0, 1.5] {
            let expected = surface.albedo(angle.into());
            let to_eye = vec3(0.0, angle.sin(), angle.cos());
            let view = View::new(middle + to_eye, -to_eye, 0.005);
            for tracer in &mut tracers {
                let found = tracer.picture(view, effort.samples(4096), effort.seed)?;
                errors.push((found.mean() / expected - 1.0).abs());
            }
        }
        let what = format!("albedo of {name}: relative error");
        properties.push(Property::at_most(what, greatest(errors), bound));
    }
    Ok(properties)
}

fn grazing_light(effort: Effort) -> Result<Vec<Property>> {
    let grazing = 1e-6_f32;
    let mut scene = Scene {
        lights: vec![Light::Directional {
            direction: -vec3(grazing.cos(), grazing.sin(), 0.0),
            irradiance: Vec3::splat(1e6),
            angular_radius: 0.0,
        }],
        ..Scene::default()
    };
    let grey = scene.add_material(matte(0.5));
    add_floor(&mut scene, Vec3::ZERO, 10.0, grey);
    let view = View::new(Vec3::Y, vec3(0.0, -1.0, 1e-3), 0.01);
    let found = picture(&scene, view, 1, effort.samples(64), effort.seed)?;
    let surface = Surface {
        base: 0.5,
        metallic: 0.0,
        alpha: 1.0,
        ior: 1.0,
    };
    let angle = f64::from(grazing);
    let to_light = DVec3::new(angle.cos(), 0.0, angle.sin());
    let expected = surface.value(DVec3::Z, to_light) * 1e6 * to_light.z;
    Ok(vec![
        Property::near("mean radiance", found.mean(), expected, 0.01),
        Property::at_most("pixels that are no radiance", found.unsound(), 0.0),
    ])
}

fn grazing_eye(effort: Effort) -> Result<Vec<Property>> {
    let mut properties = Vec::new();
    for (name, material) in [
        ("matte", matte(1.0)),
        ("mirror", metal(0.0)),
        ("rough metal", metal(1.0)),
    ] {
        let mut scene = Scene {
            sky: SkyModel::constant(Vec3::ONE),
            ..Scene::default()
        };
        let material = scene.add_material(material);
        add_floor(&mut scene, Vec3::ZERO, 10.0, material);
        // A metre away, and so narrow that only the plane is seen.
        let view = View::new(vec3(0.0, 1e-6, 0.0), vec3(0.0, -1e-6, -1.0), 1e-6);
        let found = picture(&scene, view, 2, effort.samples(64), effort.seed)?;
        properties.push(Property::at_most(
            format!("mean radiance of {name} over that of the sky"),
            found.mean(),
            1.01,
        ));
        let what = format!("pixels of {name} that are no radiance");
        properties.push(Property::at_most(what, found.unsound(), 0.0));
    }
    Ok(properties)
}

fn mirror_room(effort: Effort) -> Result<Vec<Property>> {
    let mut properties = Vec::new();
    for roughness in [0.0, 1e-4, 1.0] {
        let mut scene = Scene::default();
        let polished = scene.add_material(metal(roughness));
        scene.add_box(Vec3::ZERO, Vec3::splat(-2.0), polished);
        let glow = scene.add_material(glowing(1.0));
        add_wall(&mut scene, vec3(0.0, 0.0, -1.99), 1.0, glow);
        let (mut means, mut unsound) = (Vec::new(), 0.0);
        // Along the mirrors, at 1e-6 rad from their plane, and into them.
        for forward in [
            vec3(0.0, 1e-6, 1.0),
            vec3(1e-6, -1.0, 0.0),
            vec3(1.0, 1.0, 1.0),
        ] {
            let view = View::new(vec3(0.0, 1.999, 0.5), forward, 0.8);
            let found = picture(&scene, view, 16, effort.samples(64), effort.seed)?;
            means.push(found.mean());
            unsound += found.unsound();
        }
        // A lamp of radiance 1 can be no brighter in any mirror.
        let what = format!("greatest mean radiance over the lamp's, roughness {roughness}");
        properties.push(Property::at_most(what, greatest(means), 1.01));
        let what = format!("pixels that are no radiance, roughness {roughness}");
        properties.push(Property::at_most(what, unsound, 0.0));
    }
    Ok(properties)
}

fn black_walls(effort: Effort) -> Result<Vec<Property>> {
    let mut scene = Scene::default();
    let black = scene.add_material(matte(0.0));
    scene.add_box(Vec3::ZERO, Vec3::splat(-5.0), black);
    scene.lights = vec![point_lamp(Vec3::Y, 1e6)];
    let view = View::new(Vec3::ZERO, Vec3::NEG_Z, 0.8);
    let found = picture(&scene, view, 3, effort.samples(16), effort.seed)?;
    // White walls would have this, were there no other walls.
    let white = 1e6 / (PI * 26.0);
    Ok(vec![
        // Schlick's term reflects a little at grazing angles.
        Property::at_most("mean radiance", found.mean(), 1e-4),
        Property::at_most(
            "the same over that of white walls",
            found.mean() / white,
            1e-8,
        ),
        Property::at_most("pixels that are no radiance", found.unsound(), 0.0),
    ])
}
