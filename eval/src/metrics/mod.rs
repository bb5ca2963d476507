//! Error between a picture and its reference, both 8-bit sRGB.

mod flip;
mod linear;
mod ssim;

use image::RgbImage;
use thiserror::Error;

pub use flip::{FlipMap, flip};
pub use linear::{relmse, rmse};
pub use ssim::ssim;

/// Why two pictures cannot be compared.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum MetricError {
    /// The pictures have no common grid of pixels.
    #[error("a picture of {}x{} pixels cannot be compared with one of {}x{}", .one[0], .one[1], .other[0], .other[1])]
    SizeMismatch {
        /// Width and height of the first picture.
        one: [u32; 2],
        /// Width and height of the second picture.
        other: [u32; 2],
    },
    /// The pictures are smaller than the metric's window.
    #[error("pictures of {}x{} pixels are too small: the metric needs {needed} pixels a side", .size[0], .size[1])]
    TooSmall {
        /// Width and height of the pictures.
        size: [u32; 2],
        /// Fewest pixels a side.
        needed: u32,
    },
}

/// Mean over pixels and channels of the squared difference, sRGB values in 0..=1.
///
/// # Errors
/// When the sizes differ or the pictures are empty.
pub fn mean_squared_error(one: &RgbImage, other: &RgbImage) -> Result<f64, MetricError> {
    comparable(one, other, 1)?;
    let sum: u64 = one
        .as_raw()
        .iter()
        .zip(other.as_raw())
        .map(|(&a, &b)| u64::from(a.abs_diff(b)).pow(2))
        .sum();
    Ok(sum as f64 / one.as_raw().len() as f64 / (255.0 * 255.0))
}

/// Peak signal-to-noise ratio of sRGB values in dB; infinite for equal pictures.
///
/// # Errors
/// When the sizes differ or the pictures are empty.
pub fn psnr(one: &RgbImage, other: &RgbImage) -> Result<f64, MetricError> {
    mean_squared_error(one, other).map(psnr_from_mean_squared_error)
}

/// The ratio in dB for a mean squared error of values in 0..=1.
#[must_use]
pub fn psnr_from_mean_squared_error(mean_squared_error: f64) -> f64 {
    -10.0 * mean_squared_error.log10()
}

/// Checks that the sizes are equal and at least `needed` pixels a side.
fn comparable(one: &RgbImage, other: &RgbImage, needed: u32) -> Result<(), MetricError> {
    let size = [one.width(), one.height()];
    if one.dimensions() != other.dimensions() {
        return Err(MetricError::SizeMismatch {
            one: size,
            other: [other.width(), other.height()],
        });
    }
    if size.iter().any(|&side| side < needed) {
        return Err(MetricError::TooSmall { size, needed });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use image::Rgb;
    use proptest::prelude::*;

    use super::*;

    const BLACK: [u8; 3] = [0; 3];
    const WHITE: [u8; 3] = [255; 3];

    pub(super) fn plain(color: [u8; 3]) -> RgbImage {
        RgbImage::from_pixel(16, 16, Rgb(color))
    }

    /// Pictures of 16x12 pixels with any content.
    pub(super) fn any_picture() -> impl Strategy<Value = RgbImage> {
        prop::collection::vec(any::<u8>(), 16 * 12 * 3)
            .prop_map(|bytes| RgbImage::from_raw(16, 12, bytes).expect("16 x 12 x 3 bytes"))
    }

    #[test]
    fn known_ratios() {
        assert_eq!(psnr(&plain(BLACK), &plain(WHITE)), Ok(0.0));
        assert_eq!(psnr(&plain(WHITE), &plain(WHITE)), Ok(f64::INFINITY));
        // A difference of one level everywhere is 20 log10(255) dB.
        let close = psnr(&plain([100; 3]), &plain([101; 3])).unwrap();
        assert!((close - 48.1308).abs() < 1e-3, "{close}");
        // In one channel of three it is 10 log10(3) dB better.
        let closer = psnr(&plain([100; 3]), &plain([100, 101, 100])).unwrap();
        assert!((closer - close - 4.7712).abs() < 1e-3, "{closer}");
    }

    #[test]
    fn sizes_must_match() {
        let small = RgbImage::new(16, 8);
        let mismatch = MetricError::SizeMismatch {
            one: [16, 16],
            other: [16, 8],
        };
        assert_eq!(psnr(&plain(BLACK), &small).as_ref(), Err(&mismatch));
        assert_eq!(ssim(&plain(BLACK), &small).as_ref(), Err(&mismatch));
        assert_eq!(
            flip(&plain(BLACK), &small).map(|map| map.mean()).as_ref(),
            Err(&mismatch)
        );
        let none = RgbImage::new(0, 0);
        assert!(matches!(
            psnr(&none, &none),
            Err(MetricError::TooSmall { .. })
        ));
    }

    proptest! {
        #[test]
        fn symmetric_and_zero_only_for_equals(one in any_picture(), other in any_picture()) {
            prop_assert_eq!(mean_squared_error(&one, &other), mean_squared_error(&other, &one));
            prop_assert_eq!(mean_squared_error(&one, &one), Ok(0.0));
            prop_assert_eq!(mean_squared_error(&one, &other) == Ok(0.0), one == other);
        }
    }
}
