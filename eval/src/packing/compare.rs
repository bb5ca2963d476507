//! The packers beside each other, along the same walk: what they waste, what they
//! move, what that costs in video, and how what a client shows of their atlas differs
//! from the truth, at once and some time later.
//!
//! Light is even and has no noise (`even.wgsl`): what differs is the packers' doing.
//! Levels are chosen as for a picture of 1920 x 1080 pixels at 90 degrees, and
//! pictures are square windows of as many pixels a radian.
//!
//! Sources: SAS 2018, sections 5 to 5.6; SnakeBinning (Hladky et al., 2021), section 5.

use std::{
    collections::{BTreeMap, btree_map::Entry},
    time::Duration,
};

use anyhow::Result;
use glam::{Quat, Vec3};
use image::{Rgb, RgbImage};
use serde::Serialize;
use shadecast_protocol::{Fov, Method, PatchId, PatchShape, Pose, Slot};
use shadecast_server::{
    encode::{OpenH264, VideoEncoder},
    scene::Scene,
    still::Still,
};

use super::{culling::Objects, stage, trace};
use crate::{
    flip,
    ours::even::{self, Even, Look, Made, PIXELS_PER_RADIAN, time_of},
    progress::Progress,
    ssim,
};

/// From when an atlas was made to when a client looks at it, milliseconds.
pub(super) const LATENCIES: [u32; 4] = [0, 33, 66, 100];
/// Pixels of a window on a side.
const WINDOW: u32 = 160;
/// Frames of the walk.
const FRAMES: u32 = 60;
const QUICK_FRAMES: u32 = 8;
/// Of these, those whose pictures are compared: so many or more, where there are.
const COMPARED: u32 = 6;
const QUICK_COMPARED: u32 = 2;
/// Within this field windows lie, across and up, radians.
const WIDEST_LOOK: [f32; 2] = [1.2, 0.6];
/// Quantisation parameter of the video: that of good television.
const QUALITY: u8 = 26;

/// A line of `packing.csv`: a frame, seen so long after it was made. Texels are of the
/// whole atlas; frames that are not looked at say nothing of pictures.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    pub(super) scene: String,
    pub(super) triangles: usize,
    pub(super) packer: &'static str,
    pub(super) atlas_mpix: f64,
    pub(super) latency_ms: u32,
    pub(super) frame: u32,
    /// Patches, or triangles where those are what is placed.
    pub(super) visible: u32,
    pub(super) unplaced: u32,
    pub(super) bias: f32,
    /// By the pixels that visible surfaces would cover, were nothing before them.
    pub(super) asked_texels: f64,
    /// The same, had whole objects been culled instead.
    pub(super) culled_texels: f64,
    pub(super) placed_texels: u64,
    /// Within the footprint of a visible triangle.
    pub(super) useful_texels: f64,
    /// Within that of one that is no longer visible and keeps its slot.
    pub(super) kept_texels: f64,
    /// Between triangles and the borders of their slots.
    pub(super) inset_texels: f64,
    /// Halves of rectangles that hold a single triangle.
    pub(super) empty_half_texels: f64,
    pub(super) stacked_texels: u64,
    pub(super) tail_texels: u64,
    pub(super) free_texels: u64,
    /// Had a slot, and have another one now.
    pub(super) moved: u32,
    pub(super) placed_anew: u32,
    pub(super) reset: bool,
    pub(super) out_of_memory: bool,
    pub(super) visibility_ms: f64,
    pub(super) packing_ms: f64,
    pub(super) packing_cpu_ms: f64,
    pub(super) news_ms: f64,
    pub(super) shading_ms: f64,
    pub(super) picture_ms: f64,
    pub(super) frame_ms: f64,
    pub(super) frame_cpu_ms: f64,
    pub(super) video_bytes: usize,
    /// Share of the window's pixels whose patch has no slot.
    pub(super) missing: Option<f64>,
    pub(super) ssim: Option<f64>,
    pub(super) flip: Option<f64>,
    /// Texels of a pixel: quantiles, and the share of pixels within half and twice.
    pub(super) density_5: Option<f64>,
    pub(super) density_50: Option<f64>,
    pub(super) density_95: Option<f64>,
    pub(super) within_factor_2: Option<f64>,
}

