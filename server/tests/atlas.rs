//! What the whole pipeline promises of the atlas: nothing of an old epoch is left
//! in the picture that a new one begins with, and the same orders make the same
//! updates.

use std::{
    f32::consts::PI,
    sync::{Arc, Mutex},
    time::Duration,
};

use glam::{Quat, Vec3};
use shadecast_protocol::{
    ClientTime, EyeView, Fov, FrameId, Pose, UpdateTiming, ViewReport, ViewSeq,
};
use shadecast_server::{
    Frame, FrameOrder, Gpu, GpuScene, Integrator, Pipeline, Prediction,
    encode::{EncodeError, EncodedPicture, Planes, VideoEncoder},
    patches::{self, PatchLimits},
    scene::{Scene, courtyard},
};

const ATLAS: u16 = 512;
const SUPERBLOCK: u16 = 64;
/// Luma of what was never lit, mid grey in limited range, and by how much rounding
/// may miss it.
const EMPTY: u8 = 125;
const ROUNDING: u8 = 1;

/// Keeps what it is given.
#[derive(Clone)]
struct Kept(Arc<Mutex<Vec<u8>>>);

impl VideoEncoder for Kept {
    fn encode(&mut self, planes: &Planes, idr: bool) -> Result<EncodedPicture, EncodeError> {
        *self.0.lock().expect("no panic holds it") = planes.y().to_vec();
        Ok(EncodedPicture {
            idr,
            bytes: Vec::new(),
        })
    }
}

fn pipeline(scene: &Scene) -> (Pipeline, Arc<Mutex<Vec<u8>>>) {
    let gpu = Gpu::open().expect("a GPU");
    let scene = patches::cut(scene.clone(), PatchLimits::for_atlas(SUPERBLOCK, 165.0));
    let gpu_scene = GpuScene::new(&gpu, &scene.scene, Integrator::with_bounces(0), &mut |_| ())
        .expect("it fits");
    let luma = Arc::new(Mutex::new(Vec::new()));
    let encoder = Box::new(Kept(Arc::clone(&luma)));
    let size = [ATLAS; 2];
    let pipeline = Pipeline::new(gpu, gpu_scene, scene, size, SUPERBLOCK, encoder, 1.0);
    (pipeline.expect("a pipeline"), luma)
}

/// The frame of a head that has turned by so many radians.
fn frame(pipeline: &mut Pipeline, id: u32, turned: f32, reset: bool) -> Frame {
    lit_frame(pipeline, id, turned, reset, 100_000)
}

/// The same with a budget of paths.
fn lit_frame(pipeline: &mut Pipeline, id: u32, turned: f32, reset: bool, paths: u32) -> Frame {
    let eye = EyeView {
        head_from_eye: Pose::IDENTITY,
        fov: Fov::symmetric(1.0),
    };
    let view = ViewReport {
        seq: ViewSeq(0),
        sampled_at: ClientTime(0),
        display_at: ClientTime(0),
        world_from_head: pipeline.scene().scene.first_eye().then(Pose {
            position: Vec3::ZERO,
            orientation: Quat::from_rotation_y(turned),
        }),
        linear_velocity: Vec3::ZERO,
        angular_velocity: Vec3::ZERO,
        eyes: [eye; 2],
        eye_resolution: [256; 2],
        hands: [None; 2],
    };
    let order = FrameOrder {
        frame: FrameId(id),
        prediction: Prediction::linear(&view, Duration::ZERO, 1),
        scene_time: Duration::ZERO,
        objects_lead: Duration::ZERO,
        paths,
        reset,
        new_client: id == 0,
        timing: UpdateTiming::default(),
    };
    pipeline.frame(&order, &|| Duration::ZERO).expect("a frame")
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn an_idr_picture_shows_nothing_of_blocks_that_are_gone() {
    let (mut pipeline, luma) = pipeline(&courtyard(3_000));
    let lit_outside = |frame: &Frame| {
        let mut luma = luma.lock().expect("no panic holds it").clone();
        for placement in &frame.update.placements {
            let bounds = placement.slot.bounds();
            for y in bounds.y..bounds.y + bounds.height {
                let at = (y * u32::from(ATLAS) + bounds.x) as usize;
                luma[at..at + bounds.width as usize].fill(EMPTY);
            }
        }
        luma.iter()
            .filter(|luma| luma.abs_diff(EMPTY) > ROUNDING)
            .count()
    };
    let first = frame(&mut pipeline, 0, 0.0, true);
    assert!(first.picture.idr && lit_outside(&first) == 0);
    // What the first view showed is not shown any more, and other blocks are.
    let other = frame(&mut pipeline, 1, PI, false);
    assert!(!other.picture.idr && lit_outside(&other) > 0);
    let anew = frame(&mut pipeline, 2, PI, true);
    assert!(anew.picture.idr && !anew.update.placements.is_empty());
    assert_eq!(lit_outside(&anew), 0);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_same_orders_make_the_same_updates() {
    let scene = courtyard(3_000);
    let runs = [(); 2].map(|()| {
        let (mut pipeline, luma) = pipeline(&scene);
        let frames: Vec<_> = (0..12_u32)
            .map(|id| {
                let turned = id as f32 * 0.3;
                let frame = frame(&mut pipeline, id, turned, id == 7);
                let luma = luma.lock().expect("no panic holds it").clone();
                (frame.update, frame.stats.bias, frame.stats.atlas, luma)
            })
            .collect();
        frames
    });
    assert!(runs[0] == runs[1], "two runs differ");
    assert!(
        runs[0]
            .iter()
            .any(|(update, ..)| !update.removals.is_empty())
    );
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_budget_beyond_a_path_a_texel_is_spent_too() {
    let (mut pipeline, _) = pipeline(&courtyard(3_000));
    let budget = 400_000;
    let first = lit_frame(&mut pipeline, 0, 0.0, true, budget);
    let placements = first.update.placements.iter();
    let texels: u32 = placements
        .map(|placement| placement.slot.bounds().area())
        .sum();
    assert!(texels < budget / 2, "{texels}");
    assert!(first.stats.paths > budget / 8 * 7, "{}", first.stats.paths);
}
