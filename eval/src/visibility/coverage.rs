//! Coverage and overestimation of predicted visible sets, as SAS 2018 measures them.
//!
//! At moments of a trace the exact visible set is found from heads at steps of the
//! horizon: those of the true path make the truth, in the eyes' own field of view, and
//! predicted ones the potentially visible set, in that field of view and in enlarged
//! ones. With v the truth's area, f_n that of its patches that were not predicted and
//! f_p that of patches that were and are not in the truth, r_c = 1 - f_n / v and
//! r_o = f_p / v. All areas are as seen from the middle of the true path.
//!
//! Source: SAS 2018, section 5.1. We depart in that areas are solid angles, as patches
//! beside the picture have none on its plane, and that an enlarged set is held against
//! what the eyes themselves see: what is beyond that is overestimated. Truth and
//! prediction are drawn with different pixels, so that coverage pays for triangles
//! that pixels miss, whoever predicts.

use std::time::Duration;

use anyhow::Result;
use serde::Serialize;
use shadecast_server::prediction::enlargement;

use super::{
    predict::{Known, Predictor},
    seer::{Seer, eyes_of},
    trace::{Gait, Head, RATE},
};

/// Steps of the horizon, microseconds: at 120 Hz up to 33 ms, then wider apart.
const STEPS: [u64; 12] = [
    0, 8_333, 16_667, 25_000, 33_333, 50_000, 66_667, 83_333, 100_000, 133_333, 166_667, 200_000,
];
/// Those that are horizons to report.
const HORIZONS: [usize; 8] = [1, 2, 4, 5, 6, 8, 9, 11];
/// Ticks between two moments.
const SPACING: u32 = 31;

/// The horizons that are reported.
pub(super) fn horizons() -> Vec<Duration> {
    HORIZONS
        .iter()
        .map(|&step| Duration::from_micros(STEPS[step]))
        .collect()
}

/// The image plane of a predicted set.
#[derive(Clone, Copy, Debug)]
enum Plane {
    /// The eyes' own.
    Own,
    /// 1.2 times as wide: SAS 2018, section 5.
    Wide,
    /// As much wider as the filter doubts.
    Doubted,
}

impl Plane {
    fn name(self) -> &'static str {
        match self {
            Self::Own => "the eyes' own",
            Self::Wide => "1.2 times as wide",
            Self::Doubted => "as wide as in doubt",
        }
    }
}

/// What is compared.
const SETS: [(Predictor, Plane); 9] = [
    (Predictor::None, Plane::Own),
    (Predictor::None, Plane::Wide),
    (Predictor::Linear, Plane::Own),
    (Predictor::Linear, Plane::Wide),
    (Predictor::Linear, Plane::Doubted),
    (Predictor::Kalman, Plane::Own),
    (Predictor::Kalman, Plane::Doubted),
    (Predictor::Reference, Plane::Own),
    (Predictor::Reference, Plane::Doubted),
];

/// A line of `visibility.csv`: means over moments, and the worst one.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    pub(super) scene: String,
    pub(super) gait: &'static str,
    pub(super) metres_per_second: f64,
    pub(super) predictor: &'static str,
    pub(super) image_plane: &'static str,
    pub(super) horizon_ms: f64,
    pub(super) moments: u32,
    pub(super) coverage: f64,
    pub(super) overestimation: f64,
    pub(super) least_coverage: f64,
}

/// Sums of a set at a horizon.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    moments: u32,
    coverage: f64,
    overestimation: f64,
    least_coverage: Option<f64>,
}

pub(super) fn measure(
    seer: &mut Seer,
    name: &str,
    (head, gait): (&Head, Gait),
    side: u16,
    moments: u32,
    done: impl Fn(f32),
) -> Result<Vec<Row>> {
    let mut sums = vec![Sum::default(); HORIZONS.len() * SETS.len()];
    let mut known = Known::first(head, side);
    for moment in 0..moments {
        done(moment as f32 / moments as f32);
        known.hear_until(RATE / 2 + moment * SPACING);
        measure_moment(seer, &known, &mut sums)?;
    }
    let cases = HORIZONS
        .iter()
        .flat_map(|step| SETS.map(|set| (*step, set)));
    Ok(cases
        .zip(&sums)
        .map(|((step, (predictor, plane)), sum)| Row {
            scene: name.to_owned(),
            gait: gait.name,
            metres_per_second: gait.speed,
            predictor: predictor.name(),
            image_plane: plane.name(),
            horizon_ms: STEPS[step] as f64 * 1e-3,
            moments: sum.moments,
            coverage: sum.coverage / f64::from(sum.moments.max(1)),
            overestimation: sum.overestimation / f64::from(sum.moments.max(1)),
            least_coverage: sum.least_coverage.unwrap_or(1.0),
        })
        .collect())
}

fn measure_moment(seer: &mut Seer, known: &Known, sums: &mut [Sum]) -> Result<()> {
    let now = Duration::from_secs_f64(known.seconds());
    // By patch, the first step at which it is in the truth, and in each set.
    let count = seer.scene.patches.len();
    let mut truth = vec![u8::MAX; count];
    let mut sets = vec![vec![u8::MAX; count]; SETS.len()];
    for (step, lead) in (0..).zip(STEPS.map(Duration::from_micros)) {
        let eyes = eyes_of(&known.view, known.truth(lead), lead, 1.0);
        note(&mut truth, &seer.seen(&eyes, now)?, step);
        for ((predictor, plane), set) in SETS.iter().zip(&mut sets) {
            if *predictor == Predictor::None && step > 0 {
                continue;
            }
            let (pose, doubt) = known.predicted(*predictor, lead);
            let enlargement = match plane {
                Plane::Own => 1.0,
                Plane::Wide => 1.2,
                Plane::Doubted => enlargement(known.view.eyes[0].fov, doubt.radians),
            };
            let eyes = eyes_of(&known.view, pose, lead, enlargement);
            note(set, &seer.seen(&eyes, now)?, step);
        }
    }
    for (&step, sums) in HORIZONS.iter().zip(sums.chunks_mut(SETS.len())) {
        let middle = Duration::from_micros(STEPS[step]) / 2;
        let eye = known.truth(middle).position;
        for (set, sum) in sets.iter().zip(sums) {
            let is_in = |first: u8| usize::from(first) <= step;
            let either = (0..count).filter(|&patch| is_in(truth[patch]) || is_in(set[patch]));
            let (mut v, mut missed, mut needless) = (0.0, 0.0, 0.0);
            for (patch, area) in seer.areas(eye, now + middle, either) {
                match (is_in(truth[patch]), is_in(set[patch])) {
                    (true, true) => v += area,
                    (true, false) => {
                        v += area;
                        missed += area;
                    }
                    _ => needless += area,
                }
            }
            if v > 0.0 {
                let coverage = 1.0 - missed / v;
                sum.moments += 1;
                sum.coverage += coverage;
                sum.overestimation += needless / v;
                let least = sum.least_coverage.get_or_insert(coverage);
                *least = least.min(coverage);
            }
        }
    }
    Ok(())
}

/// Notes the step of what is seen for the first time.
fn note(first: &mut [u8], pixels: &[u32], step: u8) {
    for (first, &pixels) in first.iter_mut().zip(pixels) {
        if pixels > 0 {
            *first = (*first).min(step);
        }
    }
}
