//! One frame of the server, from top to bottom: what may be seen, where it
//! lies in the atlas, how it is lit, and what the client must be told.
//!
//! Source: SAS 2018, section 3 and figure 2.

use std::{collections::BTreeMap, time::Duration};

use glam::Vec3;
use shadecast_protocol::{FrameId, Motion, PatchId, Picture, Pose, Update, UpdateTiming};

use crate::{
    atlas::{AtlasError, AtlasStats, Placed, VisiblePatch},
    encode::{EncodeError, VideoEncoder},
    gpu::{Gpu, GpuError, GpuScene},
    known::Known,
    light::{Job, Lasting, Light, Repeats, Schedule, Viewer, keeps_shown, keeps_texels},
    packer::Packer,
    patches::{Patch, PatchedScene},
    picture::PictureConversion,
    prediction::Prediction,
    scene::{Material, Scene, SceneFacts},
    snake::SnakeError,
    visibility::{Recent, Visibility},
};

/// Samples over which a diffuse texel's mean runs at most: beyond it the error
/// is below a code value of the video.
const LONGEST_HISTORY: f32 = 4096.0;
/// The same on an object that moves, and its light with it.
const MOVING_HISTORY: f32 = 8.0;

/// What a frame is made for.
#[derive(Clone, Debug)]
pub struct FrameOrder {
    /// Its name.
    pub frame: FrameId,
    /// Where the head may be while it is shown.
    pub prediction: Prediction,
    /// The scene's own time.
    pub scene_time: Duration,
    /// From then until the frame will be seen: moving objects are shown as they will be.
    pub objects_lead: Duration,
    /// Paths that may be traced.
    pub paths: u32,
    /// Begin a new epoch.
    pub reset: bool,
    /// The client knows nothing yet.
    pub new_client: bool,
    /// Goes into the update; `finished` is filled in when it is sent.
    pub timing: UpdateTiming,
}

/// A picture, its update, and what making them was like.
#[derive(Clone, Debug)]
pub struct Frame {
    /// For the client.
    pub update: Update,
    /// For the client.
    pub picture: Picture,
    /// For the report.
    pub stats: FrameStats,
}

/// What a frame was like.
#[derive(Clone, Debug)]
pub struct FrameStats {
    /// Time of each stage.
    pub stages: Stages,
    /// Size of the potentially visible set.
    pub visible: u32,
    /// Patches that it had no room for.
    pub unplaced: u32,
    /// Subtracted from log2 of all areas.
    pub bias: f32,
    /// The atlas after the frame.
    pub atlas: AtlasStats,
    /// Paths traced.
    pub paths: u32,
}

/// Where a frame's time went.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stages {
    /// Id pictures, marking, and where patches are shaded: one submission, but for
    /// what is timed apart.
    pub visibility: Duration,
    /// Where patches are shaded, where that is timed apart
    /// ([`Pipeline::time_packing_apart`]); else none.
    pub packing: Duration,
    /// What the client must be told of that.
    pub atlas: Duration,
    /// Path tracing.
    pub light: Duration,
    /// Tone curve and colour conversion.
    pub picture: Duration,
    /// Video.
    pub encode: Duration,
}

