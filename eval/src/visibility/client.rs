//! What a client would not have when it draws.
//!
//! A server makes 30 updates a second from what was reported until then; a client
//! shows each from one latency after its report on, in three pictures for each eye, at
//! the head's true poses. A pixel is missing where the patch that it should show is in
//! no block of the atlas: the very passes of the server find and place the visible set,
//! so what memory takes away is missing too. Beside it stands what would be missing
//! were patches kept for some updates after they were last in that set, and no more.

use std::time::Duration;

use anyhow::Result;
use glam::Vec3;
use serde::Serialize;
use shadecast_protocol::{PatchId, Pose};
use shadecast_server::{
    Recent,
    atlas::{Atlas, AtlasShape, Footprints},
    prediction::Horizon,
};

use super::{
    policy::{Policy, Prepared},
    predict::Known,
    seer::{SUPERBLOCK, Seer, eyes_of},
    trace::{Gait, Head, RATE},
};
use crate::report::{Spent, timed};

/// Pictures of the client between two updates.
const TICKS: u32 = 3;
/// Side of the atlas, texels.
const ATLAS: u16 = 1024;
/// Updates for which patches may be kept after they were last in the visible set.
const LIFETIMES: [u32; 5] = [0, 1, 3, 9, 30];
/// The first updates fill the atlas and are not counted.
const WARM_UP: u32 = 6;

/// A line of `visibility-missing.csv`: means over the updates of a trace. Pixels are
/// shares of the picture.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    pub(super) scene: String,
    pub(super) triangles: usize,
    pub(super) gait: &'static str,
    pub(super) metres_per_second: f64,
    pub(super) policy: &'static str,
    pub(super) predictor: &'static str,
    /// From the sampling of a pose to the first picture of its update.
    pub(super) latency_ms: f64,
    pub(super) updates: u32,
    /// Of the client, in which pixels were counted.
    pub(super) pictures: u32,
    pub(super) pictures_per_update: f64,
    pub(super) update_ms: f64,
    pub(super) update_cpu_ms: f64,
    pub(super) visible_patches: f64,
    pub(super) coverage: f64,
    pub(super) overestimation: f64,
    /// With the atlas as it is.
    pub(super) missing: f64,
    /// In the worst picture.
    pub(super) most_missing: f64,
    /// Were patches kept for so many updates after they were last in the visible set.
    pub(super) missing_kept_0: f64,
    pub(super) missing_kept_1: f64,
    pub(super) missing_kept_3: f64,
    pub(super) missing_kept_9: f64,
    pub(super) missing_kept_30: f64,
    pub(super) resets: u32,
}

/// What both eyes of the true head see at each tick, as patches and their pixels.
pub(super) struct Truth {
    ticks: Vec<Vec<(u32, u32)>>,
    /// Of both eyes' pictures.
    pixels: f64,
}

impl Truth {
    pub(super) fn of(
        seer: &mut Seer,
        head: &Head,
        side: u16,
        ticks: u32,
        done: impl Fn(f32),
    ) -> Result<Self> {
        let view = head.report(0, side);
        let ticks = (0..ticks)
            .map(|tick| {
                done(tick as f32 / ticks as f32);
                let seconds = f64::from(tick) / f64::from(RATE);
                let eyes = eyes_of(&view, head.pose(seconds), Duration::ZERO, 1.0);
                let pixels = seer.seen(&eyes, Duration::from_secs_f64(seconds))?;
                let seen = (0..).zip(pixels).filter(|(_, pixels)| *pixels > 0);
                Ok(seen.collect())
            })
            .collect::<Result<_>>()?;
        Ok(Self {
            ticks,
            pixels: 2.0 * f64::from(side).powi(2),
        })
    }
}

/// Updates along a trace under a policy.
pub(super) fn measure(
    seer: &mut Seer,
    name: &str,
    (head, gait): (&Head, Gait),
    truth: &Truth,
    side: u16,
    policy: Policy,
    latency: u32,
) -> Result<Row> {
    let mut row = Row {
        scene: name.to_owned(),
        triangles: seer.scene.scene.triangles.len(),
        gait: gait.name,
        metres_per_second: gait.speed,
        policy: policy.name,
        predictor: policy.predictor.name(),
        latency_ms: f64::from(latency) * 1e3 / f64::from(RATE),
        updates: 0,
        pictures: 0,
        pictures_per_update: 0.0,
        update_ms: 0.0,
        update_cpu_ms: 0.0,
        visible_patches: 0.0,
        coverage: 0.0,
        overestimation: 0.0,
        missing: 0.0,
        most_missing: 0.0,
        missing_kept_0: 0.0,
        missing_kept_1: 0.0,
        missing_kept_3: 0.0,
        missing_kept_9: 0.0,
        missing_kept_30: 0.0,
        resets: 0,
    };
    let mut server = Server::new(seer)?;
    let mut known = Known::first(head, side);
    let mut kept = [0.0; LIFETIMES.len()];
    let mut spent = Spent::default();
    let tick = |ticks: u32| Duration::from_secs(1) * ticks / RATE;
    for update in 0.. {
        let first = update * TICKS + latency;
        if (first + TICKS) as usize > truth.ticks.len() {
            break;
        }
        known.hear_until(update * TICKS);
        let horizon = Horizon {
            shown: tick(latency),
            gone: tick(latency + TICKS),
        };
        let prepared = policy.viewpoints(&known, horizon);
        let pictures = prepared.viewpoints.len();
        let reported = Duration::from_secs_f64(known.seconds());
        let made = server.update(seer, prepared, reported, update)?;
        if update < WARM_UP {
            continue;
        }
        let shown = &truth.ticks[first as usize..(first + TICKS) as usize];
        row.updates += 1;
        row.pictures_per_update += pictures as f64;
        row.visible_patches += f64::from(made.visible);
        spent += made.spent;
        for seen in shown {
            let missing = |held: &dyn Fn(u32) -> bool| {
                let absent = seen.iter().filter(|(patch, _)| !held(*patch));
                absent.map(|(_, pixels)| f64::from(*pixels)).sum::<f64>() / truth.pixels
            };
            let in_atlas = missing(&|patch| server.placed[patch as usize]);
            row.pictures += 1;
            row.missing += in_atlas;
            row.most_missing = row.most_missing.max(in_atlas);
            for (kept, lifetime) in kept.iter_mut().zip(LIFETIMES) {
                *kept += missing(&|patch| {
                    server.last_seen[patch as usize].is_some_and(|last| update - last <= lifetime)
                });
            }
        }
        let middle = horizon.middle();
        let eye = known.truth(middle).position;
        let (coverage, overestimation) = server.rates(seer, shown, eye, reported + middle, update);
        row.coverage += coverage;
        row.overestimation += overestimation;
    }
    let updates = f64::from(row.updates.max(1));
    let pictures = f64::from(row.pictures.max(1));
    let spent = spent / row.updates.max(1);
    let kept = kept.map(|missing| missing / pictures);
    Ok(Row {
        pictures_per_update: row.pictures_per_update / updates,
        update_ms: spent.wall.as_secs_f64() * 1e3,
        update_cpu_ms: spent.cpu.as_secs_f64() * 1e3,
        visible_patches: row.visible_patches / updates,
        coverage: row.coverage / updates,
        overestimation: row.overestimation / updates,
        missing: row.missing / pictures,
        missing_kept_0: kept[0],
        missing_kept_1: kept[1],
        missing_kept_3: kept[2],
        missing_kept_9: kept[3],
        missing_kept_30: kept[4],
        resets: server.resets,
        ..row
    })
}

