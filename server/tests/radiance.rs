//! Surfaces whose radiance is known without a path tracer.

use std::{f32::consts::PI, time::Duration};

use glam::{Affine2, DVec3, Quat, Vec3, Vec4, vec2, vec3};
use shadecast_protocol::{Fov, Pose};
use shadecast_server::{
    Integrator,
    scene::{Alpha, EnvironmentMap, Image, Light, Material, Scene, SkyModel, TextureRef, Wrap},
    still::{Camera, DEFAULT_BOUNCES, StillRenderer},
};

/// Between the middles of two squares, metres.
const SPACING: f32 = 4.0;
/// Samples a pixel, of 16 x 16 pixels: the noise of a mean is below a percent.
const SAMPLES: u32 = 64;
const SIDE: u32 = 16;

/// One square of two metres for each material, side by side in the plane z = 0
/// and facing +Z. No point of a plane sees another, so that one bounce is all.
fn squares(materials: Vec<Material>) -> Scene {
    let mut scene = Scene::default();
    for (square, _) in (0..).zip(&materials) {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        scene.add_quad(
            corners.map(|(x, y)| middle_of(square) + vec3(x, y, 0.0)),
            square,
        );
    }
    scene.materials = materials;
    scene
}

fn renderer(scene: &Scene) -> StillRenderer {
    StillRenderer::new(
        scene,
        Integrator::with_bounces(DEFAULT_BOUNCES),
        &mut |_| (),
    )
    .expect("a GPU")
}

fn middle_of(square: u32) -> Vec3 {
    Vec3::X * SPACING * square as f32
}

/// The mean radiance of a square seen at `angle` from its normal. The picture
/// is narrow enough to hold nothing else.
fn seen(renderer: &mut StillRenderer, square: u32, angle: f32) -> Vec3 {
    let orientation = Quat::from_rotation_x(-angle);
    let camera = Camera {
        world_from_eye: Pose {
            position: middle_of(square) + orientation * Vec3::Z * 3.0,
            orientation,
        },
        fov: Fov::symmetric(0.1),
        width: SIDE,
        height: SIDE,
    };
    let still = renderer
        .render(&camera, Duration::ZERO, SAMPLES, 1)
        .expect("a picture");
    still.radiance.iter().sum::<Vec3>() / still.radiance.len() as f32
}

/// Lambert's surface: where the refractive index does not change, nothing is
/// reflected but at grazing angles.
fn matte(base_color: Vec3) -> Material {
    Material {
        base_color: base_color.extend(1.0),
        metallic: 0.0,
        ior: 1.0,
        ..Material::default()
    }
}

/// White.
fn metal(roughness: f32) -> Material {
    Material {
        roughness,
        ..Material::default()
    }
}

fn assert_near(found: Vec3, expected: Vec3, tolerance: f32) {
    let off = (found - expected).abs();
    assert!(
        off.cmple(expected * tolerance).all(),
        "{found} instead of {expected}"
    );
}