/// Why a frame or a server could not be made.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// The GPU failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The encoder failed.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// The atlas cannot be as asked.
    #[error(transparent)]
    Atlas(#[from] AtlasError),
    /// The same, of the method `snake`.
    #[error(transparent)]
    Snake(#[from] SnakeError),
}

/// Everything that outlives a frame.
pub struct Pipeline {
    gpu: Gpu,
    gpu_scene: GpuScene,
    scene: PatchedScene,
    visibility: Visibility,
    recent: Recent,
    packer: Packer,
    schedule: Schedule,
    light: Light,
    picture: PictureConversion,
    encoder: Box<dyn VideoEncoder>,
    known: Known,
    exposure: f32,
    has_sun: bool,
    packing_apart: bool,
    visible: Vec<VisiblePatch>,
}

impl Pipeline {
    /// A server of `scene`, by the method that it was cut for, with an atlas of `size`
    /// texels.
    ///
    /// # Errors
    /// When the atlas is impossible or does not fit the device.
    pub fn new(
        gpu: Gpu,
        gpu_scene: GpuScene,
        scene: PatchedScene,
        size: [u16; 2],
        superblock: u16,
        encoder: Box<dyn VideoEncoder>,
        exposure: f32,
    ) -> Result<Self, FrameError> {
        let visibility = Visibility::new(&gpu, &gpu_scene, &scene)?;
        let pixels = visibility.pixels();
        let recent = Recent::new(&gpu, scene.patches.len() as u32, pixels)?;
        let packer = Packer::new(&gpu, &gpu_scene, &scene, size, superblock, pixels)?;
        let light = Light::new(&gpu, &gpu_scene, size, scene.method)?;
        let picture = PictureConversion::new(&gpu, light.shown(), size, scene.method)?;
        let lasting = scene
            .patches
            .iter()
            .map(|patch| lasting(&scene.scene, patch))
            .collect();
        Ok(Self {
            has_sun: SceneFacts::of(&scene.scene).suns > 0,
            known: Known::nothing(&scene),
            schedule: Schedule::new(lasting),
            gpu,
            gpu_scene,
            scene,
            visibility,
            recent,
            packer,
            light,
            picture,
            encoder,
            exposure,
            packing_apart: false,
            visible: Vec::new(),
        })
    }

    /// The device, and the scene on it.
    #[must_use]
    pub fn gpu(&self) -> (&Gpu, &GpuScene) {
        (&self.gpu, &self.gpu_scene)
    }

    /// Radiance at the texels of the atlas before tone curve and video.
    #[must_use]
    pub fn shown(&self) -> &wgpu::Buffer {
        self.light.shown()
    }

    /// Rays traced so far.
    ///
    /// # Errors
    /// When the driver fails.
    pub fn rays(&self) -> Result<u64, GpuError> {
        self.light.rays(&self.gpu)
    }

    /// What may be seen, by the last frame.
    #[must_use]
    pub fn visible(&self) -> &[VisiblePatch] {
        &self.visible
    }

    /// Puts objects where they are at this time of the scene's own, until the next frame.
    pub fn move_objects(&mut self, scene_time: Duration) {
        let poses: Vec<Pose> = (self.scene.scene.objects.iter())
            .map(|object| object.world_from_object(scene_time))
            .collect();
        self.gpu_scene.set_poses(&self.gpu, &poses);
    }

    /// From now on light is even and no path is traced, to tell what the atlas by itself
    /// does to a picture. Before the first frame only.
    pub fn light_evenly(&mut self) {
        self.light.make_even(&self.gpu);
    }

    /// From now on what is visible is waited for before it is given slots, so that either
    /// has a time: only to tell what they cost.
    pub fn time_packing_apart(&mut self) {
        self.packing_apart = true;
    }

    /// How often stages of the light run from now on.
    pub fn set_repeats(&mut self, repeats: Repeats) {
        self.light.set_repeats(repeats);
    }

    /// The scene and its patches.
    #[must_use]
    pub fn scene(&self) -> &PatchedScene {
        &self.scene
    }

    /// Makes a frame. `clock` tells the time for the stages' durations, and
    /// nothing depends on it; it is asked at the beginning and after each stage.
    ///
    /// # Errors
    /// When the GPU or the encoder fails. What the client was to be told is
    /// then lost: the next order must ask for a reset and a new client.
    pub fn frame(
        &mut self,
        order: &FrameOrder,
        clock: &dyn Fn() -> Duration,
    ) -> Result<Frame, FrameError> {
        let mut stages = Stages::default();
        let mut since = clock();
        let mut lap = || {
            let now = clock();
            now.saturating_sub(std::mem::replace(&mut since, now))
        };
        if order.new_client {
            self.known = Known::nothing(&self.scene);
        }
        if order.reset || order.new_client {
            self.packer.force_reset();
        }
        let objects_time = order.scene_time + order.objects_lead;
        let motions: Vec<Motion> = (self.scene.scene.objects.iter())
            .map(|object| object.motion(objects_time))
            .collect();
        let poses: Vec<Pose> = motions.iter().map(|motion| motion.pose).collect();
        self.gpu_scene.set_poses(&self.gpu, &poses);

        let eye = order.prediction.eye();
        let in_objects = poses.iter().map(|pose| pose.inverse().transform_point(eye));
        let eyes: Vec<Vec3> = std::iter::once(eye).chain(in_objects).collect();
        let pixels_per_radian = order.prediction.pixels_per_radian();
        let (gpu, gpu_scene) = (&self.gpu, &self.gpu_scene);
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let viewpoints = order.prediction.viewpoints();
        let objects_after = |after| self.scene.scene.poses(order.scene_time + after);
        self.visibility
            .record(gpu, &mut encoder, gpu_scene, &viewpoints, objects_after);
        if order.new_client {
            self.recent.forget(&mut encoder);
        }
        self.recent.recall(&mut encoder);
        if self.packing_apart {
            gpu.queue.submit([encoder.finish()]);
            gpu.wait()?;
            stages.visibility = lap();
            encoder = gpu
                .device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        }
        let placed = (self.packer).place(gpu, gpu_scene, encoder, &eyes, pixels_per_radian)?;
        let spent = lap();
        if self.packing_apart {
            stages.packing = spent;
        } else {
            stages.visibility = spent;
        }

        let mut moved = placed.moved.iter().peekable();
        for placement in &placed.placements {
            let old = moved.next_if(|(patch, ..)| *patch == placement.patch);
            let resampled = old.is_some_and(|(_, old, new)| !keeps_texels(*old, *new));
            self.schedule
                .placed(placement.patch, old.is_some(), resampled);
        }
        let news = self.known.news(&self.scene, &placed.placements, &motions);
        stages.atlas = lap();

        let mut encoder = self
            .gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.light.record_moves(&self.gpu, &mut encoder, &placed)?;
        self.gpu.queue.submit([encoder.finish()]);
        let viewer = Viewer {
            eye,
            pixels_per_radian,
            exposure: self.exposure,
        };
        let paths = self.light(order.paths, &placed, &eyes, viewer)?;
        stages.light = lap();

        let mut encoder = self
            .gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.picture.record(&self.gpu, &mut encoder, self.exposure);
        let planes = self.picture.read(&self.gpu, encoder)?;
        stages.picture = lap();

        self.visible = placed.visible;
        let encoded = self.encoder.encode(&planes, placed.reset)?;
        stages.encode = lap();

        Ok(Frame {
            update: Update {
                frame: order.frame,
                epoch: placed.epoch,
                timing: order.timing,
                world_from_head: order.prediction.view.world_from_head,
                scene_time: order.scene_time.as_nanos() as u64,
                objects_lead: order.objects_lead.as_nanos() as u64,
                vertices: news.vertices,
                patches: news.patches,
                removals: placed.removals,
                placements: placed.placements,
                masks: news.masks,
                motions: news.motions,
            },
            picture: Picture {
                frame: order.frame,
                epoch: placed.epoch,
                idr: encoded.idr,
                bytes: encoded.bytes,
            },
            stats: FrameStats {
                stages,
                visible: self.visible.len() as u32,
                unplaced: placed.unplaced,
                bias: placed.bias,
                atlas: placed.stats,
                paths,
            },
        })
    }

    /// Lights what is placed with about `budget` paths, makes it to be shown, and
    /// tells how many paths it took; `eyes[n]` is the eye in the space of `ObjectId(n)`.
    fn light(
        &mut self,
        budget: u32,
        placed: &Placed,
        eyes: &[Vec3],
        viewer: Viewer,
    ) -> Result<u32, GpuError> {
        let visible = (placed.visible.iter())
            .filter_map(|visible| Some((visible.patch, visible.slot?, visible.pixels)));
        let patches = &self.scene.patches;
        let mut lit: BTreeMap<PatchId, Job> = BTreeMap::new();
        let mut paths = 0;
        let rounds = if self.light.is_even() { 0 } else { MOST_ROUNDS };
        for _ in 0..rounds {
            let left = budget.saturating_sub(paths);
            let mut jobs = self.schedule.choose(patches, visible.clone(), left, eyes);
            // A block larger than its budget gets its turn in the first round only.
            if paths > 0 && jobs.iter().map(Job::paths).sum::<u32>() > left {
                break;
            }
            jobs.truncate((self.light).trace(&self.gpu, &self.gpu_scene, &jobs, viewer));
            let traced: u32 = jobs.iter().map(Job::paths).sum();
            self.schedule.traced(&jobs);
            paths += traced;
            lit.extend(jobs.into_iter().map(|job| (job.patch(), job)));
            if traced == 0 || budget.saturating_sub(paths) <= budget / LAST_ROUND {
                break;
            }
        }
        let mut unlit: BTreeMap<PatchId, Job> = BTreeMap::new();
        let mut moved = placed.moved.iter().peekable();
        for placed in &placed.placements {
            let old = moved.next_if(|(patch, ..)| *patch == placed.patch);
            // Even light does not move along: it is made to be shown wherever it is.
            let keeps = old.is_some_and(|(_, old, new)| keeps_shown(*old, *new));
            if keeps && !self.light.is_even() {
                continue;
            }
            let job = (self.schedule).job(patches, placed.patch, placed.slot, eyes);
            unlit.insert(placed.patch, job);
        }
        if self.has_sun {
            let stale = self.schedule.stale(patches, visible, eyes);
            unlit.extend(stale.into_iter().map(|job| (job.patch(), job)));
        }
        unlit.retain(|patch, _| !lit.contains_key(patch));
        let lit: Vec<Job> = lit.into_values().collect();
        let unlit: Vec<Job> = unlit.into_values().collect();
        let qualities = (self.light).show(&self.gpu, &self.gpu_scene, &lit, &unlit, viewer)?;
        self.schedule.measured(&lit, &qualities);
        self.schedule.shown(&unlit);
        Ok(paths)
    }
}

/// What is left of a frame's paths after a round is spent on another while it is more
/// than this fraction of them: a block takes one path a texel in a round.
const LAST_ROUND: u32 = 8;
/// Rounds of a frame: more of them than this are for hardly any texels.
const MOST_ROUNDS: u32 = 16;

/// What a patch's material and place say about how long its light stays true.
fn lasting(scene: &Scene, patch: &Patch) -> Lasting {
    let triangle = &scene.triangles[patch.first_triangle as usize];
    let material: &Material = &scene.materials[triangle.material as usize];
    // A texture makes parts of the surface smoother than its factor says.
    let textured = material.metallic_roughness_texture.is_some();
    let roughness = material.roughness * if textured { 0.5 } else { 1.0 };
    Lasting {
        longest_history: if patch.object.0 == 0 {
            LONGEST_HISTORY
        } else {
            MOVING_HISTORY
        },
        point: scene.positions[triangle.positions[0] as usize],
        alpha: roughness * roughness,
        shine: material.metallic,
    }
}
