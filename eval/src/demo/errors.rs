//! The error of each picture that the client kept against its reference.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, ensure};
use image::{
    RgbImage,
    imageops::{self, FilterType},
};

use super::{
    recorded::Sample,
    references::{Reference, View},
    window::Window,
    write,
};
use crate::{FlipMap, flip, mean_squared_error, psnr_from_mean_squared_error, ssim};

/// Samples that get a picture of client, reference and error side by side.
const SHOWN: usize = 6;
/// Windows are enlarged by a whole factor to about this many pixels there.
const SHOWN_SIDE: u32 = 240;
/// Pixels between pictures side by side.
const GAP: u32 = 4;

/// A window of one picture of the client against its reference.
#[derive(Clone, Debug)]
pub(super) struct SampleError {
    pub(super) picture: String,
    pub(super) eye: String,
    pub(super) seconds: f64,
    pub(super) pose_age_ms: f64,
    pub(super) frame: u32,
    pub(super) window: Window,
    pub(super) mean_squared_error: f64,
    pub(super) ssim: f64,
    pub(super) flip: f64,
    /// Of the last server view as it is, at the server's pose.
    pub(super) flip_unwarped: f64,
    /// Mean squared error that noise gives the reference itself.
    pub(super) reference_noise: f64,
}

impl SampleError {
    pub(super) fn psnr_db(&self) -> f64 {
        psnr_from_mean_squared_error(self.mean_squared_error)
    }
}

/// What the references of the samples' windows are taken from.
pub(super) fn views(samples: &[Sample], windows: &[Window]) -> Result<Vec<View>> {
    samples
        .iter()
        .zip(windows)
        .map(|(sample, window)| {
            Ok(View {
                camera: window.camera(&sample.camera()),
                scene_time: sample.scene_time()?,
            })
        })
        .collect()
}

/// Measures the window of every sample against its reference. Writes the
/// reference beside the sample, and `compare_*.png`.
pub(super) fn measure(
    out: &Path,
    samples: &[Sample],
    windows: &[Window],
    references: &[Reference],
) -> Result<Vec<SampleError>> {
    let shown = shown(samples.len());
    let mut errors = Vec::with_capacity(samples.len());
    let with_window = samples.iter().zip(windows).zip(references);
    for (index, ((sample, &window), reference)) in with_window.enumerate() {
        let picture = part(out, &sample.picture, sample, window)?;
        let unwarped = part(out, &sample.unwarped, sample, window)?;
        let map = flip(&reference.picture, &picture)?;
        errors.push(error(sample, window, &picture, &unwarped, reference, &map)?);
        save(&reference_path(out, sample), &reference.picture)?;
        if let Some(number) = shown.iter().position(|&shown| shown == index) {
            let row = side_by_side(&[&picture, &reference.picture, &map.picture()]);
            save(&out.join(format!("compare_{number:02}.png")), &row)?;
        }
    }
    Ok(errors)
}

/// The window of a picture that the client wrote.
fn part(out: &Path, name: &str, sample: &Sample, window: Window) -> Result<RgbImage> {
    let picture = read(&out.join(name))?;
    let camera = sample.camera();
    ensure!(
        picture.dimensions() == (camera.width, camera.height),
        "{name} does not match its record"
    );
    Ok(window.of(&picture))
}

fn error(
    sample: &Sample,
    window: Window,
    picture: &RgbImage,
    unwarped: &RgbImage,
    reference: &Reference,
    map: &FlipMap,
) -> Result<SampleError> {
    Ok(SampleError {
        picture: sample.picture.clone(),
        eye: sample.eye.clone(),
        seconds: sample.seconds,
        pose_age_ms: sample.pose_age_ms,
        frame: sample.frame,
        window,
        mean_squared_error: mean_squared_error(&reference.picture, picture)?,
        ssim: ssim(&reference.picture, picture)?,
        flip: map.mean(),
        flip_unwarped: flip(&reference.picture, unwarped)?.mean(),
        reference_noise: reference.noise()?,
    })
}

/// Indices of the samples that are shown, from the first to the last.
fn shown(samples: usize) -> Vec<usize> {
    let count = SHOWN.min(samples);
    (0..count)
        .map(|i| i * (samples - 1) / (count - 1).max(1))
        .collect()
}

/// `samples/00.png` has its reference in `samples/00_reference.png`.
fn reference_path(out: &Path, sample: &Sample) -> PathBuf {
    let picture = out.join(&sample.picture);
    let stem = picture.file_stem().unwrap_or_default().to_string_lossy();
    picture.with_file_name(format!("{stem}_reference.png"))
}

/// Pictures of one size in a row, each pixel enlarged to a square where they are small.
fn side_by_side(pictures: &[&RgbImage]) -> RgbImage {
    let (width, height) = pictures.first().map_or((1, 1), |first| first.dimensions());
    let factor = (SHOWN_SIDE / width.max(height).max(1)).max(1);
    let (width, height) = (width * factor, height * factor);
    let mut row = RgbImage::new((width + GAP) * pictures.len() as u32 - GAP, height);
    let mut x = 0;
    for picture in pictures {
        let enlarged = imageops::resize(*picture, width, height, FilterType::Nearest);
        imageops::replace(&mut row, &enlarged, x, 0);
        x += i64::from(width + GAP);
    }
    row
}

/// One row a sample.
pub(super) fn write_csv(path: &Path, errors: &[SampleError]) -> Result<()> {
    let mut csv = String::from(
        "picture,eye,frame,seconds,pose_age_ms,x,y,side,mse,ssim,flip,flip_unwarped,reference_noise_mse\n",
    );
    for error in errors {
        writeln!(
            csv,
            "{},{},{},{:.3},{:.2},{},{},{},{:.3e},{:.5},{:.5},{:.5},{:.3e}",
            error.picture,
            error.eye,
            error.frame,
            error.seconds,
            error.pose_age_ms,
            error.window.x,
            error.window.y,
            error.window.width,
            error.mean_squared_error,
            error.ssim,
            error.flip,
            error.flip_unwarped,
            error.reference_noise,
        )?;
    }
    write(path, &csv)
}

fn read(path: &Path) -> Result<RgbImage> {
    let picture = image::open(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(picture.into_rgb8())
}

fn save(path: &Path, picture: &RgbImage) -> Result<()> {
    picture
        .save(path)
        .with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_and_last_are_shown() {
        assert_eq!(shown(24), [0, 4, 9, 13, 18, 23]);
        assert_eq!(shown(3), [0, 1, 2]);
        assert_eq!(shown(1), [0]);
        assert!(shown(0).is_empty());
    }

    #[test]
    fn pictures_lie_enlarged_side_by_side() {
        let plain = |level| RgbImage::from_pixel(80, 40, image::Rgb([level; 3]));
        let row = side_by_side(&[&plain(1), &plain(2)]);
        assert_eq!(row.dimensions(), (240 + GAP + 240, 120));
        assert_eq!(row.get_pixel(239, 119).0[0], 1);
        assert_eq!(row.get_pixel(240, 0).0[0], 0);
        assert_eq!(row.get_pixel(240 + GAP, 119).0[0], 2);
        let large = RgbImage::new(300, 300);
        assert_eq!(side_by_side(&[&large]).dimensions(), (300, 300));
    }
}
