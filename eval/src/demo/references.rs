//! Path-traced pictures at the poses at which the client drew.
//!
//! A reference is the mean of two halves with different seeds. What differs
//! between the halves is noise alone, so that the difference says how noisy
//! the reference itself is.

use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use image::RgbImage;
use shadecast_server::{
    Integrator,
    scene::Scene,
    still::{Camera, DEFAULT_BOUNCES, Film, Still, StillRenderer},
};

use crate::{MetricError, mean_squared_error};

/// Samples a pixel that each half gets in a round over all references: few, so
/// that the last round ends near the deadline.
const SAMPLES_A_ROUND: u32 = 4;
/// Fewest samples a pixel of one half, even on a machine that is too slow for them.
const MIN_SAMPLES: u32 = 8;
/// Most: beyond, the noise is below one level of eight bits.
const MAX_SAMPLES: u32 = 1024;
/// Of one half where no deadline chooses: as good as windows in the demo's time
/// on two cores.
const SAMPLES_WITHOUT_DEADLINE: u32 = 40;

/// What a reference is taken from.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub(super) camera: Camera,
    /// Where moving objects are.
    pub(super) scene_time: Duration,
}

/// Renders references of `views`, round by round, until a round more would miss
/// the deadline; all of them have as many samples. `progress` hears of the share
/// that is done. Returns the samples a pixel of a whole reference besides.
pub(super) fn render(
    scene: &Scene,
    exposure: f32,
    seed: u32,
    views: &[View],
    deadline: Option<Instant>,
    progress: impl Fn(f32),
) -> Result<(Vec<Reference>, u32)> {
    let mut renderer = StillRenderer::new(
        scene,
        Integrator::with_bounces(DEFAULT_BOUNCES),
        &mut |_| (),
    )
    .context("cannot render references")?;
    let mut films = Vec::with_capacity(views.len());
    for View { camera, .. } in views {
        let film = || renderer.film([camera.width, camera.height]);
        films.push([film()?, film()?]);
    }
    let began = Instant::now();
    let time = deadline.map(|deadline| deadline.saturating_duration_since(began));
    let mut rounds = Rounds::default();
    while rounds.go_on(time) {
        for (index, (view, halves)) in (0..).zip(views.iter().zip(&mut films)) {
            for (half, film) in (0..).zip(halves) {
                let seed = seed.wrapping_add(2 * index + half);
                renderer.expose(film, &view.camera, view.scene_time, SAMPLES_A_ROUND, seed)?;
            }
            let of_round = (index + 1) as f32 / views.len() as f32;
            progress(rounds.share(of_round, time));
        }
        rounds.done(began.elapsed());
    }
    let develop = |film: &Film| renderer.develop(film);
    let references = films
        .iter()
        .map(|[one, other]| Ok(Reference::new(&[develop(one)?, develop(other)?], exposure)))
        .collect::<Result<_>>()?;
    Ok((references, 2 * rounds.samples()))
}

/// How many rounds there were, and when the last one ended.
#[derive(Clone, Copy, Debug, Default)]
struct Rounds {
    count: u32,
    elapsed: Duration,
}

impl Rounds {
    /// Of one half.
    fn samples(self) -> u32 {
        self.count * SAMPLES_A_ROUND
    }

    fn done(&mut self, elapsed: Duration) {
        self.count += 1;
        self.elapsed = elapsed;
    }

    /// Whether another round, as long as those before, ends in `time`.
    fn go_on(self, time: Option<Duration>) -> bool {
        let Some(time) = time else {
            return self.samples() < SAMPLES_WITHOUT_DEADLINE;
        };
        let next = self.elapsed + self.elapsed / self.count.max(1);
        self.samples() < MIN_SAMPLES || (self.samples() < MAX_SAMPLES && next <= time)
    }

    /// What is done of the whole, when `of_round` of the next round is.
    fn share(self, of_round: f32, time: Option<Duration>) -> f32 {
        let rounds = self.count as f32 + of_round;
        let whole = match time {
            None => (SAMPLES_WITHOUT_DEADLINE / SAMPLES_A_ROUND) as f32,
            Some(time) => {
                let one = self.elapsed.as_secs_f32() / self.count.max(1) as f32;
                (time.as_secs_f32() / one.max(1e-3)).max(rounds)
            }
        };
        (rounds / whole).min(1.0)
    }
}

/// A tone-mapped reference and its two tone-mapped halves.
pub(super) struct Reference {
    pub(super) picture: RgbImage,
    halves: [RgbImage; 2],
}

impl Reference {
    fn new([one, other]: &[Still; 2], exposure: f32) -> Self {
        let pairs = one.radiance.iter().zip(&other.radiance);
        let mean = Still {
            radiance: pairs.map(|(a, b)| (*a + *b) * 0.5).collect(),
            ..*one
        };
        Self {
            picture: mean.displayed(exposure),
            halves: [one, other].map(|still| still.displayed(exposure)),
        }
    }

    /// The mean squared error that noise gives the reference: a quarter of that
    /// between its halves, whose variances add up while those of their mean do not.
    pub(super) fn noise(&self) -> Result<f64, MetricError> {
        Ok(mean_squared_error(&self.halves[0], &self.halves[1])? / 4.0)
    }
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    #[test]
    fn rounds_fill_the_time_within_bounds() {
        let second = Duration::from_secs(1);
        let rounds_in = |time: Option<Duration>, one: Duration| {
            let mut rounds = Rounds::default();
            while rounds.go_on(time) {
                rounds.done(rounds.elapsed + one);
            }
            rounds.count
        };
        assert_eq!(rounds_in(Some(10 * second), second), 10);
        assert_eq!(rounds_in(Some(10 * second), 3 * second), 3);
        assert_eq!(rounds_in(Some(Duration::ZERO), second), 2, "never fewer");
        assert_eq!(rounds_in(Some(second), Duration::ZERO), 256, "never more");
        assert_eq!(rounds_in(None, second), 10);
    }

    #[test]
    fn the_noise_of_a_mean_is_half_the_difference() {
        let grey = |level| RgbImage::from_pixel(4, 4, Rgb([level; 3]));
        let reference = Reference {
            picture: grey(100),
            halves: [grey(90), grey(110)],
        };
        // Halves at a distance of 20 levels stand for a deviation of 10.
        let noise = reference.noise().unwrap();
        assert!((noise.sqrt() * 255.0 - 10.0).abs() < 1e-9, "{noise}");
    }
}
