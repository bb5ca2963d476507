//! When the light of an update is seen: from how long light has taken so far.
//!
//! A frame that begins now answers a report that is already `age` old. What is
//! measured is the rest of the way, from the frame's beginning to the first
//! picture that shows it, since the age of the report is known: where reports are
//! late or missing, the head is predicted further at once.
//!
//! Mean and deviation are estimated as TCP does for its timeouts (Jacobson,
//! "Congestion Avoidance and Control", 1988, appendix A).

use std::{collections::VecDeque, time::Duration};

use shadecast_protocol::FrameId;

/// Before any acknowledgement told how long updates take.
const FIRST_DELAY: Duration = Duration::from_millis(120);
/// Beyond this no prediction is worth anything.
const LONGEST: Duration = Duration::from_millis(500);
/// Weight of a new measurement in the mean, and in the mean deviation.
const MEAN_WEIGHT: f64 = 0.125;
const DEVIATION_WEIGHT: f64 = 0.25;
/// Mean deviations by which light may be later than expected.
const LATER: f64 = 2.0;
/// Heads are sampled so often at least: SAS 2018, section 5.
const STEP: Duration = Duration::from_micros(33_333);
/// Frames that wait for their acknowledgement: two seconds.
const MOST_UNDERWAY: usize = 64;

/// The time that an update is on display, from the beginning of its frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Horizon {
    /// Its light is first seen.
    pub shown: Duration,
    /// The next one takes its place.
    pub gone: Duration,
}

impl Horizon {
    /// Halfway through it.
    #[must_use]
    pub fn middle(self) -> Duration {
        self.shown + self.gone.saturating_sub(self.shown) / 2
    }

    /// Heads that sample it: one each 33 ms, two at least, and at most `most`.
    #[must_use]
    pub fn steps(self, most: u32) -> u32 {
        let span = self.gone.saturating_sub(self.shown);
        let steps = span.as_nanos().div_ceil(STEP.as_nanos()) as u32 + 1;
        steps.max(2).min(most.max(1))
    }

    /// So many times, evenly from its beginning to its end; a single one in the middle.
    pub fn samples(self, count: u32) -> impl Iterator<Item = Duration> {
        let count = count.max(1);
        let span = self.gone.saturating_sub(self.shown);
        (0..count).map(move |index| match count {
            1 => self.middle(),
            _ => self.shown + span * index / (count - 1),
        })
    }
}

/// How long light takes from frame to display.
#[derive(Clone, Debug)]
pub struct Latency {
    /// Frames that were begun, and the age of the reports that they answer.
    underway: VecDeque<(FrameId, Duration)>,
    /// From the sampling of a pose to its light, seconds.
    motion_to_photon: Option<f64>,
    /// From the beginning of a frame to its light, seconds: mean and mean deviation.
    delay: Option<(f64, f64)>,
    /// Between two frames, seconds.
    period: f64,
}

impl Latency {
    /// Nothing was measured; frames are expected so often.
    #[must_use]
    pub fn new(period: Duration) -> Self {
        Self {
            underway: VecDeque::new(),
            motion_to_photon: None,
            delay: None,
            period: period.as_secs_f64(),
        }
    }

    /// From the sampling of a pose to its light, as far as it is known.
    #[must_use]
    pub fn motion_to_photon(&self) -> Option<Duration> {
        self.motion_to_photon.map(Duration::from_secs_f64)
    }

    /// A frame begins, so long after the one before. It answers a report that
    /// arrived `age` ago.
    pub fn begun(&mut self, frame: FrameId, since_last: Option<Duration>, age: Duration) {
        if let Some(since_last) = since_last {
            let period = since_last.as_secs_f64().min(1.0);
            self.period += (period - self.period) * MEAN_WEIGHT;
        }
        self.underway.push_back((frame, age));
        if self.underway.len() > MOST_UNDERWAY {
            self.underway.pop_front();
        }
    }

