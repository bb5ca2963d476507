//! The sun's reflection on a bent surface carries the same light however few texels
//! the surface has.

use glam::{Vec2, Vec3, Vec4, vec2, vec3};
use shadecast_protocol::{Block, Level, Method, PatchId, Slot};

use super::{ATLAS, Lasting, Schedule, VIEWER, Viewer, placed};
use crate::{
    gpu::{Gpu, GpuScene, Integrator},
    light::Light,
    patches::{self, PatchLimits, PatchedScene},
    scene::{Corner, Light as Lamp, Material, Scene},
};

/// So far away that it sees all of the square from the same direction.
const EYE: Vec3 = vec3(0.5, 0.5, 100.0);

/// A square of polished metal whose normals lean outwards by `lean` at its edges, with
/// the sun behind the eye.
fn bent_square(lean: Vec2) -> PatchedScene {
    let mut scene = Scene::default();
    let metal = scene.add_material(Material {
        base_color: Vec4::ONE,
        metallic: 1.0,
        roughness: 0.2,
        ..Material::default()
    });
    let corners = [vec2(0., 0.), vec2(1., 0.), vec2(1., 1.), vec2(0., 1.)];
    scene.add_quad(corners.map(|corner| corner.extend(0.0)), metal);
    for (corner, at) in scene.corners.iter_mut().zip(corners) {
        *corner = Corner {
            normal: ((at * 2.0 - 1.0) * lean).extend(1.0).normalize(),
            ..*corner
        };
    }
    scene.lights.push(Lamp::Directional {
        direction: (vec3(0.0, 1.5, 0.0) - EYE).normalize(),
        irradiance: Vec3::ONE,
        angular_radius: 0.005,
    });
    let limits = PatchLimits {
        longest_edge: 10.0,
        most_triangles: 10,
    };
    patches::cut(scene, limits)
}

/// Mean over the patch of what a block of these levels shows.
fn shown_mean(scene: &PatchedScene, width: u8, height: u8) -> f32 {
    let gpu = Gpu::open().expect("a GPU");
    let gpu_scene = GpuScene::new(&gpu, &scene.scene, Integrator::with_bounces(0), &mut |_| ())
        .expect("a scene");
    let mut light = Light::new(&gpu, &gpu_scene, [ATLAS; 2], Method::Sas).expect("an atlas");
    let schedule = Schedule::new(vec![Lasting {
        longest_history: 64.0,
        point: Vec3::ZERO,
        alpha: 0.04,
        shine: 1.0,
    }]);
    let block = Block {
        x: 0,
        y: 0,
        level: Level { width, height },
    };
    let mut encoder = (gpu.device).create_command_encoder(&Default::default());
    light
        .record_moves(&gpu, &mut encoder, &placed(Slot::Block(block), None))
        .expect("room");
    gpu.queue.submit([encoder.finish()]);
    let job = [schedule.job(&scene.patches, PatchId(0), Slot::Block(block), &[EYE])];
    let viewer = Viewer { eye: EYE, ..VIEWER };
    light.trace(&gpu, &gpu_scene, &job, viewer);
    light
        .show(&gpu, &gpu_scene, &job, &[], viewer)
        .expect("light");
    let shown: Vec<Vec4> = gpu
        .read(light.shown(), 0..light.shown().size())
        .expect("the device answers");
    let (width, height) = block.level.size();
    // Texels at the patch's edge stand for half as much of it.
    let share = |i: u32, count: u32| if i == 0 || i + 1 == count { 0.5 } else { 1.0 };
    let (mut sum, mut shares) = (0.0, 0.0);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let share = share(x, width) * share(y, height);
        sum += shown[(y * u32::from(ATLAS) + x) as usize].x * share;
        shares += share;
    }
    sum / shares
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_highlight_brings_as_much_light_to_few_texels_as_to_many() {
    for lean in [
        vec2(0.0, 0.0),
        vec2(0.4, 0.0),
        vec2(0.1, 0.3),
        vec2(0.4, 0.4),
    ] {
        let scene = bent_square(lean);
        let fine = shown_mean(&scene, 6, 6);
        assert!(fine > 0.05, "{lean}: no highlight, {fine}");
        let bounds = [
            (1, 1, 0.45..1.5),
            (2, 1, 0.45..1.5),
            (2, 3, 0.9..1.1),
            (4, 4, 0.95..1.05),
        ];
        for (width, height, bound) in bounds {
            let share = shown_mean(&scene, width, height) / fine;
            assert!(bound.contains(&share), "{lean}, {width} {height}: {share}");
        }
    }
}
