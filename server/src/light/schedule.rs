//! Which slots get paths in an update.
//!
//! The budget is a number of paths. Slots that were never lit come first, all
//! of them: if they are too many, each path lights two by two texels, then four
//! by four, and so on, so that a first look never waits. What is left goes
//! where a path removes most visible error: many pixels, much noise, few samples,
//! or long not looked at.

use glam::Vec3;
use shadecast_protocol::{PatchId, PatchShape, Slot};
use shadecast_shaders::light::{BlockRecord, Quality, TILE_SIDE, TriangleRecord};

use crate::patches::Patch;

/// Coarsest first look: texels lit by one path, log2 of a side.
const COARSEST: u32 = 3;
/// Relative standard deviation that one path is believed to have before
/// enough of them were measured.
const EXPECTED_NOISE: f32 = 0.7;
/// Samples after which the measured noise is believed as much as the expectation.
const BELIEF: f32 = 3.0;
/// Relative change of light that is believed of one update, where nobody has looked.
const DRIFT: f32 = 0.06;
/// Samples that any content counts as at least.
const LEAST_WORTH: f32 = 0.01;
/// Turn of the eye, in half widths of the lobe, after which a reflection of the sun is
/// another one.
const STALE: f32 = 1.0;

/// A slot that gets one path for each of its texels, or for each square of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Job {
    patch: PatchId,
    slot: Slot,
    shape: PatchShape,
    first_triangle: u32,
    instance: u32,
    sample_index: u32,
    log2_stride: u32,
    longest_history: f32,
    /// Unit vector from the patch to the eye, in the space of its object.
    view: Vec3,
    glossy_keep: f32,
}

impl Job {
    /// Whose slot it is.
    #[must_use]
    pub fn patch(&self) -> PatchId {
        self.patch
    }

    /// Paths that it takes: one for each square of texels in the slot's bounds. Where
    /// none of a square is the slot's own, its path ends before it begins.
    #[must_use]
    pub fn paths(&self) -> u32 {
        let [columns, rows] = self.across();
        columns * rows
    }

    /// Tiles that they are judged in.
    pub(super) fn tiles(&self) -> u32 {
        let [columns, rows] = self.across().map(|paths| paths.div_ceil(TILE_SIDE));
        columns * rows
    }

    /// Paths on either axis.
    fn across(&self) -> [u32; 2] {
        let (bounds, side) = (self.slot.bounds(), 1 << self.log2_stride);
        [bounds.width, bounds.height].map(|texels| texels.div_ceil(side))
    }

    /// Appends the slot's record, as words.
    pub(super) fn record(&self, [first_job, first_tile]: [u32; 2], records: &mut Vec<u32>) {
        let common_bits = self.log2_stride << 10 | self.instance << 16;
        match self.slot {
            Slot::Block(block) => {
                let shape = match self.shape {
                    PatchShape::Solo => 0,
                    PatchShape::Pair => 1,
                    PatchShape::Triple => 2,
                };
                let record = BlockRecord {
                    first_job,
                    first_tile,
                    position: u32::from(block.x) | u32::from(block.y) << 16,
                    layout_bits: super::level_bits(block)
                        | shape << 8
                        | u32::from(block.level.is_turned()) << 14
                        | common_bits,
                    first_triangle: self.first_triangle,
                    sample_index: self.sample_index,
                    patch_id: self.patch.0,
                    longest_history: self.longest_history,
                    glossy_keep: self.glossy_keep,
                };
                records.extend_from_slice(bytemuck::cast_slice(&[record]));
            }
            Slot::Triangle(slot) => {
                let record = TriangleRecord {
                    first_job,
                    first_tile,
                    layout_bits: common_bits,
                    first_triangle: self.first_triangle,
                    sample_index: self.sample_index,
                    patch_id: self.patch.0,
                    longest_history: self.longest_history,
                    glossy_keep: self.glossy_keep,
                    corners: super::corner_words(slot),
                    weights: super::weight_words(slot),
                };
                records.extend_from_slice(bytemuck::cast_slice(&[record]));
            }
        }
    }
}

