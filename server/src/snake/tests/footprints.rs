//! The kernel measures triangles as its twin does, whatever the eye.

use glam::{Vec3, vec3};
use shadecast_shaders::snake::{NO_TURN, SnakeFootprintParameters, snake_footprint};

use super::{
    super::{Snake, SnakeFootprints},
    shape,
};
use crate::{
    gpu::{Gpu, GpuScene, Integrator},
    patches::{self, PatchLimits, PatchedScene},
    scene::courtyard,
};

/// What the kernel finds of all triangles, and what the twin finds, as words.
fn both(
    gpu: &Gpu,
    gpu_scene: &GpuScene,
    scene: &PatchedScene,
    eye: Vec3,
    pixels_per_radian: f32,
) -> Vec<[[u32; 2]; 2]> {
    let count = scene.patches.len();
    let visible = vec![1_u32; count];
    let pixels = gpu
        .storage("pixels", bytemuck::cast_slice(&visible))
        .expect("room");
    let snake = Snake::new(gpu, shape(256, 256), count as u32, &pixels).expect("room");
    let pass = SnakeFootprints::new(gpu, gpu_scene, scene, &pixels, &snake).expect("room");
    let eyes = vec![eye; scene.scene.objects.len() + 1];
    let mut encoder = gpu
        .device
        .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    pass.record(gpu, &mut encoder, gpu_scene, &eyes, pixels_per_radian);
    gpu.queue.submit([encoder.finish()]);
    let bytes = 0..snake.wishes().size();
    let words: Vec<[u32; 2]> = gpu.read(snake.wishes(), bytes).expect("a GPU");
    let parameters = SnakeFootprintParameters {
        patch_count: count as u32,
        pixels_per_radian,
        padding: [0; 2],
    };
    let twin = scene.patches.iter().map(|patch| {
        let first = &scene.scene.triangles[patch.first_triangle as usize];
        let corners = first.positions.map(|c| scene.scene.positions[c as usize]);
        snake_footprint(corners, eye, &parameters, NO_TURN).words()
    });
    words
        .into_iter()
        .zip(twin)
        .map(|(found, twin)| [found, twin])
        .collect()
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_kernel_measures_as_its_twin_does() {
    let gpu = Gpu::open().expect("a GPU");
    let scene = patches::cut(courtyard(5_000), PatchLimits::for_atlas(64, 300.0));
    let integrator = Integrator::with_bounces(0);
    let gpu_scene =
        GpuScene::new(&gpu, &scene.scene, integrator, &mut |_| ()).expect("a valid scene");
    let at_a_corner = scene.scene.positions[scene.patches[0].corners[0] as usize];
    let eyes = [
        vec3(0.3, 1.6, 0.2),
        vec3(-4.0, 0.4, 7.0),
        at_a_corner,
        vec3(0.0, 1e4, 0.0),
    ];
    let (mut all, mut exact, mut apart) = (0_u32, 0_u32, 0_u32);
    for eye in eyes {
        for pixels_per_radian in [30.0, 1222.0, 110_000.0] {
            for [found, twin] in both(&gpu, &gpu_scene, &scene, eye, pixels_per_radian) {
                let near = |shift: u32| {
                    let log = |words: [u32; 2]| (words[0] >> shift & 0xffff) as i32;
                    (log(found) - log(twin)).abs() <= 2
                };
                all += 1;
                exact += u32::from(found == twin);
                // Of two edges that are as long either may be the base.
                let turned = (found[1] ^ twin[1]) >> 12 & 7 != 0;
                apart += u32::from(!(turned || near(0) && near(16)));
            }
        }
    }
    let found = format!("{exact} of {all} alike, {apart} far apart");
    println!("{found}");
    assert!(exact * 100 > all * 90 && apart * 200 < all, "{found}");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn what_is_no_number_is_measured_all_the_same() {
    let gpu = Gpu::open().expect("a GPU");
    let scene = patches::cut(courtyard(1_000), PatchLimits::for_atlas(64, 300.0));
    let integrator = Integrator::with_bounces(0);
    let gpu_scene =
        GpuScene::new(&gpu, &scene.scene, integrator, &mut |_| ()).expect("a valid scene");
    let eye = vec3(0.3, 1.6, 0.2);
    let odd = [f32::NAN, f32::INFINITY, -1.0, 0.0, 1e38];
    let wild = odd.map(|number| (eye, number));
    let lost = odd.map(|number| (Vec3::splat(number), 1222.0));
    for (eye, pixels_per_radian) in wild.into_iter().chain(lost) {
        for [found, _] in both(&gpu, &gpu_scene, &scene, eye, pixels_per_radian) {
            assert!(found[0] & 0xffff <= 4096 && found[0] >> 16 <= 4096);
            assert!((found[1] >> 12 & 7) < 6 && found[1] >> 30 == 0);
        }
    }
}
