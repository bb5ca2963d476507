//! Light stays with its patch, whatever a packer does to slots: while they stay, while
//! they move because the head comes nearer, and when a reset places all of them anew.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

use glam::{IVec2, Vec3, Vec4, vec3};
use shadecast_protocol::{
    ClientTime, EyeView, Fov, FrameId, Method, PatchId, Pose, Slot, UpdateTiming, ViewReport,
    ViewSeq,
};
use shadecast_server::{
    FrameOrder, Gpu, GpuScene, Integrator, Pipeline, Prediction,
    encode::{EncodeError, EncodedPicture, Planes, VideoEncoder},
    patches::{self, PatchLimits},
    scene::{Material, Scene, SkyModel},
};
use shadecast_shaders::light::AtlasTriangle;

const ATLAS: u16 = 512;
const SUPERBLOCK: u16 = 64;
/// Squares on a side of the wall, and of their colours.
const SQUARES: u32 = 6;
/// Metres from the wall at first, and how much of it is left from frame to frame.
const FAR: f32 = 3.0;
const NEARER: f32 = 0.96;
/// Frames in which the head stands, and in which it moves.
const STILL: u32 = 4;
const MOVING: u32 = 16;
/// Of the moving ones, one with a reset.
const RESET: u32 = STILL + 9;
/// Paths of a frame while the head stands: several for each texel.
const PATHS: u32 = 60_000;
/// Samples that resampled light is worth at most: `CARRIED_WEIGHT` of carry.wgsl.
const CARRIED: f32 = 12.0;

struct NoVideo;

impl VideoEncoder for NoVideo {
    fn encode(&mut self, _: &Planes, idr: bool) -> Result<EncodedPicture, EncodeError> {
        Ok(EncodedPicture {
            bytes: Vec::new(),
            idr,
        })
    }
}

fn color(square: u32) -> Vec3 {
    let level = |n: u32| 0.2 + 0.2 * n as f32;
    vec3(
        level(square % 4),
        level(square / 4 % 3),
        level(square / 12 % 3),
    )
}

/// A wall of squares of a colour each under a white sky; no two touch.
fn wall() -> Scene {
    let mut scene = Scene {
        sky: SkyModel::constant(Vec3::ONE),
        ..Scene::default()
    };
    for square in 0..SQUARES * SQUARES {
        let material = scene.add_material(Material {
            base_color: color(square).extend(1.0),
            metallic: 0.0,
            ..Material::default()
        });
        let place = |n: u32| 0.2 * (n as f32 - 0.5 * (SQUARES - 1) as f32);
        let centre = vec3(place(square % SQUARES), place(square / SQUARES), 0.0);
        // Of many sizes, so that they ask for other levels at other times.
        let half = 0.04 + 1e-3 * square as f32;
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let corners = corners.map(|(x, y)| centre + half * vec3(x, y, 0.0));
        scene.add_quad(corners, material);
    }
    scene
}

/// What a patch's slot shows, and the samples behind its least known texel.
#[derive(Clone, Copy, Debug)]
struct Shown {
    slot: Slot,
    /// Mean over texels.
    radiance: Vec3,
    /// Of any texel from the mean.
    spread: f32,
    samples: f32,
}

/// A server, and what a client knows of it.
struct Watched {
    pipeline: Pipeline,
    slots: BTreeMap<PatchId, Slot>,
}

impl Watched {
    fn new(method: Method) -> Self {
        let gpu = Gpu::open().expect("a GPU");
        let limits = PatchLimits::for_atlas(SUPERBLOCK, 240.0);
        let scene = patches::cut_for(method, wall(), limits);
        let integrator = Integrator::with_bounces(0);
        let gpu_scene = GpuScene::new(&gpu, &scene.scene, integrator, &mut |_| ()).expect("room");
        let size = [ATLAS; 2];
        let pipeline = Pipeline::new(
            gpu,
            gpu_scene,
            scene,
            size,
            SUPERBLOCK,
            Box::new(NoVideo),
            1.0,
        );
        Self {
            pipeline: pipeline.expect("an atlas"),
            slots: BTreeMap::new(),
        }
    }

