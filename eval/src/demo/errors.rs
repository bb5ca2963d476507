//! The error of each picture that the client kept against its reference.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};
use image::{RgbImage, imageops};
use indicatif::{ProgressBar, ProgressStyle};

use super::{
    recorded::Sample,
    references::{Reference, References},
    write,
};
use crate::{FlipMap, flip, psnr, ssim};

/// Samples that get a picture of client, reference and error side by side.
const COMPARED: usize = 3;
/// Pixels between pictures side by side.
const GAP: u32 = 4;

/// One picture of the client against its reference.
#[derive(Clone, Debug)]
pub(super) struct SampleError {
    pub(super) picture: String,
    pub(super) eye: String,
    pub(super) seconds: f64,
    pub(super) pose_age_ms: f64,
    pub(super) frame: u32,
    pub(super) psnr_db: f64,
    pub(super) ssim: f64,
    pub(super) flip: f64,
    /// Of the last server view as it is, at the server's pose.
    pub(super) flip_unwarped: f64,
    /// Mean squared error that noise gives the reference itself.
    pub(super) reference_noise: f64,
}

/// Renders a reference for every sample and measures the sample against it.
/// Writes the reference beside the sample, and `compare_*.png`.
pub(super) fn measure(
    out: &Path,
    samples: &[Sample],
    references: &mut References,
) -> Result<Vec<SampleError>> {
    let Some(first) = samples.first() else {
        return Ok(Vec::new());
    };
    references.plan(&first.camera(), samples.len())?;
    let bar = progress_bar(2 * samples.len() as u64, references.samples_per_pixel());
    let compared = compared(samples.len());
    let mut errors = Vec::with_capacity(samples.len());
    for (index, sample) in samples.iter().enumerate() {
        let reference =
            references.render(index as u32, &sample.camera(), sample.scene_time()?, || {
                bar.inc(1)
            })?;
        let picture = read(&out.join(&sample.picture))?;
        let unwarped = read(&out.join(&sample.unwarped))?;
        let map = flip(&reference.picture, &picture)
            .with_context(|| format!("{} does not match its record", sample.picture))?;
        errors.push(error(sample, &picture, &unwarped, &reference, &map)?);
        save(&reference_path(out, sample), &reference.picture)?;
        if let Some(number) = compared.iter().position(|&compared| compared == index) {
            let row = side_by_side(&[&picture, &reference.picture, &map.picture()]);
            save(&out.join(format!("compare_{number:02}.png")), &row)?;
        }
    }
    bar.finish_and_clear();
    Ok(errors)
}

fn error(
    sample: &Sample,
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
        psnr_db: psnr(&reference.picture, picture)?,
        ssim: ssim(&reference.picture, picture)?,
        flip: map.mean(),
        flip_unwarped: flip(&reference.picture, unwarped)
            .with_context(|| format!("{} does not match its record", sample.unwarped))?
            .mean(),
        reference_noise: reference.noise()?,
    })
}

/// Indices of the samples that are compared in a picture: first, middle, last.
fn compared(samples: usize) -> Vec<usize> {
    let count = COMPARED.min(samples);
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

fn side_by_side(pictures: &[&RgbImage]) -> RgbImage {
    let width = pictures
        .iter()
        .map(|picture| picture.width() + GAP)
        .sum::<u32>()
        - GAP;
    let height = pictures.iter().map(|picture| picture.height()).max();
    let mut row = RgbImage::new(width, height.unwrap_or(0));
    let mut x = 0;
    for picture in pictures {
        imageops::replace(&mut row, *picture, x.into(), 0);
        x += picture.width() + GAP;
    }
    row
}

/// One row a sample.
pub(super) fn write_csv(path: &Path, errors: &[SampleError]) -> Result<()> {
    let mut csv = String::from(
        "picture,eye,frame,seconds,pose_age_ms,psnr_db,ssim,flip,flip_unwarped,reference_noise_mse\n",
    );
    for error in errors {
        writeln!(
            csv,
            "{},{},{},{:.3},{:.2},{:.3},{:.5},{:.5},{:.5},{:.3e}",
            error.picture,
            error.eye,
            error.frame,
            error.seconds,
            error.pose_age_ms,
            error.psnr_db,
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

fn progress_bar(halves: u64, samples_per_pixel: u32) -> ProgressBar {
    let style = ProgressStyle::with_template("references {msg} {wide_bar} {pos}/{len} {eta}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(halves)
        .with_style(style)
        .with_message(format!("of {samples_per_pixel} samples a pixel"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_middle_and_last_are_compared() {
        assert_eq!(compared(24), [0, 11, 23]);
        assert_eq!(compared(3), [0, 1, 2]);
        assert_eq!(compared(2), [0, 1]);
        assert_eq!(compared(1), [0]);
        assert!(compared(0).is_empty());
    }

    #[test]
    fn pictures_lie_side_by_side() {
        let plain = |level| RgbImage::from_pixel(2, 3, image::Rgb([level; 3]));
        let row = side_by_side(&[&plain(1), &plain(2)]);
        assert_eq!(row.dimensions(), (2 + GAP + 2, 3));
        assert_eq!(row.get_pixel(0, 0).0[0], 1);
        assert_eq!(row.get_pixel(2, 0).0[0], 0);
        assert_eq!(row.get_pixel(2 + GAP, 2).0[0], 2);
    }
}