    /// A frame was seen, so long after the pose that it answers was sampled. Of a
    /// frame that is not underway nothing is learnt.
    pub fn seen(&mut self, frame: FrameId, motion_to_photon: Duration) {
        let Some(index) = self.underway.iter().position(|(begun, _)| *begun == frame) else {
            return;
        };
        let (_, age) = self.underway[index];
        self.underway.drain(..=index);
        let total = motion_to_photon.min(LONGEST);
        let delay = total.saturating_sub(age).as_secs_f64();
        let mean = self.motion_to_photon.get_or_insert(total.as_secs_f64());
        *mean += (total.as_secs_f64() - *mean) * MEAN_WEIGHT;
        let (mean, deviation) = self.delay.get_or_insert((delay, 0.0));
        *deviation += ((delay - *mean).abs() - *deviation) * DEVIATION_WEIGHT;
        *mean += (delay - *mean) * MEAN_WEIGHT;
    }

    /// When a frame that begins now is on display.
    #[must_use]
    pub fn horizon(&self) -> Horizon {
        let (delay, deviation) = self.delay.unwrap_or((FIRST_DELAY.as_secs_f64(), 0.0));
        let at = |seconds: f64| Duration::from_secs_f64(seconds.max(0.0)).min(LONGEST);
        Horizon {
            shown: at(delay - deviation),
            gone: at(delay + LATER * deviation + self.period),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn heads_are_as_many_as_the_display_time_needs() {
        let horizon = |shown, gone| Horizon {
            shown: ms(shown),
            gone: ms(gone),
        };
        for (span, most, steps) in [
            (horizon(40, 73), 8, 2),
            (horizon(0, 100), 8, 5),
            (horizon(0, 99), 8, 4),
            (horizon(100, 400), 8, 8),
            (horizon(100, 100), 8, 2),
            (horizon(100, 400), 1, 1),
            (horizon(100, 400), 0, 1),
        ] {
            assert_eq!(span.steps(most), steps, "{span:?}");
        }
        let times: Vec<_> = horizon(100, 200).samples(3).collect();
        assert_eq!(times, [ms(100), ms(150), ms(200)]);
        assert_eq!(horizon(100, 200).samples(1).next(), Some(ms(150)));
        let backwards = horizon(200, 100).samples(2).collect::<Vec<_>>();
        assert_eq!(backwards, [ms(200); 2]);
    }

    #[test]
    fn steady_light_is_expected_when_it_comes() {
        let mut latency = Latency::new(ms(20));
        assert_eq!(latency.horizon().shown, FIRST_DELAY);
        for number in 0..200 {
            // The reports that frames answer are of any age; the rest of the way is
            // always as long.
            let age = ms(u64::from(number) % 17);
            latency.begun(FrameId(number), Some(ms(40)), age);
            latency.seen(FrameId(number), age + ms(60));
        }
        let horizon = latency.horizon();
        assert_eq!(horizon.shown.as_micros(), 60_000);
        assert!(horizon.gone.abs_diff(ms(100)) < ms(1), "{horizon:?}");
    }

    #[test]
    fn unsteady_light_is_expected_earlier_and_later() {
        let mut latency = Latency::new(ms(20));
        for number in 0..200 {
            latency.begun(FrameId(number), Some(ms(20)), Duration::ZERO);
            latency.seen(FrameId(number), ms(if number % 2 == 0 { 50 } else { 90 }));
        }
        let Horizon { shown, gone } = latency.horizon();
        assert!(shown < ms(58) && gone > ms(120), "{shown:?} {gone:?}");
    }

    #[test]
    fn what_a_client_claims_moves_the_horizon_within_bounds() {
        let mut latency = Latency::new(ms(20));
        latency.seen(FrameId(7), ms(1));
        assert_eq!(latency.motion_to_photon(), None, "no such frame was made");
        for number in 0..1000 {
            latency.begun(FrameId(number), Some(Duration::MAX), Duration::MAX);
        }
        assert!(latency.underway.len() <= MOST_UNDERWAY);
        latency.seen(FrameId(999), Duration::MAX);
        latency.seen(FrameId(999), Duration::ZERO);
        assert_eq!(latency.motion_to_photon(), Some(LONGEST));
        let horizon = latency.horizon();
        assert!(horizon.shown <= horizon.gone && horizon.gone <= LONGEST);
    }
}