/// What was found of a scene.
pub(super) struct Compared {
    pub(super) rows: Vec<Row>,
    pub(super) stages: Vec<stage::Row>,
    /// Pixels by log2 of their texels, in steps of a quarter, by packer and atlas.
    pub(super) densities: BTreeMap<(&'static str, u64), Vec<u32>>,
    /// The truth and each packer's window at the last compared frame, and below it how
    /// many texels its pixels have: all at the middle atlas size.
    pub(super) strip: Vec<RgbImage>,
    pub(super) adapter: String,
}

/// Of the histogram: from 2^-4 to 2^4 texels a pixel.
pub(super) const DENSITY_BINS: usize = 33;

/// A window that the client would show.
struct Window {
    view: (Pose, [f32; 4]),
    time: Duration,
    truth: Still,
}

pub(super) fn measure(
    name: &str,
    scene: &Scene,
    sizes: &[[u16; 2]],
    (quick, frames): (bool, Option<u32>),
    progress: &Progress,
) -> Result<Compared> {
    let (usual, compared) = if quick {
        (QUICK_FRAMES, QUICK_COMPARED)
    } else {
        (FRAMES, COMPARED)
    };
    let frames = frames.unwrap_or(usual);
    let step = (frames / compared).max(1);
    let mut found = Compared {
        rows: Vec::new(),
        stages: Vec::new(),
        densities: BTreeMap::new(),
        strip: Vec::new(),
        adapter: String::new(),
    };
    let mut windows: BTreeMap<(u32, u32), Window> = BTreeMap::new();
    for (at, size) in sizes.iter().enumerate() {
        for method in Method::ALL {
            let mpix = mpix_of(*size);
            progress.step(&format!("{name}: {}, {mpix:.0} MPix", method.name()));
            let mut walk = Walk::new(name, scene, method, *size)?;
            walk.even.adapter().clone_into(&mut found.adapter);
            for frame in 0..frames {
                progress.within(frame as f32 / frames as f32);
                let mut row = walk.frame(scene, frame)?;
                if frame % step != step - 1 {
                    found.rows.push(row);
                    continue;
                }
                for latency in LATENCIES {
                    let window = match windows.entry((frame, latency)) {
                        Entry::Occupied(known) => known.into_mut(),
                        Entry::Vacant(place) => {
                            place.insert(window_of(&mut walk.even, scene, frame, latency)?)
                        }
                    };
                    let is_last = frame + step >= frames && latency == LATENCIES[0];
                    let strip = (is_last && at == sizes.len() / 2).then_some(&mut found.strip);
                    let key = (method.name(), walk.even.texels());
                    let bins = found.densities.entry(key);
                    let bins = bins.or_insert_with(|| vec![0; DENSITY_BINS]);
                    row.latency_ms = latency;
                    look(&mut walk.even, window, &mut row, bins, strip)?;
                    found.rows.push(row.clone());
                }
            }
            drop(walk);
            // The light's time grows with texels and a packer's with patches: its share is
            // largest in the smallest atlas.
            if at > 0 {
                continue;
            }
            let texels = found.rows.last().map_or(0, |row| row.placed_texels);
            let row = stage::measure(name, scene, method, *size, texels, quick)?;
            found.stages.push(row);
        }
    }
    Ok(found)
}

/// A packer on its way through a scene.
struct Walk<'a> {
    name: &'a str,
    method: Method,
    mpix: f64,
    even: Even,
    objects: Objects,
    slots: BTreeMap<PatchId, Slot>,
    video: OpenH264,
}

impl<'a> Walk<'a> {
    fn new(name: &'a str, scene: &Scene, method: Method, size: [u16; 2]) -> Result<Self> {
        let even = Even::new(scene, method, size)?;
        Ok(Self {
            name,
            method,
            mpix: mpix_of(size),
            objects: Objects::of(&even.scene().scene),
            even,
            slots: BTreeMap::new(),
            video: OpenH264::of_quality(QUALITY)?,
        })
    }

    /// The next frame, not looked at yet.
    fn frame(&mut self, scene: &Scene, frame: u32) -> Result<Row> {
        let made = (self.even).frame(&|seconds| trace::head(scene, seconds), frame)?;
        let idr = made.frame.picture.idr;
        let picture = match self.even.planes() {
            Some(planes) => self.video.encode(&planes, idr)?.bytes,
            None => Vec::new(),
        };
        Ok(Row {
            video_bytes: picture.len(),
            ..self.row(frame, &made)
        })
    }

