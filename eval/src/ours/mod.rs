//! Our own method without network and video: the server's frames, and what a
//! client would show of their atlas.

pub(crate) mod even;
mod view;

use std::{
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use anyhow::{Context, Result};
use glam::Vec3;
use shadecast_protocol::{
    ClientTime, EyeView, Fov, FrameId, Pose, UpdateTiming, ViewReport, ViewSeq,
};
use shadecast_server::{
    FrameOrder, FrameStats, Gpu, GpuScene, Integrator, Pipeline, Prediction,
    encode::{EncodeError, EncodedPicture, Planes, VideoEncoder},
    patches::{self, PatchLimits},
    scene::Scene,
    still::{Still, StillPass},
};

use self::view::AtlasView;
use crate::report::{Spent, timed};

/// Largest block, as a share of the atlas: what the server takes by itself.
const SUPERBLOCKS_A_SIDE: u16 = 8;

/// A server that is asked for frames one by one, and a look at its atlas.
pub(crate) struct Ours {
    pipeline: Pipeline,
    view: AtlasView,
    fov: Fov,
    side: u16,
    next: FrameId,
    planes: LastPlanes,
}

impl Ours {
    /// For square pictures of `side` pixels, with a square atlas of `atlas` texels.
    pub(crate) fn new(
        scene: &Scene,
        integrator: Integrator,
        view: (Fov, u16),
        atlas: u16,
    ) -> Result<Self> {
        Self::build(scene, integrator, view, atlas, None)
    }

    /// The same at this exposure instead of a measured one.
    pub(crate) fn exposed(
        scene: &Scene,
        integrator: Integrator,
        view: (Fov, u16),
        atlas: u16,
        exposure: f32,
    ) -> Result<Self> {
        Self::build(scene, integrator, view, atlas, Some(exposure))
    }

    fn build(
        scene: &Scene,
        integrator: Integrator,
        (fov, side): (Fov, u16),
        atlas: u16,
        exposure: Option<f32>,
    ) -> Result<Self> {
        let gpu = Gpu::open()?;
        let superblock = atlas / SUPERBLOCKS_A_SIDE;
        let density = f32::from(side) / (fov.right - fov.left);
        let patched = patches::cut(scene.clone(), PatchLimits::for_atlas(superblock, density));
        let gpu_scene = GpuScene::new(&gpu, &patched.scene, integrator, &mut |_| ())?;
        let eye = patched.scene.first_eye();
        let exposure = match exposure {
            Some(exposure) => exposure,
            None => StillPass::new(&gpu, &gpu_scene)?.automatic_exposure(&gpu, &gpu_scene, eye)?,
        };
        let planes = LastPlanes::default();
        let encoder = Box::new(NoVideo(Arc::clone(&planes)));
        let pipeline = Pipeline::new(
            gpu, gpu_scene, patched, [atlas; 2], superblock, encoder, exposure,
        )
        .context("cannot make frames of the scene")?;
        Ok(Self {
            view: AtlasView::new(&pipeline, atlas)?,
            pipeline,
            fov,
            side,
            next: FrameId(0),
            planes,
        })
    }

    /// Makes the frame for an eye at `world_from_eye` and objects as at
    /// `scene_time`, of about `paths` paths.
    pub(crate) fn frame(
        &mut self,
        world_from_eye: Pose,
        scene_time: Duration,
        paths: u32,
    ) -> Result<(FrameStats, Spent)> {
        let eye = EyeView {
            head_from_eye: Pose::IDENTITY,
            fov: self.fov,
        };
        let report = ViewReport {
            seq: ViewSeq(self.next.0),
            sampled_at: ClientTime(0),
            display_at: ClientTime(0),
            world_from_head: world_from_eye,
            linear_velocity: Vec3::ZERO,
            angular_velocity: Vec3::ZERO,
            eyes: [eye; 2],
            eye_resolution: [self.side; 2],
            hands: [None; 2],
        };
        let first = self.next == FrameId(0);
        let order = FrameOrder {
            frame: self.next,
            prediction: Prediction::linear(&report, Duration::ZERO, 1),
            scene_time,
            objects_lead: Duration::ZERO,
            paths,
            reset: first,
            new_client: first,
            timing: UpdateTiming::default(),
        };
        self.next.0 += 1;
        let (frame, spent) = timed(|| Ok(self.pipeline.frame(&order, &wall_clock())?))?;
        self.view.update(&self.pipeline, &frame.update);
        Ok((frame.stats, spent))
    }

    /// The pipeline behind the frames.
    pub(crate) fn pipeline(&mut self) -> &mut Pipeline {
        &mut self.pipeline
    }

    /// What a camera sees of the atlas as it is now.
    pub(crate) fn see(&self, view: (Pose, [f32; 4]), size: [u32; 2]) -> Result<Still> {
        self.view.see(&self.pipeline, view, size)
    }

    /// What the video of the last frame is made of; none before the first.
    pub(crate) fn planes(&self) -> Option<Planes> {
        last_planes(&self.planes)
    }
}

fn wall_clock() -> impl Fn() -> Duration {
    let began = std::time::Instant::now();
    move || began.elapsed()
}

type LastPlanes = Arc<Mutex<Option<Planes>>>;

fn last_planes(planes: &LastPlanes) -> Option<Planes> {
    // A frame that panicked leaves no planes behind.
    planes
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .clone()
}

/// The light is looked at before it becomes video.
struct NoVideo(LastPlanes);

impl VideoEncoder for NoVideo {
    fn encode(&mut self, planes: &Planes, idr: bool) -> Result<EncodedPicture, EncodeError> {
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *last = Some(planes.clone());
        Ok(EncodedPicture {
            bytes: Vec::new(),
            idr,
        })
    }
}
