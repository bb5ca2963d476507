//! What becomes of the texels on a walk through the built-in scene.

use std::{collections::HashSet, time::Duration};

use glam::{Quat, Vec3};
use shadecast_protocol::{ClientTime, EyeView, Fov, Method, Pose, ViewReport, ViewSeq};

use super::{
    super::{Snake, SnakeFootprints, SnakeShape},
    watched::{texels_of, triangle},
};
use crate::{
    Prediction,
    atlas::{Atlas, AtlasShape, Footprints},
    gpu::{Gpu, GpuScene, Integrator},
    patches::{self, PatchLimits},
    scene::{Scene, courtyard},
    visibility::Visibility,
};

/// A head that walks at a metre a second and turns by 20 degrees a second.
fn view(scene: &Scene, seconds: f32) -> ViewReport {
    let eye = EyeView {
        head_from_eye: Pose::IDENTITY,
        fov: Fov::symmetric(std::f32::consts::FRAC_PI_4),
    };
    ViewReport {
        seq: ViewSeq(0),
        sampled_at: ClientTime(0),
        display_at: ClientTime(0),
        world_from_head: scene.first_eye().then(Pose {
            position: Vec3::new(0.0, 0.0, -seconds),
            orientation: Quat::from_rotation_y(seconds * 0.35),
        }),
        linear_velocity: Vec3::ZERO,
        angular_velocity: Vec3::ZERO,
        eyes: [eye; 2],
        eye_resolution: [640; 2],
        hands: [None; 2],
    }
}

/// Prints where texels go beside what SAS does with the same view: run with `--nocapture`.
#[test]
#[ignore = "needs a Vulkan driver"]
fn a_walk_through_the_courtyard_wastes_little() {
    for side in [512_u16, 1024] {
        let gpu = Gpu::open().expect("a GPU");
        let cut = patches::cut(courtyard(15_000), PatchLimits::for_atlas(64, 400.0));
        let limits = PatchLimits::for_atlas(64, 400.0);
        let scene = patches::cut_for(Method::Snake, courtyard(15_000), limits);
        let integrator = Integrator::with_bounces(0);
        let gpu_scene =
            GpuScene::new(&gpu, &scene.scene, integrator, &mut |_| ()).expect("a scene");
        let count = scene.patches.len() as u32;
        let mut visibility = Visibility::new(&gpu, &gpu_scene, &scene).expect("room");
        let shape = SnakeShape::new([side; 2]).expect("a size");
        let mut snake = Snake::new(&gpu, shape, count, visibility.pixels()).expect("room");
        let pass = SnakeFootprints::new(&gpu, &gpu_scene, &scene, visibility.pixels(), &snake)
            .expect("room");
        let cut_scene = GpuScene::new(&gpu, &cut.scene, integrator, &mut |_| ()).expect("a scene");
        let mut by_patch = Visibility::new(&gpu, &cut_scene, &cut).expect("room");
        let sas_shape = AtlasShape::new([side; 2], 64).expect("a size");
        let mut sas =
            Atlas::new(&gpu, sas_shape, cut.patches.len() as u32, by_patch.pixels()).expect("room");
        let sas_pass =
            Footprints::new(&gpu, &cut_scene, &cut, by_patch.pixels(), sas.wishes()).expect("room");
        let poses: Vec<Pose> = scene
            .scene
            .objects
            .iter()
            .map(|object| object.motion(Duration::ZERO).pose)
            .collect();
        let (mut moved, mut sas_moved, mut sum, mut useful_sum) = (0, 0, 0.0, 0.0);
        for turn in 0..90 {
            let view = view(&scene.scene, turn as f32 / 30.0);
            let prediction = Prediction::linear(&view, Duration::from_millis(33), 2);
            let (eye, viewpoints) = (prediction.eye(), prediction.viewpoints());
            let mut eyes = vec![eye];
            eyes.extend(poses.iter().map(|pose| pose.inverse().transform_point(eye)));
            let pixels_per_radian = prediction.pixels_per_radian();
            let encoder = || {
                gpu.device
                    .create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
            };
            let mut commands = encoder();
            visibility.record(&gpu, &mut commands, &gpu_scene, &viewpoints, |_| {
                poses.clone()
            });
            pass.record(&gpu, &mut commands, &gpu_scene, &eyes, pixels_per_radian);
            let placed = snake.place(&gpu, commands).expect("a GPU");
            let mut commands = encoder();
            by_patch.record(&gpu, &mut commands, &cut_scene, &viewpoints, |_| {
                poses.clone()
            });
            sas_pass.record(&gpu, &mut commands, &gpu_scene, &eyes, pixels_per_radian);
            let by_sas = sas.place(&gpu, commands).expect("a GPU");
            assert_eq!(placed.unplaced, 0);
            moved += placed.moved.len();
            sas_moved += by_sas.moved.len();
            let slots: Vec<_> = placed
                .visible
                .iter()
                .filter_map(|visible| visible.slot)
                .collect();
            let useful: f64 = slots
                .iter()
                .map(|slot| {
                    let [a, b, c] = triangle(*slot).corners.map(|corner| corner.map(f64::from));
                    ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs() / 128.0
                })
                .sum();
            sum += placed.stats.used_fraction();
            useful_sum += useful;
            if turn % 30 == 0 || turn == 89 {
                let owned: usize = slots.iter().map(|slot| texels_of(*slot).len()).sum();
                let distinct: HashSet<_> =
                    slots.iter().map(|slot| triangle(*slot).corners).collect();
                assert_eq!(distinct.len(), slots.len());
                println!(
                    "{side} frame {turn}: {} seen, bias {}, useful {useful:.0}, owned {owned}, {:?}",
                    slots.len(),
                    placed.bias,
                    placed.stats
                );
                println!(
                    "   SAS: {} seen, bias {}, {:?}",
                    by_sas.visible.len(),
                    by_sas.bias,
                    by_sas.stats
                );
            }
        }
        println!(
            "{side}: moved {} a frame, SAS {}; used {:.2}, useful {:.3}",
            moved / 90,
            sas_moved / 90,
            sum / 90.0,
            useful_sum / 90.0 / f64::from(side) / f64::from(side)
        );
        // Texels within triangles, of all.
        assert!(sum / 90.0 > 0.3, "{sum}");
    }
}
