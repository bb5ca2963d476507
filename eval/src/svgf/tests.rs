use std::f32::consts::PI;

use glam::{Quat, Vec3, vec3};
use naga::proc::Layouter;
use shadecast_protocol::ObjectId;
use shadecast_server::{
    Integrator,
    scene::{Material, RigidObject, Scene, SkyModel},
    still::StillPass,
};

use super::*;
use crate::mean_squared_error;

/// Of a picture, pixels.
const SIZE: [u32; 2] = [64, 48];
const TANGENTS: [f32; 4] = [-0.8, 0.8, 0.6, -0.6];
/// Paths a pixel of a frame.
const SAMPLES: u32 = 4;
/// Of a reference: its noise is an eighth of a traced frame's.
const MANY_SAMPLES: u32 = 256;

fn matte(scene: &mut Scene, color: Vec3, emissive: f32) -> u32 {
    scene.add_material(Material {
        base_color: color.extend(1.0),
        metallic: 0.0,
        roughness: 0.6,
        emissive: Vec3::splat(emissive),
        ..Material::default()
    })
}

/// A level square that looks up, with these half sides.
fn level(height: f32, half: f32) -> [Vec3; 4] {
    [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]
        .map(|(x, z)| vec3(x * half, height, z * half))
}

/// A white room with a red floor, a lamp that lights the ceiling, a box, and a box
/// that can move: what is seen is lit by bounces, which few paths find.
fn room() -> Scene {
    let mut scene = Scene::default();
    let white = matte(&mut scene, Vec3::splat(0.7), 0.0);
    let red = matte(&mut scene, vec3(0.7, 0.15, 0.1), 0.0);
    let green = matte(&mut scene, vec3(0.2, 0.6, 0.2), 0.0);
    let lamp = matte(&mut scene, Vec3::ZERO, 8.0);
    scene.add_box(Vec3::ZERO, vec3(-3.0, -2.0, -3.0), white);
    scene.add_quad(level(-1.99, 3.0), red);
    scene.add_quad(level(0.9, 0.7), lamp);
    scene.add_box(vec3(-1.0, -1.3, -1.7), vec3(0.5, 0.7, 0.5), white);
    let first = scene.triangles.len();
    scene.add_box(Vec3::ZERO, Vec3::splat(0.4), green);
    for triangle in &mut scene.triangles[first..] {
        triangle.object = ObjectId(1);
    }
    scene.objects = vec![RigidObject::default()];
    scene
}

/// A scene, its baseline and its references on one device.
struct Studio {
    gpu: Gpu,
    gpu_scene: GpuScene,
    svgf: Svgf,
    still: StillPass,
}

impl Studio {
    fn new(scene: &Scene) -> Self {
        let gpu = Gpu::open().expect("a GPU");
        let integrator = Integrator::with_bounces(1);
        let gpu_scene = GpuScene::new(&gpu, scene, integrator, &mut |_| ()).expect("a scene");
        Self {
            svgf: Svgf::new(&gpu, &gpu_scene, SIZE).expect("kernels"),
            still: StillPass::new(&gpu, &gpu_scene).expect("kernels"),
            gpu,
            gpu_scene,
        }
    }

    fn place_box(&mut self, position: Vec3, turn: f32) {
        self.gpu_scene.set_poses(&self.gpu, &[pose(position, turn)]);
    }

    fn frame(&mut self, eye: Pose) -> Still {
        let (gpu, gpu_scene) = (&self.gpu, &self.gpu_scene);
        self.svgf.frame(gpu, gpu_scene, (eye, TANGENTS), SAMPLES, 7);
        let still = self.svgf.read(gpu).expect("a picture");
        let is_sound = |r: &Vec3| r.is_finite() && r.min_element() >= 0.0;
        assert!(still.radiance.iter().all(is_sound), "{:?}", still.radiance);
        still
    }

    fn frames(&mut self, eye: Pose, count: u32) -> Still {
        (1..count).for_each(|_| drop(self.frame(eye)));
        self.frame(eye)
    }

    /// The last frame again, with the same samples but without history.
    fn last_frame_alone(&mut self, eye: Pose) -> Still {
        self.svgf.forget();
        self.svgf.frames -= 1;
        self.svgf.samples -= SAMPLES;
        self.frame(eye)
    }

    fn traced(&self, eye: Pose, samples: u32) -> Still {
        let (gpu, still) = (&self.gpu, &self.still);
        let mut film = still.film(gpu, SIZE).expect("a film");
        let view = (eye, TANGENTS);
        still.expose(gpu, &self.gpu_scene, &mut film, view, samples, 1);
        still.develop(gpu, &film).expect("a picture")
    }

    fn mean_history(&self) -> f32 {
        let histories = self.svgf.histories(&self.gpu).expect("histories");
        histories.iter().sum::<f32>() / histories.len() as f32
    }
}

fn pose(position: Vec3, turn: f32) -> Pose {
    Pose {
        position,
        orientation: Quat::from_rotation_y(turn),
    }
}

/// Root of the mean squared error of what is displayed.
fn error(still: &Still, reference: &Still) -> f64 {
    let exposure = reference.automatic_exposure();
    let [one, other] = [still, reference].map(|still| still.displayed(exposure));
    mean_squared_error(&one, &other).expect("one size").sqrt()
}

