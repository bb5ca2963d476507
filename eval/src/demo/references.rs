//! Path-traced pictures at the poses at which the client drew.
//!
//! A reference is the mean of two halves with different seeds. What differs
//! between the halves is noise alone, so that the difference says how noisy
//! the reference itself is.

use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use glam::Vec3;
use image::{Rgb, RgbImage};
use shadecast_server::{
    scene::Scene,
    still::{Camera, Still, StillRenderer},
    tone_map,
};

use crate::{MetricError, mean_squared_error};

/// Fewest samples a pixel of one half, even on a machine that is too slow for
/// them.
const MIN_SAMPLES: u32 = 8;
/// Most: beyond, the noise is below one level of eight bits.
const MAX_SAMPLES: u32 = 1024;
/// Of one half where no deadline chooses: as good as windows in the demo's time
/// on two cores.
const SAMPLES_WITHOUT_DEADLINE: u32 = 24;
/// Samples a pixel by which the speed is measured: enough that they and not the
/// beginning and end of a picture take the time.
const PROBE_SAMPLES: u32 = 4;
/// Every how manyth reference the speed is measured in. What it costs then is a
/// few hundredths of what the references do.
const PROBE_STEP: usize = 3;

/// What a reference is taken from.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub(super) camera: Camera,
    /// Where moving objects are.
    pub(super) scene_time: Duration,
}

/// Renders references, each with as many samples as the others.
pub(super) struct References {
    renderer: StillRenderer,
    exposure: f32,
    seed: u32,
    /// Of one half; chosen by [`Self::plan`].
    samples: u32,
}

impl References {
    pub(super) fn new(scene: &Scene, exposure: f32, seed: u32) -> Result<Self> {
        Ok(Self {
            renderer: StillRenderer::new(scene).context("cannot render references")?,
            exposure,
            seed,
            samples: SAMPLES_WITHOUT_DEADLINE,
        })
    }

    /// Chooses the samples so that references of `views` end by `deadline`.
    pub(super) fn plan(&mut self, views: &[View], deadline: Instant) -> Result<()> {
        // The first dispatches compile the kernels; their time does not count.
        if let Some(first) = views.first() {
            self.probe(first)?;
        }
        let began = Instant::now();
        let probed = views.iter().step_by(PROBE_STEP);
        let probes = probed.len().max(1);
        for view in probed {
            self.probe(view)?;
        }
        let one_sample = began
            .elapsed()
            .div_f64(probes as f64 * f64::from(PROBE_SAMPLES))
            * views.len() as u32;
        let left = deadline.saturating_duration_since(Instant::now());
        self.samples = samples_that_fit(left, one_sample);
        Ok(())
    }

    fn probe(&mut self, view: &View) -> Result<Still> {
        let View { camera, scene_time } = view;
        self.renderer
            .render(camera, *scene_time, PROBE_SAMPLES, self.seed)
    }

    /// Of a whole reference, both halves.
    pub(super) fn samples_per_pixel(&self) -> u32 {
        2 * self.samples
    }

    /// The `index`-th reference; `progress` hears of each half.
    pub(super) fn render(
        &mut self,
        index: u32,
        view: &View,
        progress: impl Fn(),
    ) -> Result<Reference> {
        let mut half = |seed: u32| {
            let still = self
                .renderer
                .render(&view.camera, view.scene_time, self.samples, seed)?;
            progress();
            anyhow::Ok(still)
        };
        let first_seed = self.seed.wrapping_add(2 * index);
        let halves = [half(first_seed)?, half(first_seed.wrapping_add(1))?];
        Ok(Reference::new(&halves, self.exposure))
    }
}

/// Samples of one half, when one sample of all references takes `one_sample`.
fn samples_that_fit(left: Duration, one_sample: Duration) -> u32 {
    let samples = left.as_secs_f64() / (2.0 * one_sample.as_secs_f64()).max(1e-9);
    (samples as u32).clamp(MIN_SAMPLES, MAX_SAMPLES)
}

/// A tone-mapped reference and its two tone-mapped halves.
pub(super) struct Reference {
    pub(super) picture: RgbImage,
    halves: [RgbImage; 2],
}

impl Reference {
    fn new([one, other]: &[Still; 2], exposure: f32) -> Self {
        let mean = one
            .radiance
            .iter()
            .zip(&other.radiance)
            .map(|(a, b)| (*a + *b) * 0.5);
        Self {
            picture: tone_mapped(one.width, mean, exposure),
            halves: [one, other]
                .map(|still| tone_mapped(still.width, still.radiance.iter().copied(), exposure)),
        }
    }

    /// The mean squared error that noise gives the reference: a quarter of that
    /// between its halves, whose variances add up while those of their mean do not.
    pub(super) fn noise(&self) -> Result<f64, MetricError> {
        Ok(mean_squared_error(&self.halves[0], &self.halves[1])? / 4.0)
    }
}

fn tone_mapped(
    width: u32,
    radiance: impl ExactSizeIterator<Item = Vec3>,
    exposure: f32,
) -> RgbImage {
    let height = radiance.len() as u32 / width.max(1);
    let mut picture = RgbImage::new(width, height);
    for (pixel, radiance) in picture.pixels_mut().zip(radiance) {
        *pixel = Rgb(tone_map(radiance, exposure));
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_fill_the_time_within_bounds() {
        let second = Duration::from_secs(1);
        let millisecond = Duration::from_millis(1);
        assert_eq!(samples_that_fit(40 * second, 960 * millisecond), 20);
        assert_eq!(samples_that_fit(Duration::ZERO, second), MIN_SAMPLES);
        assert_eq!(samples_that_fit(40 * second, Duration::ZERO), MAX_SAMPLES);
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
