//! Stiff and extreme scenes: what is found stays finite, no energy is created,
//! and closed forms hold.

use std::{f32::consts::PI, time::Duration};

use glam::{Quat, Vec2, Vec3, Vec4, vec3};
use shadecast_protocol::{Fov, ObjectId, Pose};
use shadecast_server::{
    Integrator,
    scene::{Corner, Light, Material, Scene, SkyModel, Triangle},
    still::{Camera, StillRenderer},
};

/// Of a picture, pixels.
const SIDE: u32 = 16;

fn matte(albedo: f32) -> Material {
    Material {
        base_color: Vec3::splat(albedo).extend(1.0),
        metallic: 0.0,
        // Without a change of the refractive index nothing is reflected.
        ior: 1.0,
        ..Material::default()
    }
}

fn mirror(roughness: f32) -> Material {
    Material {
        roughness,
        ..Material::default()
    }
}

fn material(scene: &mut Scene, material: Material) -> u32 {
    scene.materials.push(material);
    scene.materials.len() as u32 - 1
}

/// Two triangles; their front is where the corners run counter-clockwise.
fn quad(scene: &mut Scene, corners: [Vec3; 4], material: u32) {
    let first = scene.positions.len() as u32;
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    for position in corners {
        scene.positions.push(position);
        scene.corners.push(Corner {
            normal: normal.normalize_or(Vec3::Y),
            tangent: Vec4::ZERO,
            uv: [Vec2::ZERO; 2],
            color: Vec4::ONE,
        });
    }
    for corners in [[0, 1, 2], [0, 2, 3]].map(|corners| corners.map(|c| first + c)) {
        scene.triangles.push(Triangle {
            positions: corners,
            corners,
            material,
            object: ObjectId::WORLD,
        });
    }
}

/// A cube of this half width, all faces looking inwards.
fn room(scene: &mut Scene, centre: Vec3, half: f32, material: u32) {
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let (mut n, mut u) = (Vec3::ZERO, Vec3::ZERO);
            n[axis] = side;
            u[(axis + 1) % 3] = 1.0;
            let v = u.cross(n);
            let corner = |a: f32, b: f32| centre + (n + u * a + v * b) * half;
            let corners = [
                corner(-1.0, -1.0),
                corner(1.0, -1.0),
                corner(1.0, 1.0),
                corner(-1.0, 1.0),
            ];
            quad(scene, corners, material);
        }
    }
}

fn point_lamp(position: Vec3, intensity: f32) -> Light {
    Light::Point {
        position,
        intensity: Vec3::splat(intensity),
        range: f32::INFINITY,
    }
}

/// The pixels of a picture from `eye` towards `forward`.
fn picture(scene: &Scene, eye: Vec3, forward: Vec3, bounces: u32, samples: u32) -> Vec<Vec3> {
    let camera = Camera {
        world_from_eye: Pose {
            position: eye,
            orientation: Quat::from_rotation_arc(Vec3::NEG_Z, forward.normalize()),
        },
        fov: Fov::symmetric(0.8),
        width: SIDE,
        height: SIDE,
    };
    let mut renderer =
        StillRenderer::new(scene, Integrator::with_bounces(bounces), &mut |_| ()).expect("a GPU");
    let still = renderer.render(&camera, Duration::ZERO, samples, 1);
    let radiance = still.expect("a picture").radiance;
    let sound = radiance
        .iter()
        .all(|r| r.is_finite() && r.min_element() >= 0.0);
    assert!(sound, "{radiance:?}");
    radiance
}

fn mean(pixels: &[Vec3]) -> f32 {
    pixels.iter().map(|pixel| pixel.y).sum::<f32>() / pixels.len() as f32
}

