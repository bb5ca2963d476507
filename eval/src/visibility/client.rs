//! What a client would not have when it draws.
//!
//! A server makes 30 updates a second from what was reported until then; a client
//! shows each from one latency after its report on, in three pictures for each eye, at
//! the head's true poses. A pixel is missing where the patch that it should show is in
//! no block of the atlas: the very passes of the server find and place the visible set,
//! so what memory takes away is missing too. Beside it stands what would be missing
//! were patches kept for some updates after they were last seen, and no more.

use std::time::Duration;

use anyhow::Result;
use glam::Vec3;
use serde::Serialize;
use shadecast_protocol::{EyeView, PatchId, Pose};
use shadecast_server::{
    atlas::{Atlas, AtlasShape, Footprints},
    prediction::{Horizon, PredictedHead, Prediction, Viewpoint, corners, enlargement},
};

use super::{
    predict::{Known, Predictor},
    seer::{SUPERBLOCK, Seer, eyes_of},
    trace::{Gait, Head, RATE},
};
use crate::report::{Spent, timed};

/// Pictures of the client between two updates.
const TICKS: u32 = 3;
/// Side of the atlas, texels.
const ATLAS: u16 = 1024;
/// Updates for which patches may be kept after they were last seen.
const LIFETIMES: [u32; 5] = [0, 1, 3, 9, 30];
/// The first updates fill the atlas and are not counted.
const WARM_UP: u32 = 6;

/// From where patches are looked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Policy {
    pub(super) name: &'static str,
    pub(super) predictor: Predictor,
    heads: Heads,
    margin: Margin,
    corners: Corners,
}

/// When heads are sampled.
#[derive(Clone, Copy, Debug)]
enum Heads {
    /// Only the newest reported one.
    Reported,
    /// Each 33 ms from the report on until the next update: SAS 2018, section 5.
    FromReport,
    /// While the update is on display, and so many.
    OnDisplay(u32),
}

/// How much larger image planes are.
#[derive(Clone, Copy, Debug)]
enum Margin {
    Factor(f32),
    /// By so many times what the filter doubts.
    Doubt(f32),
}

/// Viewpoints at the corners about the last head.
#[derive(Clone, Copy, Debug)]
enum Corners {
    None,
    /// Beside its eyes, so many times what the filter doubts aside.
    Beside(f32),
    /// In place of its eyes.
    Instead(f32),
    /// Two at either end of a diagonal in place of each head's eyes, on the other
    /// diagonal for every second head.
    Shared(f32),
}

const fn policy(
    name: &'static str,
    predictor: Predictor,
    heads: Heads,
    margin: Margin,
    corners: Corners,
) -> Policy {
    Policy {
        name,
        predictor,
        heads,
        margin,
        corners,
    }
}

/// What the server does.
pub(super) const SERVED: Policy = policy(
    "served",
    Predictor::Kalman,
    Heads::OnDisplay(2),
    Margin::Doubt(1.0),
    Corners::Shared(1.0),
);

/// What is compared at every gait: the same with other predictors.
pub(super) const PREDICTORS: [Policy; 4] = [
    policy(
        "reported head only, 1.2 times as wide",
        Predictor::None,
        Heads::Reported,
        Margin::Factor(1.2),
        Corners::None,
    ),
    policy(
        "linear, from the report on, 1.2 times as wide (SAS)",
        Predictor::Linear,
        Heads::FromReport,
        Margin::Factor(1.2),
        Corners::None,
    ),
    Policy {
        name: "linear, otherwise as served",
        predictor: Predictor::Linear,
        ..SERVED
    },
    Policy {
        name: "reference, otherwise as served",
        predictor: Predictor::Reference,
        ..SERVED
    },
];

