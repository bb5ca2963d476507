//! A server whose light is even (see `even.wgsl`): for measuring the atlas by itself, and
//! beside it what light would cost there.

use std::{
    cell::RefCell,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use cpu_time::ProcessTime;
use glam::vec3;
use shadecast_protocol::{
    ClientTime, EyeView, Fov, FrameId, Method, Pose, UpdateTiming, ViewReport, ViewSeq,
};
use shadecast_server::{
    Frame, FrameOrder, Gpu, GpuScene, Integrator, Pipeline, Prediction,
    atlas::VisiblePatch,
    encode::Planes,
    patches::{self, PatchLimits, PatchedScene},
    scene::Scene,
    still::DEFAULT_BOUNCES,
};

use super::{LastPlanes, NoVideo, SUPERBLOCKS_A_SIDE, last_planes, view::AtlasView};
use crate::report::{Spent, timed};

pub(crate) use super::view::Look;

/// Of the picture that levels are chosen for: SAS 2018, section 5.
const PICTURE: [u16; 2] = [1920, 1080];
/// Its opening from left to right, radians.
const FIELD: f32 = std::f32::consts::FRAC_PI_2;
/// Tangents of half of what is looked for, across and up: the image plane is 1.2 times
/// as wide as the picture there.
pub(crate) const TANGENTS: [f32; 2] = [1.2, 1.2 * PICTURE[1] as f32 / PICTURE[0] as f32];
/// Pixels a radian of the picture.
pub(crate) const PIXELS_PER_RADIAN: f32 = PICTURE[0] as f32 / FIELD;
/// Frames a second.
const RATE: f32 = 30.0;
/// Time that the visible set is predicted for, and heads in it: the steps of SAS
/// 2018, section 5.
const HORIZON: Duration = Duration::from_millis(100);
const HEADS: u32 = 4;
/// Half of the distance between the eyes, metres.
const HALF_BASE: f32 = 0.032;

/// A server that is asked for frames one by one, and looks at its atlas.
pub(crate) struct Even {
    /// Of a frame.
    paths: u32,
    pipeline: Pipeline,
    view: AtlasView,
    planes: LastPlanes,
    texels: u64,
}

/// A frame, and what it and some of its stages took.
pub(crate) struct Made {
    pub(crate) frame: Frame,
    pub(crate) spent: Spent,
    pub(crate) packing: Spent,
    pub(crate) light: Spent,
}

impl Even {
    /// Of `scene`, with an atlas of `size` texels.
    pub(crate) fn new(scene: &Scene, method: Method, size: [u16; 2]) -> Result<Self> {
        let integrator = Integrator {
            smoothing: false,
            ..Integrator::with_bounces(0)
        };
        let mut even = Self::build(scene, method, size, integrator)?;
        even.pipeline.light_evenly();
        Ok(even)
    }

    /// The same whose light is no longer even, but traced as the server does.
    pub(crate) fn traced(scene: &Scene, method: Method, size: [u16; 2]) -> Result<Self> {
        Self::build(
            scene,
            method,
            size,
            Integrator::with_bounces(DEFAULT_BOUNCES),
        )
    }

    /// Frames have about so many paths from now on; at first they have none.
    pub(crate) fn set_paths(&mut self, paths: u32) {
        self.paths = paths;
    }

    fn build(
        scene: &Scene,
        method: Method,
        size: [u16; 2],
        integrator: Integrator,
    ) -> Result<Self> {
        let gpu = Gpu::open()?;
        let superblock = size[0].min(size[1]) / SUPERBLOCKS_A_SIDE;
        let limits = PatchLimits::for_method(method, superblock, PIXELS_PER_RADIAN);
        let patched = patches::cut_for(method, scene.clone(), limits);
        let gpu_scene = GpuScene::new(&gpu, &patched.scene, integrator, &mut |_| ())?;
        let planes = LastPlanes::default();
        let video = Box::new(NoVideo(std::sync::Arc::clone(&planes)));
        let mut pipeline = Pipeline::new(gpu, gpu_scene, patched, size, superblock, video, 1.0)
            .context("cannot make frames of the scene")?;
        pipeline.time_packing_apart();
        Ok(Self {
            paths: 0,
            view: AtlasView::new(&pipeline, size[0])?,
            pipeline,
            planes,
            texels: u64::from(size[0]) * u64::from(size[1]),
        })
    }

    /// Makes the frame of a head that moves as `head` tells for every second.
    pub(crate) fn frame(&mut self, head: &dyn Fn(f32) -> Pose, frame: u32) -> Result<Made> {
        const STEP: f32 = 1e-2;
        let now = frame as f32 / RATE;
        let (before, world_from_head, after) = (head(now - STEP), head(now), head(now + STEP));
        let turn = after.orientation * before.orientation.inverse();
        let half_height = (f32::from(PICTURE[1]) / f32::from(PICTURE[0])).atan();
        let eyes = [-HALF_BASE, HALF_BASE].map(|x| EyeView {
            head_from_eye: Pose {
                position: vec3(x, 0.0, 0.0),
                ..Pose::IDENTITY
            },
            fov: Fov {
                up: half_height,
                down: -half_height,
                ..Fov::symmetric(FIELD)
            },
        });
        let report = ViewReport {
            seq: ViewSeq(frame),
            sampled_at: ClientTime(0),
            display_at: ClientTime(0),
            world_from_head,
            linear_velocity: (after.position - before.position) / (2.0 * STEP),
            angular_velocity: turn.to_scaled_axis() / (2.0 * STEP),
            eyes,
            eye_resolution: PICTURE,
            hands: [None; 2],
        };
        let order = FrameOrder {
            frame: FrameId(frame),
            prediction: Prediction::linear(&report, HORIZON, HEADS),
            scene_time: time_of(frame),
            objects_lead: Duration::ZERO,
            paths: self.paths,
            reset: frame == 0,
            new_client: frame == 0,
            timing: UpdateTiming::default(),
        };
        let (began, began_cpu) = (Instant::now(), ProcessTime::now());
        let laps = RefCell::new(Vec::new());
        let clock = || {
            let spent = Spent {
                wall: began.elapsed(),
                cpu: began_cpu.elapsed(),
            };
            laps.borrow_mut().push(spent);
            spent.wall
        };
        let (frame, spent) = timed(|| Ok(self.pipeline.frame(&order, &clock)?))?;
        self.view.update(&self.pipeline, &frame.update);
        // In the order of `Stages`.
        let laps = laps.into_inner();
        let stage = |at: usize, wall: Duration| match laps[at..] {
            [begin, end, ..] if end.wall - begin.wall == wall => Ok(Spent {
                wall,
                cpu: end.cpu.saturating_sub(begin.cpu),
            }),
            _ => bail!("the stages of a frame are not timed as they were"),
        };
        let stages = frame.stats.stages;
        Ok(Made {
            packing: stage(1, stages.packing)?,
            light: stage(3, stages.light)?,
            frame,
            spent,
        })
    }

    /// What a client sees with objects as at `time`, four numbers a pixel.
    pub(crate) fn look(
        &mut self,
        look: Look,
        time: Duration,
        view: (Pose, [f32; 4]),
        size: [u32; 2],
    ) -> Result<Vec<[f32; 4]>> {
        self.pipeline.move_objects(time);
        self.view.look(&self.pipeline, look, view, size)
    }

    /// What the video of the last frame is made of; none before the first.
    pub(crate) fn planes(&self) -> Option<Planes> {
        last_planes(&self.planes)
    }

    pub(crate) fn scene(&self) -> &PatchedScene {
        self.pipeline.scene()
    }

    /// What may be seen in the last frame.
    pub(crate) fn visible(&self) -> &[VisiblePatch] {
        self.pipeline.visible()
    }

    pub(crate) fn adapter(&self) -> &str {
        &self.pipeline.gpu().0.adapter
    }

    /// Texels of the atlas.
    pub(crate) fn texels(&self) -> u64 {
        self.texels
    }
}

/// When a frame is made.
pub(crate) fn time_of(frame: u32) -> Duration {
    Duration::from_secs_f32(frame as f32 / RATE)
}
