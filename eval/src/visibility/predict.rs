//! What is predicted of a head, and how far from the truth it is.

use std::time::Duration;

use serde::Serialize;
use shadecast_protocol::{Motion, Pose, ViewReport};
use shadecast_server::prediction::{Doubt, HeadFilter};

use super::trace::{Gait, Head, RATE};

/// Ways to predict a head.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Predictor {
    /// It stays.
    None,
    /// It goes on as reported.
    Linear,
    /// The server's filter.
    Kalman,
    /// It is known where it will be.
    Reference,
}

impl Predictor {
    pub(super) const ALL: [Self; 4] = [Self::None, Self::Linear, Self::Kalman, Self::Reference];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Linear => "linear",
            Self::Kalman => "Kalman",
            Self::Reference => "reference",
        }
    }
}

/// What is known of a head when a report has arrived: the reports up to it.
#[derive(Clone, Debug)]
pub(super) struct Known<'a> {
    head: &'a Head,
    pub(super) view: ViewReport,
    pub(super) filter: HeadFilter,
    tick: u32,
    side: u16,
}

impl<'a> Known<'a> {
    /// The first report, for eyes of `side` pixels.
    pub(super) fn first(head: &'a Head, side: u16) -> Self {
        let view = head.report(0, side);
        Self {
            head,
            view,
            filter: HeadFilter::new(&view),
            tick: 0,
            side,
        }
    }

    /// All reports up to that of `tick` arrive.
    pub(super) fn hear_until(&mut self, tick: u32) {
        while self.tick < tick {
            self.tick += 1;
            self.view = self.head.report(self.tick, self.side);
            self.filter.tell(&self.view);
        }
    }

    /// Of the newest report, since the start.
    pub(super) fn seconds(&self) -> f64 {
        f64::from(self.tick) / f64::from(RATE)
    }

    pub(super) fn truth(&self, lead: Duration) -> Pose {
        self.head.pose(self.seconds() + lead.as_secs_f64())
    }

    /// The head `lead` after the newest report. Doubt is the filter's whoever predicts,
    /// so that all look as far around.
    pub(super) fn predicted(&self, predictor: Predictor, lead: Duration) -> (Pose, Doubt) {
        let (filtered, doubt) = self.filter.after(lead);
        let view = &self.view;
        let pose = match predictor {
            Predictor::None => view.world_from_head,
            Predictor::Linear => Motion {
                pose: view.world_from_head,
                linear_velocity: view.linear_velocity,
                angular_velocity: view.angular_velocity,
            }
            .after(lead.as_secs_f32()),
            Predictor::Kalman => filtered,
            Predictor::Reference => self.truth(lead),
        };
        (pose, doubt)
    }
}

/// A line of `visibility-prediction.csv`: how far predicted heads are off.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    pub(super) gait: &'static str,
    pub(super) metres_per_second: f64,
    pub(super) predictor: &'static str,
    pub(super) horizon_ms: f64,
    /// Root mean squares over the trace, and what 95 % are below.
    pub(super) rms_mm: f64,
    pub(super) p95_mm: f64,
    pub(super) rms_degrees: f64,
    pub(super) p95_degrees: f64,
    /// Share of heads that are within what the filter doubts.
    pub(super) within_doubt: f64,
}

/// Errors of all predictors at these horizons over `seconds` of a trace.
pub(super) fn measure(head: &Head, gait: Gait, seconds: f64, horizons: &[Duration]) -> Vec<Row> {
    let mut errors = vec![Vec::new(); horizons.len() * Predictor::ALL.len()];
    let mut known = Known::first(head, 64);
    for tick in RATE / 2..(seconds * f64::from(RATE)) as u32 {
        known.hear_until(tick);
        let cases = horizons
            .iter()
            .flat_map(|horizon| Predictor::ALL.map(|predictor| (*horizon, predictor)));
        for ((horizon, predictor), errors) in cases.zip(&mut errors) {
            let (pose, doubt) = known.predicted(predictor, horizon);
            let truth = known.truth(horizon);
            let off = pose.position.distance(truth.position);
            let turned = pose.orientation.angle_between(truth.orientation);
            errors.push((off, turned, off < doubt.metres && turned < doubt.radians));
        }
    }
    let cases = horizons
        .iter()
        .flat_map(|horizon| Predictor::ALL.map(|predictor| (*horizon, predictor)));
    cases
        .zip(&errors)
        .map(|((horizon, predictor), errors)| {
            let [rms_mm, p95_mm] = summary(errors.iter().map(|e| f64::from(e.0) * 1e3));
            let degrees = errors.iter().map(|e| f64::from(e.1).to_degrees());
            let [rms_degrees, p95_degrees] = summary(degrees);
            let within = errors.iter().filter(|e| e.2).count();
            Row {
                gait: gait.name,
                metres_per_second: gait.speed,
                predictor: predictor.name(),
                horizon_ms: horizon.as_secs_f64() * 1e3,
                rms_mm,
                p95_mm,
                rms_degrees,
                p95_degrees,
                within_doubt: within as f64 / errors.len().max(1) as f64,
            }
        })
        .collect()
}

/// Root mean square and 95th percentile.
fn summary(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let squares: f64 = values.iter().map(|value| value * value).sum();
    let p95 = values.get(values.len() * 95 / 100).copied().unwrap_or(0.0);
    [(squares / values.len().max(1) as f64).sqrt(), p95]
}
