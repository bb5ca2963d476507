//! The kernel measures patches as its twin does, whatever the eye.

use glam::{Vec3, vec3};
use shadecast_protocol::PatchShape;
use shadecast_shaders::atlas::{OCTAVE, Wish, footprint};

use super::super::Footprints;
use crate::{
    gpu::{Gpu, GpuScene, Integrator},
    patches::{self, PatchLimits, PatchedScene},
    scene::courtyard,
};

/// log2 of the area of the smallest block, steps: below it nothing differs.
const SMALLEST: i32 = 2 * OCTAVE;

/// What the kernel finds of all patches, and what the twin finds.
fn both(
    gpu: &Gpu,
    gpu_scene: &GpuScene,
    scene: &PatchedScene,
    eye: Vec3,
    pixels_per_radian: f32,
) -> Vec<[Wish; 2]> {
    let count = scene.patches.len();
    let visible = vec![1_u32; count];
    let pixels = gpu
        .storage("pixels", bytemuck::cast_slice(&visible))
        .expect("room");
    let wishes = gpu.scratch("wishes", count as u64 * 4).expect("room");
    let pass = Footprints::new(gpu, gpu_scene, scene, &pixels, &wishes).expect("room");
    let eyes = vec![eye; scene.scene.objects.len() + 1];
    let mut encoder = gpu
        .device
        .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    pass.record(gpu, &mut encoder, gpu_scene, &eyes, pixels_per_radian);
    gpu.queue.submit([encoder.finish()]);
    let words: Vec<u32> = gpu.read(&wishes, 0..wishes.size()).expect("a GPU");
    let found = words.into_iter().map(Wish::of_word);
    let twin = scene.patches.iter().map(|patch| {
        let shape = match patch.shape {
            PatchShape::Solo => 0,
            PatchShape::Pair => 1,
            PatchShape::Triple => 2,
        };
        let corners = patch.corners.map(|c| scene.scene.positions[c as usize]);
        footprint(shape, &corners, eye, pixels_per_radian)
    });
    found.zip(twin).map(|(found, twin)| [found, twin]).collect()
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_kernel_measures_as_its_twin_does() {
    let gpu = Gpu::open().expect("a GPU");
    let scene = patches::cut(courtyard(5_000), PatchLimits::for_atlas(64, 300.0));
    let integrator = Integrator::with_bounces(0);
    let gpu_scene =
        GpuScene::new(&gpu, &scene.scene, integrator, &mut |_| ()).expect("a valid scene");
    let shapes = [PatchShape::Solo, PatchShape::Pair, PatchShape::Triple];
    for shape in shapes {
        assert!(scene.patches.iter().any(|patch| patch.shape == shape));
    }
    let at_a_corner = scene.scene.positions[scene.patches[0].corners[0] as usize];
    let eyes = [
        vec3(0.3, 1.6, 0.2),
        vec3(-4.0, 0.4, 7.0),
        at_a_corner,
        vec3(0.0, 1e4, 0.0),
    ];
    let (mut all, mut exact, mut needles) = (0_u32, 0_u32, 0_u32);
    for eye in eyes {
        for pixels_per_radian in [30.0, 1222.0, 110_000.0] {
            for [found, twin] in both(&gpu, &gpu_scene, &scene, eye, pixels_per_radian) {
                let area = found.area().max(SMALLEST) - twin.area().max(SMALLEST);
                let aspect = found.aspect() - twin.aspect();
                all += 1;
                exact += u32::from(area == 0 && aspect == 0);
                needles += u32::from(area.abs() > OCTAVE / 8);
                assert!(aspect.abs() <= OCTAVE / 8, "{found:?} is not {twin:?}");
            }
        }
    }
    let found = format!("{exact} of {all} alike, {needles} far apart");
    assert!(exact * 100 > all * 97 && needles * 200 < all, "{found}");
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
            assert!((0..=32 * OCTAVE).contains(&found.area()));
            assert!((-16 * OCTAVE..=16 * OCTAVE).contains(&found.aspect()));
        }
    }
}