/// The choices of the server one by one.
pub(super) const CHOICES: [Policy; 10] = [
    Policy {
        name: "from the report on",
        heads: Heads::FromReport,
        ..SERVED
    },
    Policy {
        name: "one head",
        heads: Heads::OnDisplay(1),
        ..SERVED
    },
    Policy {
        name: "three heads",
        heads: Heads::OnDisplay(3),
        ..SERVED
    },
    Policy {
        name: "no corners",
        corners: Corners::None,
        ..SERVED
    },
    Policy {
        name: "corners beside the eyes",
        corners: Corners::Beside(1.0),
        ..SERVED
    },
    Policy {
        name: "corners in place of the last eyes",
        corners: Corners::Instead(1.0),
        ..SERVED
    },
    Policy {
        name: "corners twice as far",
        corners: Corners::Shared(2.0),
        ..SERVED
    },
    Policy {
        name: "eyes' own image plane",
        margin: Margin::Factor(1.0),
        ..SERVED
    },
    Policy {
        name: "image plane 1.2 times as wide",
        margin: Margin::Factor(1.2),
        ..SERVED
    },
    Policy {
        name: "half the margin",
        margin: Margin::Doubt(0.5),
        ..SERVED
    },
];

impl Policy {
    /// The viewpoints of an update that is on display over `horizon` after `known`'s
    /// report, in times since then.
    fn viewpoints(&self, known: &Known, horizon: Horizon) -> Prepared {
        let (horizon, count) = match self.heads {
            Heads::Reported => (
                Horizon {
                    shown: Duration::ZERO,
                    gone: Duration::ZERO,
                },
                1,
            ),
            Heads::FromReport => {
                let whole = Horizon {
                    shown: Duration::ZERO,
                    ..horizon
                };
                (whole, whole.steps(u32::MAX))
            }
            Heads::OnDisplay(count) => (horizon, count),
        };
        let heads = horizon.samples(count).map(|after| {
            let (world_from_head, doubt) = known.predicted(self.predictor, after);
            PredictedHead {
                after,
                world_from_head,
                doubt,
            }
        });
        let prediction = Prediction {
            heads: heads.collect(),
            view: known.view,
        };
        let mut viewpoints = Vec::new();
        let last = prediction.heads.len() - 1;
        for (index, head) in prediction.heads.iter().enumerate() {
            let eyes = prediction.view.eyes;
            let aside = |factor: f32| corners(eyes, factor * head.doubt.metres);
            let eyes: Vec<EyeView> = match self.corners {
                Corners::Beside(factor) if index == last => {
                    aside(factor).into_iter().chain(eyes).collect()
                }
                Corners::Instead(factor) if index == last => aside(factor).into(),
                Corners::Shared(factor) => {
                    let [a, b, c, d] = aside(factor);
                    if index % 2 == 0 {
                        vec![a, d]
                    } else {
                        vec![c, b]
                    }
                }
                _ => eyes.into(),
            };
            viewpoints.extend(eyes.into_iter().map(|eye| {
                let enlargement = match self.margin {
                    Margin::Factor(factor) => factor,
                    Margin::Doubt(factor) => enlargement(eye.fov, factor * head.doubt.radians),
                };
                Viewpoint::new(
                    head.after,
                    head.world_from_head,
                    eye,
                    &known.view,
                    enlargement,
                )
            }));
        }
        Prepared {
            eye: prediction.eye(),
            pixels_per_radian: prediction.pixels_per_radian(),
            viewpoints,
        }
    }
}

struct Prepared {
    eye: Vec3,
    pixels_per_radian: f32,
    viewpoints: Vec<Viewpoint>,
}

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
    /// Were patches kept for so many updates.
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

#[cfg(test)]
mod tests {
    use shadecast_server::scene::courtyard;

    use super::{super::trace::WALK, *};

    #[test]
    fn what_is_called_served_is_what_the_server_does() {
        let head = Head::new(&courtyard(10_000), WALK, 5, 4.0);
        let mut known = Known::first(&head, 64);
        known.hear_until(200);
        let horizon = Horizon {
            shown: Duration::from_millis(60),
            gone: Duration::from_millis(93),
        };
        let prediction =
            Prediction::filtered(&known.view, &known.filter, Duration::ZERO, horizon, 8);
        let found = SERVED.viewpoints(&known, horizon).viewpoints;
        assert_eq!(found, prediction.viewpoints());
    }
}
