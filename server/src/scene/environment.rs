//! A picture of all directions: what is seen beyond the scene.

use std::{f32::consts::PI, path::Path};

use glam::{Vec2, Vec3, Vec3A, vec2};
use image::{ImageError, ImageReader, Limits};
use thiserror::Error;

/// Longest side of a picture, pixels.
const LONGEST_SIDE: u32 = 16_384;
/// Most memory that decoding one may take: a picture of the longest side by half
/// of it, as RGBA in single precision.
const MOST_BYTES: u64 = 16_384 * 8_192 * 16;

/// Radiance by direction, equirectangular: up is the first row, +X the middle
/// column, and +Z a quarter of the width to the right of it.
#[derive(Clone, PartialEq)]
pub struct EnvironmentMap {
    width: u32,
    height: u32,
    /// W/(sr m²), linear Rec.709, row by row; finite and not negative.
    radiance: Vec<Vec3>,
}

impl std::fmt::Debug for EnvironmentMap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "EnvironmentMap({}x{})", self.width, self.height)
    }
}

/// Why a picture cannot light a scene.
#[derive(Debug, Error)]
pub enum EnvironmentError {
    /// It is damaged, or no picture of a kind that is known.
    #[error("it cannot be read as a Radiance or OpenEXR picture ({0})")]
    Image(#[from] ImageError),
    /// The file cannot be opened.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// Its pixels do not make its size.
    #[error("{pixels} pixels are not {width} by {height}")]
    Size {
        /// Pixels that there are.
        pixels: usize,
        /// Pixels a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// A pixel is no radiance.
    #[error("the pixel in column {x} of row {y} is {value}, not a finite radiance")]
    NotFinite {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// What it is.
        value: Vec3,
    },
}

impl EnvironmentMap {
    /// A picture of `width` columns. Negative channels, which filters leave behind
    /// in dark places, count as none.
    ///
    /// # Errors
    /// When the size is not that of the pixels, or one of them is not finite.
    pub fn new(width: u32, height: u32, mut radiance: Vec<Vec3>) -> Result<Self, EnvironmentError> {
        let pixels = radiance.len();
        if pixels == 0 || pixels as u64 != u64::from(width) * u64::from(height) {
            return Err(EnvironmentError::Size {
                pixels,
                width,
                height,
            });
        }
        for (at, value) in (0..).zip(&mut radiance) {
            if !value.is_finite() {
                return Err(EnvironmentError::NotFinite {
                    x: at % width,
                    y: at / width,
                    value: *value,
                });
            }
            *value = value.max(Vec3::ZERO);
        }
        Ok(Self {
            width,
            height,
            radiance,
        })
    }

    /// Reads a Radiance (.hdr) or OpenEXR (.exr) file.
    ///
    /// # Errors
    /// When the file is no such picture, or as for [`Self::new`].
    pub fn load(path: &Path) -> Result<Self, EnvironmentError> {
        let mut limits = Limits::default();
        limits.max_image_width = Some(LONGEST_SIDE);
        limits.max_image_height = Some(LONGEST_SIDE);
        limits.max_alloc = Some(MOST_BYTES);
        let mut reader = ImageReader::open(path)?.with_guessed_format()?;
        reader.limits(limits);
        let picture = reader.decode()?.into_rgb32f();
        let radiance = picture.pixels().map(|pixel| Vec3::from(pixel.0)).collect();
        Self::new(picture.width(), picture.height(), radiance)
    }

    /// Columns and rows.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// W/(sr m²), row by row.
    #[must_use]
    pub fn pixels(&self) -> &[Vec3] {
        &self.radiance
    }

    /// The same picture with half as many columns and rows, of means.
    #[must_use]
    pub fn halved(&self) -> Self {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let pixel = |x: u32, y: u32| {
            let (x, y) = (x.min(self.width - 1), y.min(self.height - 1));
            self.radiance[(y * self.width + x) as usize]
        };
        let mean = |x: u32, y: u32| {
            (pixel(2 * x, 2 * y)
                + pixel(2 * x + 1, 2 * y)
                + pixel(2 * x, 2 * y + 1)
                + pixel(2 * x + 1, 2 * y + 1))
                * 0.25
        };
        let rows = 0..height;
        Self {
            width,
            height,
            radiance: rows
                .flat_map(|y| (0..width).map(move |x| (x, y)))
                .map(|(x, y)| mean(x, y))
                .collect(),
        }
    }

    /// Where a direction is found, from 0 to 1 along the sides. Twin of
    /// `environment_uv` in WGSL.
    #[must_use]
    pub fn uv(direction: Vec3) -> Vec2 {
        let across = vec2(direction.x, direction.z).length();
        vec2(
            direction.z.atan2(direction.x) / (2.0 * PI) + 0.5,
            across.atan2(direction.y) / PI,
        )
    }

    /// Mean radiance over all directions.
    #[must_use]
    pub fn mean(&self) -> Vec3 {
        let rows = self.radiance.chunks_exact(self.width as usize).zip(0_u16..);
        let (mut sum, mut weights) = (Vec3A::ZERO, 0.0);
        for (row, y) in rows {
            let weight = ((f32::from(y) + 0.5) / self.height as f32 * PI).sin();
            sum += row.iter().map(|pixel| Vec3A::from(*pixel)).sum::<Vec3A>() * weight;
            weights += weight * self.width as f32;
        }
        (sum / weights).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_lie_where_they_are_said_to() {
        for (direction, uv) in [
            (Vec3::X, vec2(0.5, 0.5)),
            (Vec3::Z, vec2(0.75, 0.5)),
            (Vec3::NEG_Z, vec2(0.25, 0.5)),
            (Vec3::new(1.0, 1.0, 0.0).normalize(), vec2(0.5, 0.25)),
        ] {
            assert!(EnvironmentMap::uv(direction).abs_diff_eq(uv, 1e-6));
        }
        assert!(EnvironmentMap::uv(Vec3::Y).y < 1e-6);
        assert!(EnvironmentMap::uv(Vec3::NEG_Y).y > 0.999_999);
    }

    #[test]
    fn halving_keeps_the_mean_and_odd_sides() {
        let pixels = (0..7 * 5).map(|i| Vec3::splat(i as f32)).collect();
        let picture = EnvironmentMap::new(7, 5, pixels).unwrap();
        assert_eq!(picture.halved().size(), [3, 2]);
        assert_eq!(picture.halved().pixels()[0], Vec3::splat(4.0));
        let one = EnvironmentMap::new(1, 1, vec![Vec3::ONE]).unwrap();
        assert_eq!(one.halved(), one);
        assert!(one.mean().abs_diff_eq(Vec3::ONE, 1e-6));
    }

    #[test]
    fn what_is_no_radiance_is_refused_by_its_place() {
        let mut pixels = vec![Vec3::ONE; 8];
        pixels[6].y = f32::INFINITY;
        let error = EnvironmentMap::new(4, 2, pixels.clone()).unwrap_err();
        assert!(error.to_string().contains("column 2 of row 1"), "{error}");
        assert!(EnvironmentMap::new(4, 3, pixels.clone()).is_err());
        assert!(EnvironmentMap::new(0, 0, Vec::new()).is_err());
        pixels[6].y = -1.0;
        let cut = EnvironmentMap::new(4, 2, pixels).unwrap();
        assert_eq!(cut.pixels()[6].y, 0.0);
    }
}