/// What is known of a patch's light.
#[derive(Clone, Copy, Debug, Default)]
struct Lit {
    /// Samples drawn so far, of the sequence.
    drawn: u32,
    /// Samples that its present content is worth.
    worth: f32,
    /// Measured standard error, relative.
    noise: f32,
    /// Samples that its reflections are worth, seen from `view`.
    glossy_worth: f32,
    /// From where it was seen when it was lit last, as in [`Job`].
    view: Vec3,
    /// From where it was seen when it was made to be shown last.
    shown_from: Vec3,
    /// The update that lit it last.
    update: u32,
}

/// How long what is known of a patch's light stays true.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lasting {
    /// Samples over which means run at most.
    pub longest_history: f32,
    /// A point of the patch, in the space of its object.
    pub point: Vec3,
    /// GGX alpha of its glossiest part: the half width of the lobe, radians.
    pub alpha: f32,
    /// Share of its light that the glossy lobe carries, roughly.
    pub shine: f32,
}

impl Lasting {
    /// What glossy samples are still worth when the patch is seen from `now`
    /// instead of `then`, unit vectors: a mirror turns what it shows by twice the
    /// angle of the eye, and half a lobe's width of turning halves their worth.
    fn glossy_keep(&self, then: Vec3, now: Vec3) -> f32 {
        let turned = self.turned(then, now);
        1.0 / (1.0 + turned * turned)
    }

    /// By how many half widths of the lobe what it shows has turned.
    fn turned(&self, then: Vec3, now: Vec3) -> f32 {
        /// Below this half width a lobe is a mirror to a texel of its size.
        const MIRROR: f32 = 0.02;
        2.0 * now.distance(then) / self.alpha.max(MIRROR)
    }
}

/// Chooses jobs and remembers what came of them.
#[derive(Clone, Debug)]
pub struct Schedule {
    lit: Vec<Lit>,
    /// By patch.
    lasting: Vec<Lasting>,
    /// Updates so far.
    update: u32,
}

impl Schedule {
    /// Nothing is lit yet; `lasting` by patch.
    #[must_use]
    pub fn new(lasting: Vec<Lasting>) -> Self {
        Self {
            lit: vec![Lit::default(); lasting.len()],
            lasting,
            update: 0,
        }
    }

    /// A patch got a slot: its content was carried over, or is gone.
    pub fn placed(&mut self, patch: PatchId, carried: bool, resampled: bool) {
        let lit = &mut self.lit[patch.0 as usize];
        let most = match (carried, resampled) {
            (false, _) => 0.0,
            (true, true) => 12.0,
            (true, false) => return,
        };
        lit.worth = lit.worth.min(most);
        lit.glossy_worth = lit.glossy_worth.min(most);
    }

    /// The job of lighting each texel of a patch's slot once; `eyes[n]` is the
    /// eye in the space of `ObjectId(n)`.
    #[must_use]
    pub fn job(&self, patches: &[Patch], id: PatchId, slot: Slot, eyes: &[Vec3]) -> Job {
        let patch = &patches[id.0 as usize];
        let lasting = &self.lasting[id.0 as usize];
        let view = (eyes[usize::from(patch.object.0)] - lasting.point).normalize_or_zero();
        Job {
            patch: id,
            slot,
            shape: patch.shape,
            first_triangle: patch.first_triangle,
            instance: u32::from(patch.object.0),
            sample_index: self.lit[id.0 as usize].drawn,
            log2_stride: 0,
            longest_history: lasting.longest_history,
            view,
            glossy_keep: lasting.glossy_keep(self.lit[id.0 as usize].view, view),
        }
    }