    /// A frame of a head so far from the wall: what every slot shows then.
    fn frame(&mut self, id: u32, distance: f32, paths: u32) -> BTreeMap<PatchId, Shown> {
        let eye = EyeView {
            head_from_eye: Pose::IDENTITY,
            fov: Fov::symmetric(1.0),
        };
        let view = ViewReport {
            seq: ViewSeq(id),
            sampled_at: ClientTime(0),
            display_at: ClientTime(0),
            world_from_head: Pose {
                position: vec3(0.02, -0.03, distance),
                ..Pose::IDENTITY
            },
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
            reset: id == RESET,
            new_client: id == 0,
            timing: UpdateTiming::default(),
        };
        let frame = (self.pipeline).frame(&order, &|| Duration::ZERO);
        let frame = frame.expect("a frame");
        if frame.picture.idr {
            self.slots.clear();
        }
        for patch in &frame.update.removals {
            self.slots.remove(patch);
        }
        let placements = frame.update.placements.iter();
        (self.slots).extend(placements.map(|placement| (placement.patch, placement.slot)));
        assert_eq!(self.slots.len(), self.pipeline.scene().patches.len());
        let shown = self.pipeline.shown();
        let texels: Vec<Vec4> = (self.pipeline.gpu().0)
            .read(shown, 0..shown.size())
            .expect("light");
        let slots = self.slots.iter();
        slots
            .map(|(patch, slot)| (*patch, shown_in(*slot, &texels)))
            .collect()
    }

    fn color_of(&self, patch: PatchId) -> Vec3 {
        let scene = self.pipeline.scene();
        let first = scene.patches[patch.0 as usize].first_triangle;
        color(scene.scene.triangles[first as usize].material)
    }
}

fn shown_in(slot: Slot, texels: &[Vec4]) -> Shown {
    let bounds = slot.bounds();
    let triangle = match slot {
        Slot::Block(_) => None,
        Slot::Triangle(slot) => Some(AtlasTriangle::new(slot.corners, slot.weights)),
    };
    let all = (0..bounds.height).flat_map(|y| (0..bounds.width).map(move |x| (x, y)));
    let own: Vec<Vec4> = all
        .filter(|(x, y)| triangle.is_none_or(|t| t.owns(IVec2::new(*x as i32, *y as i32))))
        .map(|(x, y)| texels[((bounds.y + y) * u32::from(ATLAS) + bounds.x + x) as usize])
        .collect();
    let radiance = own.iter().sum::<Vec4>().truncate() / own.len() as f32;
    Shown {
        slot,
        radiance,
        spread: (own.iter())
            .map(|texel| (texel.truncate() - radiance).abs().max_element())
            .fold(0.0, f32::max),
        samples: own
            .iter()
            .map(|texel| texel.w)
            .fold(f32::INFINITY, f32::min),
    }
}

/// Stands, then comes nearer without a single new path; `check` sees each patch before
/// and after each moving frame.
fn walk(watched: &mut Watched, paths: u32, check: impl Fn(&Watched, PatchId, Shown, Shown)) {
    let mut before = BTreeMap::new();
    for id in 0..STILL {
        before = watched.frame(id, FAR, paths);
    }
    let mut moved = BTreeSet::new();
    let mut distance = FAR;
    for id in STILL..STILL + MOVING {
        distance *= NEARER;
        let after = watched.frame(id, distance, 0);
        for (patch, now) in &after {
            let then = before[patch];
            if then.slot != now.slot {
                moved.insert(*patch);
            }
            check(watched, *patch, then, *now);
        }
        before = after;
    }
    assert!(moved.len() * 2 > before.len(), "only {} move", moved.len());
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn even_light_is_shown_wherever_slots_are() {
    for method in Method::ALL {
        let mut watched = Watched::new(method);
        watched.pipeline.light_evenly();
        walk(&mut watched, 0, |watched, patch, then, now| {
            let expected = watched.color_of(patch);
            for shown in [then, now] {
                assert!(
                    shown.radiance.abs_diff_eq(expected, 0.02) && shown.spread < 0.02,
                    "{method:?} {patch:?}: {expected} {shown:?}"
                );
            }
        });
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn accumulated_light_goes_where_slots_go() {
    for method in Method::ALL {
        let mut watched = Watched::new(method);
        walk(&mut watched, PATHS, |watched, patch, then, now| {
            let stays = then.slot == now.slot;
            let least = if stays {
                then.samples
            } else {
                then.samples.min(CARRIED)
            };
            assert!(
                now.samples >= 1.0 && now.samples > least - 0.01,
                "{method:?} {patch:?}: {then:?} {now:?}"
            );
            assert!(
                now.radiance.abs_diff_eq(then.radiance, 0.03),
                "{method:?} {patch:?}: {then:?} {now:?}"
            );
            let expected = watched.color_of(patch);
            assert!(
                now.radiance.abs_diff_eq(expected, 0.1),
                "{method:?} {patch:?}: {expected} {now:?}"
            );
        });
    }
}
