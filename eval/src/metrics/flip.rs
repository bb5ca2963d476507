//! What an eye sees of a difference when it flips between two pictures.
//!
//! Andersson et al., "FLIP: A Difference Evaluator for Alternating Images",
//! 2020, by the authors' own implementation at its default of 67 pixels a
//! degree: a monitor at arm's length, which forgives less than a headset with
//! fewer pixels a degree would.

use image::RgbImage;
use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageFloat, FlipImageRgb8};

use super::{MetricError, comparable};

/// The perceived error of every pixel, 0 to 1.
pub struct FlipMap(FlipImageFloat);

impl FlipMap {
    /// Mean over all pixels.
    #[must_use]
    pub fn mean(&self) -> f64 {
        let errors = self.0.to_vec();
        errors.iter().copied().map(f64::from).sum::<f64>() / errors.len() as f64
    }

    /// The map in the colours that the authors use: black for no error, then
    /// purple, orange and pale yellow.
    #[must_use]
    pub fn picture(&self) -> RgbImage {
        let colored = self.0.apply_color_lut(&nv_flip::magma_lut());
        RgbImage::from_raw(colored.width(), colored.height(), colored.to_vec())
            .expect("the colours are three bytes a pixel of the map")
    }
}

/// Error of `test` against `reference`.
///
/// # Errors
/// When the sizes differ or the pictures are empty.
pub fn flip(reference: &RgbImage, test: &RgbImage) -> Result<FlipMap, MetricError> {
    comparable(reference, test, 1)?;
    let of = |picture: &RgbImage| {
        FlipImageRgb8::with_data(picture.width(), picture.height(), picture.as_raw())
    };
    Ok(FlipMap(nv_flip::flip(
        of(reference),
        of(test),
        DEFAULT_PIXELS_PER_DEGREE,
    )))
}

#[cfg(test)]
mod tests {
    use super::super::tests::plain;
    use super::*;

    fn mean(reference: [u8; 3], test: [u8; 3]) -> f64 {
        flip(&plain(reference), &plain(test)).unwrap().mean()
    }

    const RED: [u8; 3] = [255, 0, 0];
    const GREEN: [u8; 3] = [0, 255, 0];
    const BLUE: [u8; 3] = [0, 0, 255];

    #[test]
    fn equal_pictures_have_no_error() {
        assert_eq!(mean([10, 200, 90], [10, 200, 90]), 0.0);
    }

    #[test]
    fn black_and_white_differ_strongly() {
        assert!(mean([0; 3], [255; 3]) > 0.9);
    }

    /// FLIP scales its colour differences by the largest there is, that of
    /// green and blue, so these two are at 1. Were red and blue exchanged on
    /// the way in, red and green would be.
    #[test]
    fn channels_come_in_the_order_of_red_green_blue() {
        let green_blue = mean(GREEN, BLUE);
        let red_green = mean(RED, GREEN);
        let red_blue = mean(RED, BLUE);
        assert!(green_blue > 0.999, "{green_blue}");
        assert!(red_green < green_blue - 0.01, "{red_green}");
        assert!(red_blue < green_blue - 0.01, "{red_blue}");
    }

    #[test]
    fn the_map_shows_where() {
        let mut test = plain([0; 3]);
        for y in 0..16 {
            for x in 8..16 {
                test.put_pixel(x, y, image::Rgb([255; 3]));
            }
        }
        let map = flip(&plain([0; 3]), &test).unwrap().picture();
        let brightness = |x| {
            map.get_pixel(x, 8)
                .0
                .iter()
                .map(|&v| u32::from(v))
                .sum::<u32>()
        };
        assert!(brightness(15) > 2 * brightness(0));
    }
}
