//! Errors of linear radiance.

use glam::Vec3;

/// Share of the reference's mean square below which a pixel's own square no
/// longer makes its error relative: darkness does not count without bound.
const DARK: f64 = 0.01;

/// Root of the mean squared difference over pixels and channels; both are of one size.
#[must_use]
pub fn rmse(found: &[Vec3], reference: &[Vec3]) -> f64 {
    let sum: f64 = squared_differences(found, reference)
        .map(|(square, _)| square)
        .sum();
    (sum / (found.len() * 3) as f64).sqrt()
}

/// Mean squared difference relative to the reference's square (Rousselle et al.,
/// 2011), with an epsilon of a hundredth of the reference's mean square, so that
/// the unit of radiance does not matter. Where the reference is all black, any light
/// is infinitely too much.
#[must_use]
pub fn relmse(found: &[Vec3], reference: &[Vec3]) -> f64 {
    let count = (found.len() * 3) as f64;
    let mean_square: f64 = squared_differences(found, reference)
        .map(|(_, square)| square)
        .sum::<f64>()
        / count;
    if mean_square == 0.0 {
        let is_black = found.iter().all(|light| *light == Vec3::ZERO);
        return if is_black { 0.0 } else { f64::INFINITY };
    }
    let epsilon = DARK * mean_square;
    let sum: f64 = squared_differences(found, reference)
        .map(|(difference, square)| difference / (square + epsilon))
        .sum();
    sum / count
}

/// Of each channel: the squared difference, and the reference's square.
fn squared_differences<'a>(
    found: &'a [Vec3],
    reference: &'a [Vec3],
) -> impl Iterator<Item = (f64, f64)> + 'a {
    assert_eq!(found.len(), reference.len(), "pictures of one size");
    let channels = |pixels: &'a [Vec3]| pixels.iter().flat_map(|p| p.to_array()).map(f64::from);
    channels(found)
        .zip(channels(reference))
        .map(|(a, b)| ((a - b).powi(2), b.powi(2)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_those_of_their_definitions() {
        let reference = vec![Vec3::ONE, Vec3::splat(3.0)];
        let found = vec![Vec3::splat(2.0), Vec3::splat(3.0)];
        assert!((rmse(&found, &reference) - 0.5_f64.sqrt()).abs() < 1e-12);
        let epsilon = 0.01 * 5.0;
        assert!((relmse(&found, &reference) - 0.5 / (1.0 + epsilon)).abs() < 1e-12);
        let scaled = |pixels: &[Vec3]| pixels.iter().map(|p| *p * 1e6).collect::<Vec<_>>();
        let in_another_unit = relmse(&scaled(&found), &scaled(&reference));
        assert!((in_another_unit - relmse(&found, &reference)).abs() < 1e-6);
        assert_eq!(relmse(&[Vec3::ZERO], &[Vec3::ZERO]), 0.0);
        assert_eq!(relmse(&[Vec3::X], &[Vec3::ZERO]), f64::INFINITY);
    }
}