    fn row(&mut self, frame: u32, made: &Made) -> Row {
        let update = &made.frame.update;
        let stats = &made.frame.stats;
        let before = std::mem::take(&mut self.slots);
        let reset = made.frame.picture.idr;
        if !reset {
            self.slots.clone_from(&before);
        }
        for patch in &update.removals {
            self.slots.remove(patch);
        }
        (self.slots).extend(update.placements.iter().map(|p| (p.patch, p.slot)));
        let moved = (update.placements.iter())
            .filter(|p| before.get(&p.patch).is_some_and(|slot| *slot != p.slot))
            .count() as u32;
        let anew = (update.placements.iter())
            .filter(|p| !before.contains_key(&p.patch))
            .count() as u32;
        let uses = uses_of(
            &self.even,
            &self.objects,
            &self.slots,
            update.world_from_head,
            frame,
        );
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        let atlas = &stats.atlas;
        Row {
            scene: self.name.to_owned(),
            triangles: self.even.scene().scene.triangles.len(),
            packer: self.method.name(),
            atlas_mpix: self.mpix,
            latency_ms: 0,
            frame,
            visible: stats.visible,
            unplaced: stats.unplaced,
            bias: stats.bias,
            asked_texels: uses.asked,
            culled_texels: uses.culled,
            placed_texels: atlas.used_texels,
            useful_texels: uses.useful,
            kept_texels: uses.kept,
            inset_texels: atlas.used_texels as f64 - uses.useful - uses.kept - uses.empty_halves,
            empty_half_texels: uses.empty_halves,
            stacked_texels: atlas.stacked_texels,
            tail_texels: atlas.tail_texels,
            free_texels: atlas
                .texels
                .saturating_sub(atlas.used_texels + atlas.stacked_texels + atlas.tail_texels),
            moved,
            placed_anew: anew,
            reset,
            out_of_memory: stats.unplaced > 0,
            visibility_ms: ms(stats.stages.visibility),
            packing_ms: ms(made.packing.wall),
            packing_cpu_ms: ms(made.packing.cpu),
            news_ms: ms(stats.stages.atlas),
            shading_ms: ms(stats.stages.light),
            picture_ms: ms(stats.stages.picture),
            frame_ms: ms(made.spent.wall),
            frame_cpu_ms: ms(made.spent.cpu),
            video_bytes: 0,
            missing: None,
            ssim: None,
            flip: None,
            density_5: None,
            density_50: None,
            density_95: None,
            within_factor_2: None,
        }
    }
}

fn mpix_of(size: [u16; 2]) -> f64 {
    f64::from(size[0]) * f64::from(size[1]) / f64::from(1 << 20)
}

/// Texels by what they are for.
#[derive(Clone, Copy, Debug, Default)]
struct Uses {
    asked: f64,
    culled: f64,
    useful: f64,
    kept: f64,
    empty_halves: f64,
}

fn uses_of(
    even: &Even,
    objects: &Objects,
    slots: &BTreeMap<PatchId, Slot>,
    head: Pose,
    frame: u32,
) -> Uses {
    let scene = even.scene();
    let from_world: Vec<Pose> = std::iter::once(Pose::IDENTITY)
        .chain((scene.scene.objects.iter()).map(|o| o.world_from_object(time_of(frame))))
        .map(|pose| pose.inverse())
        .collect();
    let mut uses = Uses::default();
    let mut visible = even.visible().iter().peekable();
    for (id, slot) in slots {
        let patch = &scene.patches[id.0 as usize];
        while visible.next_if(|seen| seen.patch < *id).is_some() {}
        let is_visible = visible.next_if(|seen| seen.patch == *id).is_some();
        let (inside, empty_half) = match slot {
            Slot::Block(block) => {
                let (width, height) = block.level.size();
                let inside = f64::from(width - 1) * f64::from(height - 1);
                match patch.shape {
                    PatchShape::Solo => (inside * 0.5, inside * 0.5),
                    PatchShape::Pair | PatchShape::Triple => (inside, 0.0),
                }
            }
            Slot::Triangle(slot) => {
                let [a, b, c] = slot.corners.map(|corner| corner.map(f64::from));
                let doubled = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
                // Corners are in eighths of a texel.
                (doubled.abs() * 0.5 / 64.0, 0.0)
            }
        };
        uses.empty_halves += empty_half;
        if !is_visible {
            uses.kept += inside;
            continue;
        }
        uses.useful += inside;
        let eye = from_world[usize::from(patch.object.0)].transform_point(head.position);
        let corner = |index: usize| scene.scene.positions[patch.corners[index] as usize] - eye;
        for triangle in patch.shape.triangles() {
            uses.asked += solid_angle(triangle.map(corner));
        }
    }
    uses.culled = objects.asked(head, even::TANGENTS, &from_world, solid_angle);
    let pixels = f64::from(PIXELS_PER_RADIAN).powi(2);
    uses.asked *= pixels;
    uses.culled *= pixels;
    uses
}

