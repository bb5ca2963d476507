//! Structural similarity with the constants of the shading atlas paper.
//!
//! Gaussian window of 11 pixels with sigma 2, C1 = 0.0001 and C2 = 0.0009 on
//! values in 0..=1 (Mueller et al., "Shading Atlas Streaming", 2018, section
//! 5.6; Wang et al., "Image quality assessment", 2004). The paper does not say
//! which values: this takes the Rec.709 luma of the sRGB values, and the mean
//! over the windows that lie wholly within the picture, as Wang does.

use image::RgbImage;

use super::{MetricError, comparable};

const WINDOW: usize = 11;
const SIGMA: f64 = 2.0;
const C1: f64 = 0.0001;
const C2: f64 = 0.0009;

/// Mean structural similarity of luma, 1 for equal pictures.
///
/// # Errors
/// When the sizes differ or a side is shorter than the window of 11 pixels.
pub fn ssim(one: &RgbImage, other: &RgbImage) -> Result<f64, MetricError> {
    comparable(one, other, WINDOW as u32)?;
    let (x, y) = (Plane::luma(one), Plane::luma(other));
    let weights = gaussian();
    let mean_x = x.filtered(&weights);
    let mean_y = y.filtered(&weights);
    let mean_xx = x.times(&x).filtered(&weights);
    let mean_yy = y.times(&y).filtered(&weights);
    let mean_xy = x.times(&y).filtered(&weights);
    let windows = mean_x.values.len();
    let sum: f64 = (0..windows)
        .map(|i| {
            let (mx, my) = (mean_x.values[i], mean_y.values[i]);
            let variance_x = mean_xx.values[i] - mx * mx;
            let variance_y = mean_yy.values[i] - my * my;
            let covariance = mean_xy.values[i] - mx * my;
            (2.0 * mx * my + C1) * (2.0 * covariance + C2)
                / ((mx * mx + my * my + C1) * (variance_x + variance_y + C2))
        })
        .sum();
    Ok(sum / windows as f64)
}

/// One number a pixel, row by row.
struct Plane {
    width: usize,
    values: Vec<f64>,
}

impl Plane {
    fn luma(picture: &RgbImage) -> Self {
        let values = picture.pixels().map(|pixel| {
            let [r, g, b] = pixel.0.map(|value| f64::from(value) / 255.0);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        });
        Self {
            width: picture.width() as usize,
            values: values.collect(),
        }
    }

    fn times(&self, other: &Self) -> Self {
        let products = self.values.iter().zip(&other.values).map(|(a, b)| a * b);
        Self {
            width: self.width,
            values: products.collect(),
        }
    }

    /// The weighted mean of every window that lies wholly within the plane.
    fn filtered(&self, weights: &[f64; WINDOW]) -> Self {
        let width = self.width + 1 - WINDOW;
        let rows: Vec<f64> = self
            .values
            .chunks_exact(self.width)
            .flat_map(|row| row.windows(WINDOW))
            .map(|window| window.iter().zip(weights).map(|(v, w)| v * w).sum())
            .collect();
        let values = (0..rows.len() - (WINDOW - 1) * width)
            .map(|i| (0..WINDOW).map(|k| rows[i + k * width] * weights[k]).sum());
        Self {
            width,
            values: values.collect(),
        }
    }
}

/// Weights that sum to one.
fn gaussian() -> [f64; WINDOW] {
    let middle = (WINDOW / 2) as f64;
    let weights: [f64; WINDOW] = std::array::from_fn(|i| {
        let distance = i as f64 - middle;
        (-distance * distance / (2.0 * SIGMA * SIGMA)).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

#[cfg(test)]
mod tests {
    use image::Rgb;
    use proptest::prelude::*;

    use super::super::tests::{any_picture, plain};
    use super::*;

    #[test]
    fn plain_pictures_differ_by_their_means_alone() {
        // Without variance the second factor is one and the first is
        // (2ab + C1) / (a² + b² + C1).
        let black_white = ssim(&plain([0; 3]), &plain([255; 3])).unwrap();
        assert!(
            (black_white - C1 / (1.0 + C1)).abs() < 1e-9,
            "{black_white}"
        );
        let (a, b) = (51.0 / 255.0, 102.0 / 255.0);
        let grey = ssim(&plain([51; 3]), &plain([102; 3])).unwrap();
        let expected = (2.0 * a * b + C1) / (a * a + b * b + C1);
        assert!((grey - expected).abs() < 1e-9, "{grey}");
    }

    #[test]
    fn an_inverted_checkerboard_is_anticorrelated() {
        let board =
            |phase| RgbImage::from_fn(32, 32, |x, y| Rgb([((x + y + phase) % 2) as u8 * 255; 3]));
        let inverted = ssim(&board(0), &board(1)).unwrap();
        assert!((-1.0..-0.99).contains(&inverted), "{inverted}");
    }

    /// The value comes from the definition written out in another language,
    /// with a two-dimensional window and central moments.
    #[test]
    fn a_known_pair() {
        let picture = |of: fn(u32, u32) -> [u32; 3]| {
            RgbImage::from_fn(16, 12, |x, y| Rgb(of(x, y).map(|value| value as u8)))
        };
        let one = picture(|x, y| [x * 7 + y * 13, x * y, x * 3]);
        let other = picture(|x, y| [x * 11 + y * 5, x * y + 40, y * 9]);
        let known = ssim(&one, &other).unwrap();
        assert!((known - 0.9173524382).abs() < 1e-9, "{known}");
    }

    #[test]
    fn the_window_must_fit() {
        let small = RgbImage::new(11, 10);
        assert_eq!(
            ssim(&small, &small),
            Err(MetricError::TooSmall {
                size: [11, 10],
                needed: 11
            })
        );
        let just = RgbImage::new(11, 11);
        assert_eq!(ssim(&just, &just), Ok(1.0));
    }

    proptest! {
        #[test]
        fn symmetric_bounded_and_one_for_equals(one in any_picture(), other in any_picture()) {
            let forth = ssim(&one, &other).unwrap();
            let back = ssim(&other, &one).unwrap();
            prop_assert!((forth - back).abs() < 1e-12);
            prop_assert!((-1.0..=1.0).contains(&forth));
            prop_assert!((ssim(&one, &one).unwrap() - 1.0).abs() < 1e-12);
        }
    }
}