    /// Jobs for about `budget` paths among the placed patches of the visible
    /// set, given with the pixels that each covers.
    #[must_use]
    pub fn choose(
        &self,
        patches: &[Patch],
        placed: impl Iterator<Item = (PatchId, Slot, u32)>,
        budget: u32,
        eyes: &[Vec3],
    ) -> Vec<Job> {
        let mut first_looks = Vec::new();
        let mut others: Vec<(f32, Job)> = Vec::new();
        for (id, slot, pixels) in placed {
            let lit = self.lit[id.0 as usize];
            let job = self.job(patches, id, slot, eyes);
            if lit.worth <= 0.0 {
                first_looks.push(job);
                continue;
            }
            let expected = EXPECTED_NOISE * EXPECTED_NOISE / lit.worth;
            let believed =
                (lit.noise * lit.noise * lit.worth + expected * BELIEF) / (lit.worth + BELIEF);
            // Squared error that one more sample removes, as a Kalman filter has it: that
            // of a sample, and that of what is known, which grows while nobody looks. One
            // look settles it: what it contradicts, `measure_change` ends.
            let of_sample = believed * lit.worth;
            let unseen = self.update.wrapping_sub(lit.update) as f32;
            let known = of_sample / self.worth(id, job.glossy_keep) + DRIFT * DRIFT * unseen;
            let removed = known * known / (known + of_sample).max(f32::MIN_POSITIVE);
            let gain = removed * pixels.max(1) as f32 / slot.bounds().area() as f32;
            others.push((gain, job));
        }
        let cost = |stride: u32| -> u64 {
            first_looks
                .iter()
                .map(|job| {
                    u64::from(
                        Job {
                            log2_stride: stride,
                            ..*job
                        }
                        .paths(),
                    )
                })
                .sum()
        };
        let stride = (0..COARSEST)
            .find(|&s| cost(s) <= u64::from(budget))
            .unwrap_or(COARSEST);
        let mut left = u64::from(budget).saturating_sub(cost(stride));
        let mut jobs = first_looks;
        for job in &mut jobs {
            job.log2_stride = stride;
        }
        others.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.patch.cmp(&b.1.patch)));
        for (_, job) in others {
            // What had only a coarse look may be refined step by step.
            let coarse = self.lit[job.patch.0 as usize].worth < 1.0;
            let (limit, coarsest) = if coarse {
                (left / 2, COARSEST)
            } else {
                (left, 1)
            };
            let refined = (0..coarsest)
                .map(|log2_stride| Job { log2_stride, ..job })
                .find(|job| u64::from(job.paths()) <= limit);
            // A slot larger than the whole budget still gets its turn.
            let Some(job) = refined.or_else(|| jobs.is_empty().then_some(job)) else {
                continue;
            };
            left = left.saturating_sub(u64::from(job.paths()));
            jobs.push(job);
        }
        jobs
    }

    /// Samples that a patch's content is worth now that `glossy_keep` of its
    /// reflections still holds: errors add up by the shares of light that have them.
    fn worth(&self, id: PatchId, glossy_keep: f32) -> f32 {
        let lit = &self.lit[id.0 as usize];
        let shine = self.lasting[id.0 as usize].shine;
        let glossy = (lit.glossy_worth * glossy_keep).max(LEAST_WORTH);
        1.0 / ((1.0 - shine) / lit.worth.max(LEAST_WORTH) + shine / glossy)
    }

    /// Slots whose reflection of the sun has moved since they were made to be
    /// shown: it needs no path.
    #[must_use]
    pub fn stale(
        &self,
        patches: &[Patch],
        placed: impl Iterator<Item = (PatchId, Slot, u32)>,
        eyes: &[Vec3],
    ) -> Vec<Job> {
        placed
            .map(|(id, slot, _)| self.job(patches, id, slot, eyes))
            .filter(|job| {
                let lit = &self.lit[job.patch.0 as usize];
                let lasting = &self.lasting[job.patch.0 as usize];
                lit.worth > 0.0 && lasting.turned(lit.shown_from, job.view) > STALE
            })
            .collect()
    }

    /// Notes that `jobs` were made to be shown, without paths.
    pub fn shown(&mut self, jobs: &[Job]) {
        for job in jobs {
            self.lit[job.patch.0 as usize].shown_from = job.view;
        }
    }

    /// Notes that `jobs` were traced: until it is measured, their noise falls as
    /// that of means does.
    pub fn traced(&mut self, jobs: &[Job]) {
        for job in jobs {
            let lit = &mut self.lit[job.patch.0 as usize];
            lit.drawn = lit.drawn.wrapping_add(1);
            let weight = 0.25_f32.powi(job.log2_stride as i32);
            let before = lit.worth.min(job.longest_history);
            lit.worth = before + weight;
            lit.noise *= (before / lit.worth).sqrt();
            lit.glossy_worth =
                (lit.glossy_worth * job.glossy_keep).min(job.longest_history) + weight;
            lit.view = job.view;
            lit.shown_from = job.view;
            lit.update = self.update;
        }
    }

    /// Ends an update: notes what was found of the slots of `jobs`.
    pub fn measured(&mut self, jobs: &[Job], found: &[Quality]) {
        self.update = self.update.wrapping_add(1);
        for (job, found) in jobs.iter().zip(found) {
            let lit = &mut self.lit[job.patch.0 as usize];
            lit.noise = if found.noise.is_finite() {
                found.noise
            } else {
                0.0
            };
            // Where light has changed, texels have let go of their samples.
            lit.worth = lit.worth.min(found.samples.max(LEAST_WORTH));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shadecast_protocol::{Block, Level, ObjectId};

    const MATTE: Lasting = Lasting {
        longest_history: 1e4,
        point: Vec3::Z,
        alpha: 1.0,
        shine: 0.0,
    };

    /// As noisy, with all samples that were drawn.
    fn noisy(noise: f32) -> Quality {
        Quality {
            noise,
            samples: f32::INFINITY,
        }
    }

    fn patches(count: u32) -> Vec<Patch> {
        (0..count)
            .map(|first| Patch {
                shape: PatchShape::Pair,
                corners: [0; 5],
                first_triangle: first * 2,
                object: ObjectId::WORLD,
                double_sided: false,
                masked: false,
            })
            .collect()
    }

    fn block(index: u32) -> Slot {
        Slot::Block(Block {
            x: (index * 8) as u16,
            y: 0,
            level: Level {
                width: 3,
                height: 3,
            },
        })
    }

    fn placed(count: u32) -> impl Iterator<Item = (PatchId, Slot, u32)> {
        (0..count).map(|index| (PatchId(index), block(index), 10))
    }

    #[test]
    fn every_block_gets_a_first_look_whatever_the_budget() {
        let schedule = Schedule::new(vec![MATTE; 50]);
        for (budget, paths) in [(u32::MAX, 64), (50 * 16, 16), (50 * 5, 4), (0, 1)] {
            let jobs = schedule.choose(&patches(50), placed(50), budget, &[Vec3::ZERO]);
            assert_eq!(jobs.len(), 50);
            assert!(
                jobs.iter().all(|job| job.paths() == paths),
                "budget {budget}"
            );
        }
    }

    #[test]
    fn paths_go_where_the_noise_is() {
        let mut schedule = Schedule::new(vec![MATTE; 3]);
        let first = schedule.choose(&patches(3), placed(3), u32::MAX, &[Vec3::ZERO]);
        for _ in 0..20 {
            schedule.traced(&first);
            schedule.measured(&first, &[0.01, 0.5, 0.01].map(noisy));
        }
        let next = schedule.choose(&patches(3), placed(3), 64, &[Vec3::ZERO]);
        assert_eq!(next.len(), 1);
        assert_eq!(next[0].patch, PatchId(1));
    }

    #[test]
    fn what_nobody_looked_at_gets_its_turn() {
        let mut schedule = Schedule::new(vec![MATTE; 2]);
        let first = schedule.choose(&patches(2), placed(2), u32::MAX, &[Vec3::ZERO]);
        for _ in 0..20 {
            schedule.traced(&first);
            schedule.measured(&first, &[0.3, 0.0].map(noisy));
        }
        let mut turn = || {
            let jobs = schedule.choose(&patches(2), placed(2), 64, &[Vec3::ZERO]);
            schedule.traced(&jobs);
            schedule.measured(&jobs, &[noisy(0.3)]);
            jobs[0].patch()
        };
        // The second one is free of noise, as far as is known.
        let turns: Vec<PatchId> = (0..60).map(|_| turn()).collect();
        assert_eq!(turns[0], PatchId(0));
        assert!(turns.contains(&PatchId(1)));
    }

    #[test]
    fn paths_go_where_light_has_changed() {
        let mut schedule = Schedule::new(vec![MATTE; 2]);
        let first = schedule.choose(&patches(2), placed(2), u32::MAX, &[Vec3::ZERO]);
        for _ in 0..20 {
            schedule.traced(&first);
            schedule.measured(&first, &[0.1; 2].map(noisy));
        }
        let changed = Quality {
            noise: 0.1,
            samples: 1.5,
        };
        schedule.measured(&first, &[noisy(0.1), changed]);
        let next = schedule.choose(&patches(2), placed(2), 64, &[Vec3::ZERO]);
        assert_eq!(next[0].patch(), PatchId(1));
    }

    #[test]
    fn reflections_age_as_the_eye_moves() {
        let metal = Lasting {
            alpha: 0.1,
            shine: 1.0,
            ..MATTE
        };
        let mut schedule = Schedule::new(vec![MATTE, metal]);
        let (before, after) = ([Vec3::ZERO], [Vec3::X * 0.1]);
        for _ in 0..20 {
            let jobs = schedule.choose(&patches(2), placed(2), u32::MAX, &before);
            schedule.traced(&jobs);
            schedule.measured(&jobs, &[0.1; 2].map(noisy));
        }
        let stale = |schedule: &Schedule, eyes| schedule.stale(&patches(2), placed(2), eyes);
        assert!(stale(&schedule, &before).is_empty());
        let jobs = stale(&schedule, &after);
        assert_eq!(jobs.len(), 1);
        assert_eq!(jobs[0].patch(), PatchId(1));
        // There is time for one block: it is the one whose samples have aged.
        let chosen = schedule.choose(&patches(2), placed(2), 64, &after);
        assert_eq!(chosen[0].patch(), PatchId(1));
        schedule.shown(&jobs);
        assert!(stale(&schedule, &after).is_empty());
    }

    #[test]
    fn glossy_light_is_kept_while_the_eye_stays_within_its_lobe() {
        let keep = |alpha, angle: f32| {
            let now = Vec3::new(angle.sin(), 0.0, angle.cos());
            Lasting { alpha, ..MATTE }.glossy_keep(Vec3::Z, now)
        };
        assert_eq!(keep(0.0, 0.0), 1.0);
        assert!(keep(1.0, 0.1) > 0.95, "rough surfaces hardly change");
        assert!((keep(0.1, 0.05) - 0.5).abs() < 0.01, "half a lobe's width");
        assert!(keep(0.0, 0.1) < 0.02, "a mirror shows something else");
        // A patch at the eye, and one that was never lit, have no direction.
        let nowhere = Lasting {
            alpha: 0.5,
            ..MATTE
        }
        .glossy_keep(Vec3::ZERO, Vec3::Z);
        assert!((0.0..0.1).contains(&nowhere));
    }

    #[test]
    fn a_block_that_lost_its_content_is_a_first_look_again() {
        let mut schedule = Schedule::new(vec![MATTE; 2]);
        let first = schedule.choose(&patches(2), placed(2), u32::MAX, &[Vec3::ZERO]);
        schedule.traced(&first);
        schedule.measured(&first, &[f32::NAN, 0.1].map(noisy));
        schedule.placed(PatchId(1), false, false);
        let next = schedule.choose(&patches(2), placed(2), 0, &[Vec3::ZERO]);
        assert_eq!(
            next.iter().map(|job| job.patch).collect::<Vec<_>>(),
            [PatchId(1)]
        );
    }
}