#[track_caller]
fn assert_near(found: f32, expected: f32, tolerance: f32) {
    let off = (found - expected).abs();
    assert!(off <= tolerance * expected, "{found} instead of {expected}");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_closed_white_room_neither_loses_nor_makes_light() {
    for albedo in [0.999_f32, 1.0] {
        let mut scene = Scene::default();
        let white = material(
            &mut scene,
            Material {
                emissive: Vec3::splat(0.5),
                ..matte(albedo)
            },
        );
        room(&mut scene, Vec3::ZERO, 3.0, white);
        // Schlick's term reflects at grazing angles even here, and rough facets hide
        // some of that: glTF's BSDF integrates to 0.99907, mean over a hemisphere.
        let kept = albedo - 0.000_93;
        // Emission at 65 vertices, and what the last of them receives.
        let sum: f32 = (0..=65).map(|k| 0.5 * kept.powi(k)).sum();
        let found = mean(&picture(&scene, Vec3::ZERO, Vec3::NEG_Z, 64, 64));
        assert_near(found, sum, 0.01);
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn neither_size_nor_place_changes_what_is_seen() {
    let seen = |size: f32, place: Vec3| {
        let mut scene = Scene::default();
        let grey = material(&mut scene, matte(0.6));
        room(&mut scene, place, 4.0 * size, grey);
        scene.lights = vec![point_lamp(place + Vec3::Y * size, 10.0 * size * size)];
        mean(&picture(&scene, place, vec3(0.2, -0.3, -1.0), 2, 64))
    };
    let usual = seen(1.0, Vec3::ZERO);
    assert!(usual > 0.1);
    assert_near(seen(1e-4, Vec3::ZERO), usual, 0.01);
    assert_near(seen(1e5, Vec3::ZERO), usual, 0.01);
    assert_near(seen(1.0, Vec3::splat(1e5)), usual, 0.02);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn light_does_not_leave_a_closed_box_nor_black_walls() {
    let mut scene = Scene::default();
    let grey = material(&mut scene, matte(0.8));
    room(&mut scene, Vec3::ZERO, 5.0, grey);
    let shell = material(
        &mut scene,
        Material {
            double_sided: true,
            ..matte(0.8)
        },
    );
    let lamp = vec3(0.0, 0.0, -3.0);
    room(&mut scene, lamp, 0.5, shell);
    scene.lights = vec![point_lamp(lamp, 1e6)];
    let found = mean(&picture(&scene, Vec3::ZERO, Vec3::NEG_Z, 3, 16));
    // Without the box it would be 1e4.
    assert!(found < 1e-4, "{found} came out of the box");

    let mut scene = Scene::default();
    let black = material(&mut scene, matte(0.0));
    room(&mut scene, Vec3::ZERO, 5.0, black);
    scene.lights = vec![point_lamp(Vec3::Y, 1e6)];
    // Schlick's term reflects a little at grazing angles: where white walls would have 1e4.
    let found = mean(&picture(&scene, Vec3::ZERO, Vec3::NEG_Z, 3, 4));
    assert!(found < 1e-4, "{found} came from black walls");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn mirrors_face_each_other_and_create_nothing() {
    for roughness in [0.0, 1e-4, 1.0] {
        let mut scene = Scene::default();
        let polished = material(&mut scene, mirror(roughness));
        room(&mut scene, Vec3::ZERO, 2.0, polished);
        let glow = material(
            &mut scene,
            Material {
                emissive: Vec3::ONE,
                ..matte(0.0)
            },
        );
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        quad(&mut scene, corners.map(|(x, y)| vec3(x, y, -1.99)), glow);
        // Along the mirrors, at 1e-6 rad from their plane, and into them.
        for forward in [
            vec3(0.0, 1e-6, 1.0),
            vec3(1e-6, -1.0, 0.0),
            vec3(1.0, 1.0, 1.0),
        ] {
            let found = picture(&scene, vec3(0.0, 1.999, 0.5), forward, 16, 16);
            // A lamp of radiance 1 can be no brighter in any mirror.
            assert!(
                mean(&found) <= 1.01,
                "{roughness} {forward}: {}",
                mean(&found)
            );
        }
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn slivers_doubles_and_points_change_nothing() {
    let room_with = |extra: &dyn Fn(&mut Scene, u32)| {
        let mut scene = Scene::default();
        let grey = material(&mut scene, matte(0.5));
        room(&mut scene, Vec3::ZERO, 4.0, grey);
        extra(&mut scene, grey);
        scene.lights = vec![point_lamp(Vec3::Y, 20.0)];
        mean(&picture(&scene, Vec3::ZERO, vec3(0.1, -0.2, -1.0), 2, 64))
    };
    let plain = room_with(&|_, _| ());
    let doubled = room_with(&|scene, grey| room(scene, Vec3::ZERO, 4.0, grey));
    assert_near(doubled, plain, 0.01);
    let nearly_doubled =
        room_with(&|scene, grey| room(scene, Vec3::ZERO, 4.0 * (1.0 - 1e-5), grey));
    assert_near(nearly_doubled, plain, 0.01);
    let degenerate = room_with(&|scene, grey| {
        let point = vec3(0.5, -1.0, -2.0);
        quad(scene, [point; 4], grey);
        quad(
            scene,
            [
                point,
                point + Vec3::X,
                point + 2.0 * Vec3::X,
                point + 3.0 * Vec3::X,
            ],
            grey,
        );
        let thin = Vec3::Y * 4e-6;
        quad(
            scene,
            [
                point,
                point + Vec3::X * 4.0,
                point + Vec3::X * 4.0 + thin,
                point + thin,
            ],
            grey,
        );
    });
    assert_near(degenerate, plain, 0.01);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_tiny_glaring_lamp_beside_a_dim_sky() {
    let mut scene = Scene::default();
    let grey = material(&mut scene, matte(0.5));
    let wide = 50.0;
    let floor = [(-wide, wide), (wide, wide), (wide, -wide), (-wide, -wide)];
    quad(&mut scene, floor.map(|(x, z)| vec3(x, 0.0, z)), grey);
    let glare = material(
        &mut scene,
        Material {
            emissive: Vec3::splat(1e7),
            ..matte(0.0)
        },
    );
    let half = 0.5e-4;
    let lamp = [(-half, -half), (half, -half), (half, half), (-half, half)];
    quad(&mut scene, lamp.map(|(x, z)| vec3(x, 40.0, z)), glare);
    scene.sky = SkyModel::constant(Vec3::splat(0.01));
    // The floor below it receives 1e7 times its area over the square of its height.
    let irradiance = 1e7 * (2.0 * half).powi(2) / 1600.0 + 0.01 * PI;
    let camera_above = vec3(0.0, 1.0, 0.0);
    let found = picture(&scene, camera_above, vec3(0.0, -1.0, 1e-3), 0, 64);
    assert_near(mean(&found), 0.5 * irradiance / PI, 0.01);
}