/// The first half of the server's frame, and what the client knows of it.
struct Server {
    recent: Recent,
    atlas: Atlas,
    footprints: Footprints,
    /// By patch.
    placed: Vec<bool>,
    /// The last update in whose visible set it was.
    last_seen: Vec<Option<u32>>,
    resets: u32,
}

/// What an update took.
struct Made {
    visible: u32,
    spent: Spent,
}

impl Server {
    fn new(seer: &Seer) -> Result<Self> {
        let shape = AtlasShape::new([ATLAS; 2], SUPERBLOCK)?;
        let patches = seer.scene.patches.len();
        let pixels = seer.visibility.pixels();
        let atlas = Atlas::new(&seer.gpu, shape, patches as u32, pixels)?;
        let footprints = Footprints::new(
            &seer.gpu,
            &seer.gpu_scene,
            &seer.scene,
            pixels,
            atlas.wishes(),
        )?;
        Ok(Self {
            recent: Recent::new(&seer.gpu, patches as u32, pixels)?,
            atlas,
            footprints,
            placed: vec![false; patches],
            last_seen: vec![None; patches],
            resets: 0,
        })
    }

    fn update(
        &mut self,
        seer: &mut Seer,
        prepared: Prepared,
        time: Duration,
        update: u32,
    ) -> Result<Made> {
        let middle = prepared.viewpoints[prepared.viewpoints.len() / 2].after;
        let objects = seer.scene.scene.poses(time + middle);
        let in_objects = objects
            .iter()
            .map(|pose: &Pose| pose.inverse().transform_point(prepared.eye));
        let eyes: Vec<Vec3> = std::iter::once(prepared.eye).chain(in_objects).collect();
        let (placed, spent) = timed(|| {
            let mut encoder = seer
                .gpu
                .device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            seer.record(&mut encoder, &prepared.viewpoints, time);
            if prepared.recalls {
                self.recent.recall(&mut encoder);
            }
            let (gpu, gpu_scene) = (&seer.gpu, &seer.gpu_scene);
            let density = prepared.pixels_per_radian;
            self.footprints
                .record(gpu, &mut encoder, gpu_scene, &eyes, density);
            Ok(self.atlas.place(gpu, encoder)?)
        })?;
        if placed.reset {
            self.placed.fill(false);
        }
        for PatchId(patch) in &placed.removals {
            self.placed[*patch as usize] = false;
        }
        for placement in &placed.placements {
            self.placed[placement.patch.0 as usize] = true;
        }
        for visible in &placed.visible {
            self.last_seen[visible.patch.0 as usize] = Some(update);
        }
        self.resets = placed.stats.resets;
        Ok(Made {
            visible: placed.visible.len() as u32,
            spent,
        })
    }

    /// Coverage and overestimation of the update's visible set against what is shown
    /// of it, by areas as seen from `eye`.
    fn rates(
        &self,
        seer: &Seer,
        shown: &[Vec<(u32, u32)>],
        eye: Vec3,
        time: Duration,
        update: u32,
    ) -> (f64, f64) {
        let mut truth = vec![false; self.placed.len()];
        for (patch, _) in shown.iter().flatten() {
            truth[*patch as usize] = true;
        }
        let found = |patch: usize| self.last_seen[patch] == Some(update);
        let either = (0..truth.len()).filter(|&patch| truth[patch] || found(patch));
        let (mut v, mut missed, mut needless) = (0.0, 0.0, 0.0);
        for (patch, area) in seer.areas(eye, time, either) {
            match (truth[patch], found(patch)) {
                (true, true) => v += area,
                (true, false) => {
                    v += area;
                    missed += area;
                }
                _ => needless += area,
            }
        }
        if v > 0.0 {
            (1.0 - missed / v, needless / v)
        } else {
            (1.0, 0.0)
        }
    }
}