#[test]
fn kernels_validate_and_records_are_as_large_as_the_host_has_them() {
    let mut sources = passes::filter_sources().to_vec();
    sources.push(passes::light_source());
    for source in sources {
        let module = naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
        let everything = naga::valid::Capabilities::all();
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), everything)
            .validate(&module)
            .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
        let mut layouts = Layouter::default();
        layouts.update(module.to_ctx()).expect("layouts");
        let stride = |name| {
            let named = |t: &naga::Type| t.name.as_deref() == Some(name);
            let (handle, _) = module.types.iter().find(|(_, t)| named(t))?;
            Some(u64::from(layouts[handle].to_stride()))
        };
        for (name, bytes) in [
            ("View", size_of::<View>() as u64),
            ("Hit", records::HIT_BYTES),
            ("Seen", records::SEEN_BYTES),
            ("Guide", records::GUIDE_BYTES),
            ("Coat", records::COAT_BYTES),
            ("Moments", records::MOMENTS_BYTES),
        ] {
            assert_eq!(stride(name).unwrap_or(bytes), bytes, "{name}");
        }
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_still_picture_converges() {
    let mut studio = Studio::new(&room());
    studio.place_box(vec3(0.9, -1.58, -0.6), 0.5);
    let eye = pose(vec3(0.2, 0.0, 2.4), 0.1);
    let reference = studio.traced(eye, MANY_SAMPLES);
    let unfiltered = error(&studio.traced(eye, SAMPLES), &reference);
    let errors: Vec<f64> = (0..16)
        .map(|_| error(&studio.frame(eye), &reference))
        .collect();
    assert!(errors[15] < 0.8 * errors[0], "{errors:?}");
    assert!(errors[15] < 0.5 * unfiltered, "{errors:?} of {unfiltered}");
    assert!(studio.mean_history() > 15.0, "{}", studio.mean_history());
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn history_follows_cameras_and_objects_and_ends_with_a_cut() {
    let mut studio = Studio::new(&room());
    let eye_at = |frame: f32| pose(vec3(0.02 * frame, 0.01 * frame, 2.4), 0.006 * frame);
    for frame in 0..16 {
        let frame = frame as f32;
        studio.place_box(vec3(0.2 + 0.03 * frame, -1.58, -0.6), 0.04 * frame);
        studio.frame(eye_at(frame));
    }
    let history = studio.mean_history();
    assert!(history > 12.0, "{history} of 16 frames");
    let eye = eye_at(15.0);
    let reference = studio.traced(eye, MANY_SAMPLES);
    let moving = studio.svgf.read(&studio.gpu).expect("a picture");
    let moving = error(&moving, &reference);
    let alone = error(&studio.last_frame_alone(eye), &reference);
    assert!(moving < 0.9 * alone, "{moving} of {alone}");

    // The box jumps: where it was and where it is now, other things were seen.
    let before = studio.frames(eye, 8);
    studio.place_box(vec3(-0.4, -1.0, 0.0), 0.0);
    let reference = studio.traced(eye, MANY_SAMPLES);
    let moved = error(&studio.frame(eye), &reference);
    let ghost = error(&before, &reference);
    let alone = error(&studio.last_frame_alone(eye), &reference);
    assert!(moved < 1.1 * alone, "{moved} of {alone}");
    assert!(moved < 0.9 * ghost, "{moved} of {ghost}");

    studio.frames(eye, 8);
    let behind = pose(vec3(0.0, 0.0, -2.0), PI);
    let cut = studio.frame(behind);
    let history = studio.mean_history();
    // Nothing but the tops of the boxes is seen from both sides.
    assert!(history < 1.5, "{history} frames after a cut");
    let alone = studio.last_frame_alone(behind);
    let reference = studio.traced(behind, MANY_SAMPLES);
    let (cut, alone) = (error(&cut, &reference), error(&alone, &reference));
    assert!(cut < 1.1 * alone, "{cut} of {alone}");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn nothing_but_numbers_comes_out() {
    let mut dark = room();
    for material in &mut dark.materials {
        material.emissive = Vec3::ZERO;
    }
    let mut studio = Studio::new(&dark);
    let eye = pose(Vec3::Z, 0.0);
    for _ in 0..3 {
        let black = studio.frame(eye);
        assert!(black.radiance.iter().all(|r| *r == Vec3::ZERO));
    }

    let mut broken = room();
    broken.sky = SkyModel::constant(Vec3::splat(f32::MAX));
    broken.materials[0].base_color.x = f32::NAN;
    broken.materials[1].roughness = f32::NAN;
    broken.materials[2].emissive = Vec3::splat(f32::INFINITY);
    broken.materials[3].emissive = Vec3::splat(1e30);
    broken.corners[3].normal = Vec3::NAN;
    let mut studio = Studio::new(&broken);
    let turned = |position, turn| [pose(position, turn), pose(position, turn)];
    let eyes = [
        turned(Vec3::Z, 0.0),
        // In a wall, in a corner, outside, and far away.
        turned(vec3(0.0, 0.0, -3.0), 0.3),
        turned(vec3(3.0, 2.0, 3.0), PI),
        turned(vec3(0.0, 0.0, 30.0), 0.0),
        turned(Vec3::splat(1e7), 1.0),
    ];
    for eye in eyes.as_flattened() {
        studio.frame(*eye);
    }
}
