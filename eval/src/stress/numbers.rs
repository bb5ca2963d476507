//! Radiance from 1e-30 to what single precision holds, up to the video's bytes.

use std::time::Duration;

use anyhow::Result;
use glam::{Vec3, vec3};
use shadecast_server::{
    Integrator,
    scene::{Scene, SkyModel},
    tone_map,
};
use shadecast_shaders::{light, picture, visibility};

use super::{
    Case, Effort,
    property::{Property, greatest},
    scenes::{View, add_wall, glowing, matte, picture as path_traced},
    watched::Watched,
};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "halves",
        what: "numbers of 16 bits would overflow at 65504: no kernel stores light as such",
        measure: halves,
    },
    Case {
        name: "displayed_extremes",
        what: "radiance of 1e-30 to 3e38 at exposures of 1e-6 to 1e6, as it is displayed",
        measure: displayed_extremes,
    },
    Case {
        name: "video_of_extremes",
        what: "walls of radiance 1e-30 and 1e30 as planes of a video picture",
        measure: video_of_extremes,
    },
    Case {
        name: "light_of_extremes",
        what: "matte walls under skies of 1e-30 and 1e30",
        measure: light_of_extremes,
    },
];

/// Luma of white in limited range.
const WHITE: u8 = 235;
const BLACK: u8 = 16;

fn halves(_: Effort) -> Result<Vec<Property>> {
    let sources = [
        light::ATLAS_SOURCE,
        light::STILL_SOURCE,
        light::ADVANCE_SOURCE,
        light::TRACE_SOURCE,
        light::CARRY_SOURCE,
        picture::SOURCE,
        visibility::IDS_SOURCE,
        visibility::MARK_SOURCE,
        visibility::RECALL_SOURCE,
    ];
    let with_halves = sources
        .iter()
        .filter(|source| source.contains("f16") || source.contains("16float"))
        .count();
    let what = "kernels with numbers of 16 bits";
    Ok(vec![Property::at_most(what, with_halves as f64, 0.0)])
}

fn displayed_extremes(_: Effort) -> Result<Vec<Property>> {
    let exposures = [1e-6_f32, 1.0, 1e6];
    let least_of = |radiance: Vec3| {
        let values = exposures
            .iter()
            .flat_map(|exposure| tone_map(radiance, *exposure));
        f64::from(values.min().unwrap_or(0))
    };
    let greatest_of = |radiance: Vec3| {
        let values = exposures
            .iter()
            .flat_map(|exposure| tone_map(radiance, *exposure));
        f64::from(values.max().unwrap_or(u8::MAX))
    };
    let mut properties = Vec::new();
    for radiance in [1e20_f32, 1e30, 3e38, f32::INFINITY] {
        let what = format!("darkest channel of white of radiance {radiance:e}");
        properties.push(Property::at_least(
            what,
            least_of(Vec3::splat(radiance)),
            255.0,
        ));
        let what = format!("red channel of red of radiance {radiance:e}");
        let red = (exposures.iter())
            .map(|exposure| tone_map(vec3(radiance, 0.0, 0.0), *exposure)[0])
            .min();
        properties.push(Property::at_least(what, red.map_or(0.0, f64::from), 255.0));
    }
    for radiance in [1e-30_f32, 0.0, -1e30, f32::NAN] {
        let what = format!("brightest channel of radiance {radiance:e}");
        properties.push(Property::at_most(
            what,
            greatest_of(Vec3::splat(radiance)),
            0.0,
        ));
    }
    Ok(properties)
}

fn video_of_extremes(_: Effort) -> Result<Vec<Property>> {
    let mut properties = Vec::new();
    let glow = |radiance| (glowing(radiance), 0.0);
    for (what, (material, sky), luma) in [
        ("a wall that glows at 1e-30", glow(1e-30), BLACK),
        ("a wall that glows at 1e30", glow(1e30), WHITE),
        ("a wall that glows at 1e38", glow(1e38), WHITE),
        ("a wall under a sky of 1e-30", (matte(0.5), 1e-30), BLACK),
        ("a wall under a sky of 1e15", (matte(0.5), 1e15), WHITE),
        ("a wall under a sky of 1e30", (matte(0.5), 1e30), WHITE),
    ] {
        let mut scene = Scene {
            sky: SkyModel::constant(Vec3::splat(sky)),
            ..Scene::default()
        };
        let material = scene.add_material(material);
        add_wall(&mut scene, Vec3::ZERO, 1.0, material);
        let view = View::new(Vec3::Z, Vec3::NEG_Z, 0.5);
        let mut watched = Watched::new(&scene, view, Integrator::with_bounces(1), 1.0)?;
        for _ in 0..3 {
            watched.shown(Duration::ZERO)?;
        }
        let planes = watched.planes()?;
        // What is in no block is mid grey.
        let empty = planes.y().last().copied().unwrap_or_default();
        let lit: Vec<u8> = planes.y().iter().copied().filter(|y| *y != empty).collect();
        let luma_off = format!("luma of {what}: code values off");
        let off = greatest(lit.iter().map(|y| f64::from(y.abs_diff(luma))));
        let off = if lit.is_empty() { f64::NAN } else { off };
        properties.push(Property::at_most(luma_off, off, 0.0));
        let what = format!("chroma of {what}: code values from grey");
        let chroma = planes.u().iter().chain(planes.v());
        let off = greatest(chroma.map(|c| f64::from(c.abs_diff(128))));
        properties.push(Property::at_most(what, off, 0.0));
    }
    Ok(properties)
}

fn light_of_extremes(effort: Effort) -> Result<Vec<Property>> {
    let mut properties = Vec::new();
    for radiance in [1e-30_f32, 1e30] {
        let mut scene = Scene {
            sky: SkyModel::constant(Vec3::splat(radiance)),
            ..Scene::default()
        };
        let grey = scene.add_material(matte(0.5));
        add_wall(&mut scene, Vec3::ZERO, 1.0, grey);
        let view = View::new(Vec3::Z, Vec3::NEG_Z, 0.5);
        let found = path_traced(&scene, view, 2, effort.samples(64), effort.seed)?;
        let what = format!("mean radiance under {radiance:e}");
        let expected = f64::from(radiance) * 0.5;
        properties.push(Property::near(what, found.mean(), expected, 0.01));
    }
    Ok(properties)
}