/// Of a triangle with corners at these places from the eye, steradians. Source: van
/// Oosterom and Strackee, "The Solid Angle of a Plane Triangle", 1983.
fn solid_angle([a, b, c]: [Vec3; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(glam::Vec3::as_dvec3);
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let above = a.dot(b.cross(c)).abs();
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * above.atan2(below)
}

fn window_of(even: &mut Even, scene: &Scene, frame: u32, latency: u32) -> Result<Window> {
    let time = time_of(frame) + Duration::from_millis(latency.into());
    let head = trace::head(scene, time.as_secs_f32());
    // Each frame looks elsewhere within the picture, and all latencies alike.
    let place = |base: u32| {
        let (mut n, mut scale, mut sum) = (frame + 1, 1.0, 0.0);
        while n > 0 {
            scale /= base as f32;
            sum += (n % base) as f32 * scale;
            n /= base;
        }
        sum - 0.5
    };
    let turn = Quat::from_rotation_y(place(2) * WIDEST_LOOK[0])
        * Quat::from_rotation_x(place(3) * WIDEST_LOOK[1]);
    let fov = Fov::symmetric(WINDOW as f32 / PIXELS_PER_RADIAN);
    let pose = Pose {
        orientation: head.orientation * turn,
        ..head
    };
    let view = (pose, [fov.left, fov.right, fov.up, fov.down].map(f32::tan));
    Ok(Window {
        truth: still(even.look(Look::Even, time, view, [WINDOW; 2])?),
        view,
        time,
    })
}

fn still(pixels: Vec<[f32; 4]>) -> Still {
    Still {
        width: WINDOW,
        height: WINDOW,
        radiance: (pixels.into_iter())
            .map(|[r, g, b, _]| Vec3::new(r, g, b))
            .collect(),
    }
}

/// Looks at the atlas through `window`.
fn look(
    even: &mut Even,
    window: &Window,
    row: &mut Row,
    bins: &mut [u32],
    strip: Option<&mut Vec<RgbImage>>,
) -> Result<()> {
    let seen = still(even.look(Look::Atlas, window.time, window.view, [WINDOW; 2])?);
    let truth = window.truth.displayed(1.0);
    let seen = seen.displayed(1.0);
    row.ssim = Some(ssim(&truth, &seen)?);
    row.flip = Some(flip(&truth, &seen)?.mean());
    let steps = even.look(Look::Density, window.time, window.view, [WINDOW; 2])?;
    let is_missing = |step: &[f32; 4]| *step == [-1.0; 4];
    row.missing = Some(steps.iter().filter(|s| is_missing(s)).count() as f64 / steps.len() as f64);
    let mut densities: Vec<f64> = (steps.iter())
        .filter(|step| !is_missing(step) && **step != [0.0; 4])
        .map(|[ux, uy, vx, vy]| f64::from((ux * vy - uy * vx).abs()))
        .collect();
    densities.sort_by(f64::total_cmp);
    let quantile = |share: f64| {
        let at = (densities.len().saturating_sub(1) as f64 * share).round() as usize;
        densities.get(at).copied()
    };
    row.density_5 = quantile(0.05);
    row.density_50 = quantile(0.5);
    row.density_95 = quantile(0.95);
    let within = densities
        .iter()
        .filter(|d| (0.5..=2.0).contains(*d))
        .count();
    row.within_factor_2 = (!densities.is_empty()).then(|| within as f64 / densities.len() as f64);
    for density in &densities {
        let bin = (density.log2() * 4.0).round() + (DENSITY_BINS / 2) as f64;
        bins[bin.clamp(0.0, (DENSITY_BINS - 1) as f64) as usize] += 1;
    }
    if let Some(strip) = strip {
        if strip.is_empty() {
            strip.extend([truth, RgbImage::new(WINDOW, WINDOW)]);
        }
        let mut colours = RgbImage::new(WINDOW, WINDOW);
        for (pixel, step) in colours.pixels_mut().zip(&steps) {
            *pixel = colour_of(step);
        }
        strip.extend([seen, colours]);
    }
    Ok(())
}

/// Grey where a pixel has one texel; red where it has fewer, blue where more: the full
/// colour at a factor of four.
fn colour_of(step: &[f32; 4]) -> Rgb<u8> {
    let [ux, uy, vx, vy] = step;
    if *step == [0.0; 4] || *step == [-1.0; 4] {
        return Rgb([0; 3]);
    }
    let octaves = (ux * vy - uy * vx).abs().log2().clamp(-2.0, 2.0) / 2.0;
    let other = (200.0 * (1.0 - octaves.abs())) as u8;
    if octaves < 0.0 {
        Rgb([200, other, other])
    } else {
        Rgb([other, other, 200])
    }
}