/// In a white furnace a surface is as bright as its albedo in that direction.
///
/// The expected values integrate glTF's BSDF (appendix B) over the hemisphere
/// numerically. What the rough ones lack of 1 would scatter again between their
/// facets. The glossy dielectric exceeds it: glTF mixes base and coat by the
/// half vector's Fresnel term, which does not conserve energy away from the
/// normal.
#[test]
#[ignore = "needs a Vulkan driver"]
fn a_white_furnace_shows_the_albedo() {
    let coated = |roughness| Material {
        roughness,
        ior: 1.5,
        ..matte(Vec3::ONE)
    };
    let angles = [0.0, 1.0];
    let materials_and_albedos = [
        (matte(Vec3::ONE), [1.0, 0.9983]),
        (coated(1.0), [0.9722, 0.9757]),
        (coated(0.3), [0.9995, 1.0168]),
        (metal(0.1), [1.0, 0.9998]),
        (metal(0.5), [0.9158, 0.8631]),
        (metal(1.0), [0.3069, 0.4340]),
    ];
    let (materials, albedos): (Vec<_>, Vec<_>) = materials_and_albedos.into_iter().unzip();
    let mut scene = squares(materials);
    scene.sky = SkyModel::constant(Vec3::ONE);
    let mut renderer = renderer(&scene);
    for (square, albedos) in (0..).zip(albedos) {
        for (angle, albedo) in angles.into_iter().zip(albedos) {
            let radiance = seen(&mut renderer, square, angle);
            assert_near(radiance, Vec3::splat(albedo), 0.01);
        }
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn sunlit_and_glowing_squares_have_the_radiance_that_was_asked_for() {
    // Images are kept as square roots in eight bits, a percent at worst here.
    let texel = [200, 150, 100, 255];
    let glow = vec3(2.0, 0.5, 7.0);
    let grey = vec3(0.5, 0.25, 0.75);
    let one_texel = TextureRef {
        image: 0,
        uv_set: 0,
        transform: Affine2::IDENTITY,
        wrap: [Wrap::Repeat; 2],
        linear: true,
    };
    let mut scene = squares(vec![
        matte(grey),
        Material {
            base_color_texture: Some(one_texel),
            ..matte(Vec3::ONE)
        },
        Material {
            emissive: glow,
            ..matte(Vec3::ZERO)
        },
    ]);
    scene.images = vec![Image {
        name: "one texel".to_owned(),
        width: 1,
        height: 1,
        rgba: texel.to_vec(),
    }];
    // Thirty degrees off the normal.
    let irradiance = vec3(3.0, 4.0, 5.0);
    let cosine = std::f32::consts::FRAC_PI_6.cos();
    scene.lights = vec![Light::Directional {
        direction: -vec3(std::f32::consts::FRAC_PI_6.sin(), 0.0, cosine),
        irradiance,
        angular_radius: 0.0,
    }];
    let sunlit = irradiance * cosine / PI;
    let mut renderer = renderer(&scene);
    assert_near(seen(&mut renderer, 0, 0.0), grey * sunlit, 0.02);
    let [r, g, b, _] = texel.map(f32::from);
    let color = vec3(r, g, b) / 255.0;
    let linear = color.map(|c| ((c + 0.055) / 1.055).powf(2.4));
    assert_near(seen(&mut renderer, 1, 0.0), linear * sunlit, 0.02);
    assert_near(seen(&mut renderer, 2, 0.0), glow, 1e-3);
}

fn point_lamp(position: Vec3, intensity: f32) -> Light {
    Light::Point {
        position,
        intensity: Vec3::splat(intensity),
        range: f32::INFINITY,
    }
}

/// Irradiance on the plane z = 0 below the origin's normal, W/m².
fn irradiance_at(point: Vec3, lamp: Vec3, intensity: f32) -> f32 {
    let to_lamp = lamp - point;
    intensity * to_lamp.z.max(0.0) / to_lamp.length().powi(3)
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn lamps_light_a_plane_as_closed_forms_say() {
    let albedo = 0.5;
    let grey = || matte(Vec3::splat(albedo));

    // A point lamp, beside one that is below the plane.
    let mut scene = squares(vec![grey()]);
    scene.lights = vec![
        point_lamp(vec3(3.0, 1.0, 10.0), 80.0),
        point_lamp(vec3(0.5, 0.0, -1.0), 500.0),
    ];
    let expected = albedo * irradiance_at(Vec3::ZERO, vec3(3.0, 1.0, 10.0), 80.0) / PI;
    let mut renderer = renderer(&scene);
    assert_near(seen(&mut renderer, 0, 0.3), Vec3::splat(expected), 0.005);

    // A square lamp of two metres, four metres above and facing down.
    let mut scene = squares(vec![grey()]);
    let glow = 3.0;
    scene.materials.push(Material {
        emissive: Vec3::splat(glow),
        ..matte(Vec3::ZERO)
    });
    let lamp = scene.materials.len() as u32 - 1;
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
    scene.add_quad(corners.map(|(x, y)| vec3(x, y, 4.0)), lamp);
    // Form factor of a quarter of it from below its corner, times four.
    let x = 1.0_f32 / 4.0;
    let root = (1.0 + x * x).sqrt();
    let form_factor = 4.0 * (2.0 * x / root * (x / root).atan()) / (2.0 * PI);
    let mut renderer = self::renderer(&scene);
    let found = seen(&mut renderer, 0, 0.3);
    assert_near(found, Vec3::splat(albedo * glow * form_factor), 0.005);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_mirror_shows_a_lamp_without_any_bounce() {
    let glow = vec3(3.0, 2.0, 1.0);
    let mut scene = squares(vec![metal(0.0)]);
    let lamp = scene.add_material(Material {
        emissive: glow,
        ..matte(Vec3::ZERO)
    });
    let corners = [(-9.0, -9.0), (-9.0, 9.0), (9.0, 9.0), (9.0, -9.0)];
    scene.add_quad(corners.map(|(x, y)| vec3(x, y, 8.0)), lamp);
    let integrator = Integrator::with_bounces(0);
    let mut renderer = StillRenderer::new(&scene, integrator, &mut |_| ()).expect("a GPU");
    assert_near(seen(&mut renderer, 0, 0.5), glow, 0.005);
}

/// A sky with a small bright sun in it, as a picture.
fn picture_of_a_sky() -> EnvironmentMap {
    let (width, height) = (64, 32);
    let pixel = |x: u32, y: u32| match (x, y) {
        (20, 9) => vec3(900.0, 700.0, 400.0),
        _ => Vec3::splat(0.2) + Vec3::Z * (x as f32 / 64.0) + Vec3::X * (y as f32 / 32.0),
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| pixel(x, y)));
    EnvironmentMap::new(width, height, pixels.collect()).expect("radiance")
}

/// The same as it is read: bilinearly between the middles of pixels.
fn seen_in(map: &EnvironmentMap, direction: Vec3) -> Vec3 {
    let [width, height] = map.size().map(|side| side as i32);
    let p = EnvironmentMap::uv(direction) * vec2(width as f32, height as f32) - 0.5;
    let (low, f) = (p.floor(), p - p.floor());
    let pixel = |x: i32, y: i32| {
        let (x, y) = (x.rem_euclid(width), y.clamp(0, height - 1));
        map.pixels()[(y * width + x) as usize]
    };
    let row = |y: i32| pixel(low.x as i32, y).lerp(pixel(low.x as i32 + 1, y), f.x);
    row(low.y as i32).lerp(row(low.y as i32 + 1), f.y)
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_picture_of_the_sky_lights_as_the_integral_over_it() {
    let albedo = 0.5;
    let mut scene = squares(vec![matte(Vec3::splat(albedo)), metal(0.0)]);
    let map = picture_of_a_sky();
    // Over the hemisphere about +Z, in steps of a twentieth of a pixel.
    let steps = 1280_u32;
    let mut irradiance = DVec3::ZERO;
    for i in 0..steps / 2 {
        let polar = (f64::from(i) + 0.5) * std::f64::consts::PI / f64::from(steps);
        for j in 0..steps {
            let turn = (f64::from(j) + 0.5) * std::f64::consts::TAU / f64::from(steps);
            let (sine, cosine) = polar.sin_cos();
            let direction = DVec3::new(turn.cos() * sine, turn.sin() * sine, cosine).as_vec3();
            irradiance += seen_in(&map, direction).as_dvec3() * (sine * cosine);
        }
    }
    irradiance *= 2.0 * std::f64::consts::PI.powi(2) / f64::from(steps).powi(2);
    let expected = irradiance.as_vec3() * albedo / PI;
    let mirrored = Quat::from_rotation_x(0.6) * Vec3::Z;
    let in_mirror = seen_in(&map, mirrored);
    scene.environment = Some(map.into());
    for bounces in [0, 1] {
        let integrator = Integrator::with_bounces(bounces);
        let renderer = StillRenderer::new(&scene, integrator, &mut |_| ());
        let mut renderer = renderer.expect("a GPU");
        assert_near(seen(&mut renderer, 0, 0.3), expected, 0.01);
        // The picture spans a tenth of a radian, a pixel of the sky as much.
        assert_near(seen(&mut renderer, 1, 0.6), in_mirror, 0.03);
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn blended_surfaces_hide_as_much_as_alpha_says() {
    // One veil above a square, seen through it and lit through it.
    let alpha = 0.25;
    let veil = Material {
        base_color: Vec4::new(0.0, 0.0, 0.0, alpha),
        emissive: Vec3::splat(0.4),
        alpha: Alpha::Blend,
        double_sided: true,
        ..matte(Vec3::ZERO)
    };
    let mut scene = squares(vec![matte(Vec3::splat(0.8))]);
    scene.materials.push(veil);
    for index in 0..4 {
        let position = (scene.positions[index] * 3.0).with_z(1.0);
        scene.positions.push(position);
    }
    for index in 0..2 {
        let mut triangle = scene.triangles[index];
        triangle.material = 1;
        triangle.positions = triangle.positions.map(|position| position + 4);
        scene.triangles.push(triangle);
    }
    scene.lights = vec![Light::Directional {
        direction: Vec3::NEG_Z,
        irradiance: Vec3::splat(PI),
        angular_radius: 0.0,
    }];
    // The veil fills nearly all of the hemisphere: its form factor from the middle of
    // the square, two triangles of six metres a metre above it.
    let x = 3.0_f32;
    let root = (1.0 + x * x).sqrt();
    let form_factor = 4.0 * (2.0 * x / root * (x / root).atan()) / (2.0 * PI);
    let through = 1.0 - alpha;
    let ground = 0.8 * (through + alpha * 0.4 * form_factor);
    let expected = alpha * 0.4 + through * ground;
    let mut renderer = renderer(&scene);
    assert_near(seen(&mut renderer, 0, 0.0), Vec3::splat(expected), 0.01);
}
