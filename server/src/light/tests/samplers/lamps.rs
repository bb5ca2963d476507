//! The choice of one lamp among many.

use bytemuck::{Pod, Zeroable};
use glam::{Quat, Vec3, Vec4, vec3};
use shadecast_protocol::{ObjectId, Pose};
use shadecast_shaders::light::Sampler;

use super::{Bench, assert_likely, counts};
use crate::scene::{Corner, Light, Material, RigidObject, Scene, Triangle};

const SOURCE: &str = include_str!("lamps.wgsl");
const SAMPLES: usize = 1 << 17;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Choice {
    light: u32,
    /// Zero where the way led to no lamp that reaches the point.
    probability: f32,
    by_trail: f32,
}

pub(super) fn glowing(radiance: f32, double_sided: bool) -> Material {
    Material {
        emissive: Vec3::splat(radiance),
        double_sided,
        ..Material::default()
    }
}

/// Adds a triangle with a material of its own.
pub(super) fn add_triangle(
    scene: &mut Scene,
    corners: [Vec3; 3],
    material: Material,
    object: ObjectId,
) {
    let first = scene.positions.len() as u32;
    scene.positions.extend(corners);
    scene.corners.extend(
        [Corner {
            normal: Vec3::Y,
            tangent: Vec4::ZERO,
            uv: Default::default(),
            color: Vec4::ONE,
        }; 3],
    );
    scene.triangles.push(Triangle {
        positions: [first, first + 1, first + 2],
        corners: [first, first + 1, first + 2],
        material: scene.materials.len() as u32,
        object,
    });
    scene.materials.push(material);
}

fn draw_3d(sampler: &mut Sampler) -> Vec3 {
    let ([x, y], [z, _]) = (sampler.sample_2d(), sampler.sample_2d());
    vec3(x, y, z)
}

/// Lamps of all kinds and of powers over three decades, in the upper half of a
/// room; every third triangle is dark.
fn many_lamps() -> Scene {
    let mut scene = Scene {
        objects: vec![RigidObject::default()],
        ..Scene::default()
    };
    for index in 0..60 {
        let mut sampler = Sampler::new(index, 3);
        let mut draw = || draw_3d(&mut sampler);
        let position = draw() * vec3(10.0, 3.0, 10.0) - vec3(5.0, 0.0, 5.0);
        let direction = (draw() - 0.5).normalize();
        let intensity = Vec3::splat(1000.0_f32.powf(draw().x));
        let range = f32::INFINITY;
        scene.lights.push(match index % 5 {
            0 => Light::Point {
                position,
                intensity,
                range,
            },
            1 => Light::Spot {
                position,
                direction,
                intensity,
                range,
                inner: 0.3,
                outer: 0.5,
            },
            2 if index < 15 => Light::Directional {
                direction,
                irradiance: intensity * 0.01,
                angular_radius: 0.0,
            },
            _ => {
                let corners = [(); 3].map(|()| position + draw() - 0.5);
                let radiance = if index % 3 == 0 { 0.0 } else { intensity.x };
                let material = glowing(radiance, index % 2 == 0);
                let object = ObjectId(u16::from(index % 4 == 3));
                add_triangle(&mut scene, corners, material, object);
                continue;
            }
        });
    }
    scene
}

/// On the floor, from where all lamps are above, and anywhere: point and normal.
fn receivers() -> Vec<[Vec4; 2]> {
    let receiver = |index| {
        let mut sampler = Sampler::new(index, 4);
        let mut draw = || draw_3d(&mut sampler);
        let point = draw() * vec3(10.0, 3.0, 10.0) - vec3(5.0, 0.0, 5.0);
        if index % 3 == 0 {
            [point.with_y(-1.0), Vec3::Y]
        } else {
            [point, (draw() - 0.5).normalize()]
        }
    };
    (0..12)
        .map(|index| receiver(index).map(|v| v.extend(0.0)))
        .collect()
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn lamps_are_chosen_as_often_as_their_densities_say() {
    let scene = many_lamps();
    let mut bench = Bench::new(&scene);
    let pose = Pose {
        position: vec3(1.0, 0.5, -2.0),
        orientation: Quat::from_rotation_y(0.7),
    };
    bench.scene.set_poses(&bench.gpu, &[pose]);
    // The strongest directional light is the sun and no lamp.
    let punctual = scene.lights.len() - 1;
    let areas: Vec<f64> = (scene.triangles.iter())
        .map(|triangle| {
            let [a, b, c] = triangle.positions.map(|p| scene.positions[p as usize]);
            f64::from((b - a).cross(c - a).length()) * 0.5
        })
        .collect();
    let shines: Vec<bool> = (scene.triangles.iter())
        .map(|triangle| scene.materials[triangle.material as usize].emissive != Vec3::ZERO)
        .collect();
    let lamps = punctual + shines.iter().filter(|shines| **shines).count();
    assert_eq!((lamps, punctual), (48, 26));

    let receivers = receivers();
    let densities = lamps + areas.len();
    let told: Vec<f32> = bench.run(SOURCE, "tell", &receivers, densities);
    let choices: Vec<Choice> = bench.run(SOURCE, "choose", &receivers, SAMPLES);
    let mut never_in_vain = 0;
    for (told, choices) in told.chunks(densities).zip(choices.chunks(SAMPLES)) {
        let (by_lamp, by_area) = told.split_at(lamps);
        let punctual = by_lamp[..punctual].iter();
        let mut probabilities: Vec<f64> = punctual.map(|p| f64::from(*p)).collect();
        for ((density, area), shines) in by_area.iter().zip(&areas).zip(&shines) {
            if *shines {
                probabilities.push(f64::from(*density) * area);
            } else {
                assert_eq!(*density, 0.0);
            }
        }
        let found = choices.iter().map(|choice| {
            let is_found = choice.probability > 0.0;
            // One branch's share is told as one less the other's.
            let off = (choice.probability - choice.by_trail).abs();
            assert!(!is_found || off < 6.0 * f32::EPSILON, "{choice:?}");
            if is_found {
                choice.light as usize
            } else {
                lamps
            }
        });
        let counts = counts(lamps + 1, found);
        // A branch may promise light that none of its lamps sends: a choice in vain.
        let sum: f64 = probabilities.iter().sum();
        probabilities.push(1.0 - sum);
        assert!(sum < 1.0 + 1e-5, "{sum}");
        if counts[lamps] == 0.0 {
            assert!(sum > 1.0 - 1e-5, "{sum}");
            never_in_vain += 1;
        }
        assert_likely("lamps", &counts, &probabilities, receivers.len());
    }
    assert!(never_in_vain > 0);
}
