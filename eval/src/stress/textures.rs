//! Textures of one texel and of more than a device binds.

use anyhow::Result;
use glam::{Affine2, Vec2, Vec3};
use shadecast_server::{
    Gpu, GpuScene, Integrator,
    scene::{Image, Material, Scene, SkyModel, TextureRef, Wrap},
};

use super::{
    Case, Effort,
    property::Property,
    scenes::{View, add_wall, matte, picture},
};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "texture_of_one_texel",
        what: "a texture of 1 x 1",
        measure: one_texel,
    },
    Case {
        name: "texture_of_64_million_texels",
        what: "a texture of 8192 x 8192, 256 MiB and more than software drivers bind",
        measure: many_texels,
    },
    Case {
        name: "huge_texture_coordinates",
        what: "texture coordinates of 1e9 and of 3e38, that a transform takes beyond all numbers",
        measure: huge_coordinates,
    },
];

/// A square under an even sky of radiance 1: as bright as its mean colour.
fn textured(side: u32, rgba: Vec<u8>, transform: Affine2) -> Scene {
    let mut scene = Scene {
        sky: SkyModel::constant(Vec3::ONE),
        images: vec![Image {
            name: "texels".to_owned(),
            width: side,
            height: side,
            rgba,
        }],
        ..Scene::default()
    };
    let material = scene.add_material(Material {
        base_color_texture: Some(TextureRef {
            image: 0,
            uv_set: 0,
            transform,
            wrap: [Wrap::Repeat; 2],
            linear: true,
        }),
        ..matte(1.0)
    });
    add_wall(&mut scene, Vec3::ZERO, 1.0, material);
    scene
}

/// All of the square, or nearly so.
fn seen(scene: &Scene, effort: Effort) -> Result<super::scenes::Picture> {
    let view = View::new(Vec3::Z, Vec3::NEG_Z, 1.5);
    picture(scene, view, 0, effort.samples(64), effort.seed)
}

fn linear(byte: u8) -> f64 {
    ((f64::from(byte) / 255.0 + 0.055) / 1.055).powf(2.4)
}

fn one_texel(effort: Effort) -> Result<Vec<Property>> {
    let scene = textured(1, vec![200, 150, 100, 255], Affine2::IDENTITY);
    let found = seen(&scene, effort)?;
    // Kept as square roots in eight bits, a percent at worst here.
    let green = linear(150);
    Ok(vec![
        Property::near("mean colour", found.mean(), green, 0.02),
        Property::at_most("pixels that are no radiance", found.unsound(), 0.0),
    ])
}

fn many_texels(effort: Effort) -> Result<Vec<Property>> {
    const SIDE: u32 = 8192;
    // Every third of a row is bright: no halving falls in step with it.
    let (dark, bright) = ([60, 60, 60, 255], [220, 220, 220, 255]);
    let texels = (0..SIDE * SIDE).map(|i| {
        if (i % SIDE).is_multiple_of(3) {
            bright
        } else {
            dark
        }
    });
    let scene = textured(SIDE, texels.flatten().collect(), Affine2::IDENTITY);
    let gpu = Gpu::open()?;
    let gpu_scene = GpuScene::new(&gpu, &scene, Integrator::with_bounces(0), &mut |_| ())?;
    let limit = gpu.device.limits().max_storage_buffer_binding_size;
    // With its mip levels it takes a third more.
    let full = u64::from(SIDE * SIDE) * 4 * 4 / 3;
    let fits = full as f64 <= limit as f64 * 0.9;
    let halvings = f64::from(gpu_scene.texture_halvings);
    let bytes = gpu_scene.bytes as f64;
    drop(gpu_scene);
    let found = seen(&scene, effort)?;
    let mean = (linear(220) + 2.0 * linear(60)) / 3.0;
    Ok(vec![
        Property::at_least(
            "times that it was halved",
            halvings,
            f64::from(u8::from(!fits)),
        ),
        Property::at_most(
            "bytes on the device over its largest binding",
            bytes / limit as f64,
            1.0,
        ),
        Property::near("mean colour", found.mean(), mean, 0.02),
        Property::at_most("pixels that are no radiance", found.unsound(), 0.0),
    ])
}

fn huge_coordinates(effort: Effort) -> Result<Vec<Property>> {
    let mut properties = Vec::new();
    for (what, coordinate, stretch) in [("1e9", 1e9, 1.0), ("3e38 twice over", 3e38, 2.0)] {
        let transform = Affine2::from_scale(Vec2::splat(stretch));
        let mut scene = textured(2, [180; 16].to_vec(), transform);
        for corner in &mut scene.corners {
            corner.uv = corner.uv.map(|uv| (uv * 2.0 - 1.0) * coordinate);
        }
        let found = seen(&scene, effort)?;
        properties.extend([
            Property::at_most(
                format!("mean radiance at {what} over the texture's"),
                found.mean() / linear(180),
                1.02,
            ),
            Property::at_most(
                format!("pixels that are no radiance at {what}"),
                found.unsound(),
                0.0,
            ),
        ]);
    }
    Ok(properties)
}
