//! How many texels a patch deserves, seen from an eye. Twin of `footprint.wgsl`.
//!
//! Shading is stored in the atlas and looked at on the screen, so that a block
//! should have about as many texels as its patch covers pixels, and the same
//! proportions. Lengths are angles times pixels per radian: they do not depend
//! on where the eye looks, only on where it is.
//!
//! Source: Mueller et al., "Shading Atlas Streaming", 2018, section 4.3,
//! equation 1. We differ in giving a side of `n` pixels `n + 1` texels, because
//! the outer ones lie on the patch's edges. The kernel counts in 32 bits and
//! differs by a step now and then, by more only on needles and on edges that
//! point at the eye, whose blocks are among the smallest anyhow.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use super::Wish;

/// Pixels below which a length counts as this: as good as nothing, and its
/// reciprocal is finite.
const SMALLEST: f32 = 1e-3;

/// From where patches are measured.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct FootprintParameters {
    /// Length of the list.
    pub patch_count: u32,
    /// In the middle of the eye's picture.
    pub pixels_per_radian: f32,
    /// Zero.
    pub padding: [u32; 2],
}

/// Length of an edge in pixels of a sphere about the eye (equation 1): never
/// negative, never NaN. An edge that touches the eye counts as a right angle,
/// the limit of walking up to its end squarely.
#[must_use]
pub fn edge_pixels(a: Vec3, b: Vec3, eye: Vec3, pixels_per_radian: f32) -> f32 {
    let eye = eye.as_dvec3();
    let (to_a, to_b) = (a.as_dvec3() - eye, b.as_dvec3() - eye);
    let angle = if a == b {
        0.0
    } else if to_a == DVec3::ZERO || to_b == DVec3::ZERO {
        std::f64::consts::FRAC_PI_2
    } else {
        // Crossing with the edge itself keeps the small angles that crossing
        // two nearly parallel rays would cancel.
        to_a.cross(to_b - to_a).length().atan2(to_a.dot(to_b))
    };
    let pixels = angle as f32 * pixels_per_radian;
    if pixels.is_nan() {
        0.0
    } else {
        pixels.max(0.0)
    }
}

/// The block that a patch with these corners deserves: shape 0 solo, 1 pair,
/// 2 triple. Unused corners do not matter; corners and eye are in one space.
///
/// The triangles of a pair and of a triple fill their block, so that its area
/// is their sum; a solo triangle fills half of it. Width and height are the
/// longest edges that run along them in the layout; the two upper edges of a
/// triple together span its width.
#[must_use]
pub fn footprint(shape: u32, corners: &[Vec3; 5], eye: Vec3, pixels_per_radian: f32) -> Wish {
    let edge = |a: usize, b: usize| edge_pixels(corners[a], corners[b], eye, pixels_per_radian);
    let (area, width, height) = match shape {
        0 => {
            let (width, height) = (edge(0, 1), edge(0, 2));
            let area = 2.0 * triangle_area(width, height, edge(1, 2));
            (area, width, height)
        }
        1 => {
            let (top, right, bottom, left) = (edge(0, 1), edge(1, 2), edge(2, 3), edge(3, 0));
            let diagonal = edge(1, 3);
            let area = triangle_area(top, diagonal, left) + triangle_area(right, bottom, diagonal);
            (area, top.max(bottom), left.max(right))
        }
        _ => {
            let (top_left, top_right) = (edge(0, 1), edge(1, 2));
            let (right, bottom, left) = (edge(2, 3), edge(3, 4), edge(4, 0));
            let (falling, rising) = (edge(1, 3), edge(1, 4));
            let area = triangle_area(top_left, rising, left)
                + triangle_area(falling, bottom, rising)
                + triangle_area(top_right, right, falling);
            (area, (top_left + top_right).max(bottom), left.max(right))
        }
    };
    // The outer texels lie on the patch's edges: n of them stand n - 1 apart.
    let (width, height) = (width.max(SMALLEST), height.max(SMALLEST));
    let area = area.max(SMALLEST * SMALLEST) * (1.0 + width.recip()) * (1.0 + height.recip());
    let (width, height) = (width + 1.0, height + 1.0);
    let log2 = |x: f32| x.clamp(f32::MIN_POSITIVE, f32::MAX).log2();
    Wish::new(log2(area), log2(width) - log2(height))
}

/// Heron's formula in Kahan's order, which stays exact for needles; zero where
/// the lengths make no triangle.
pub(crate) fn triangle_area(a: f32, b: f32, c: f32) -> f32 {
    let mut sides = [a, b, c].map(f64::from);
    sides.sort_by(|x, y| y.total_cmp(x));
    let [a, b, c] = sides;
    let product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    (0.25 * product.max(0.0).sqrt()) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::atlas::OCTAVE;
    use proptest::prelude::*;

    const UNIT_PAIR: [Vec3; 5] = [
        Vec3::ZERO,
        Vec3::X,
        Vec3::new(1.0, 1.0, 0.0),
        Vec3::Y,
        Vec3::Y,
    ];

    fn octaves(wish: Wish) -> (f32, f32) {
        let octave = OCTAVE as f32;
        (wish.area() as f32 / octave, wish.aspect() as f32 / octave)
    }

    #[test]
    fn an_edge_is_as_long_as_its_angle() {
        let eye = Vec3::new(0.0, 0.0, 1.0);
        let right_angle = edge_pixels(Vec3::X - eye, -Vec3::X - eye, -eye, 100.0);
        assert!((right_angle - std::f32::consts::PI * 100.0).abs() < 1e-3);
        assert!((edge_pixels(Vec3::ZERO, Vec3::X, eye, 100.0) - 78.54).abs() < 1e-2);
        assert_eq!(edge_pixels(Vec3::X, Vec3::X, eye, 100.0), 0.0);
        assert_eq!(edge_pixels(eye, eye, eye, 100.0), 0.0);
        let touching = edge_pixels(eye, Vec3::X, eye, 100.0);
        assert!((touching - 157.08).abs() < 1e-2);
    }

    #[test]
    fn small_edges_far_away_keep_their_digits() {
        // A millimetre at 10 km: 1e-7 rad, far below what acos can tell from 0.
        let a = Vec3::new(0.0, 0.0, -1e4);
        let pixels = edge_pixels(a, a + Vec3::new(1e-3, 0.0, 0.0), Vec3::ZERO, 1e7);
        assert!((pixels - 1.0).abs() < 1e-5);
        // The same picture 100 km from the origin, on coordinates floats have.
        let there = Vec3::new(1e5, -1e5, 1e5);
        let [near, far] = [Vec3::ZERO, there]
            .map(|o| edge_pixels(o, o + Vec3::X, o + Vec3::new(0.0, 0.0, 8.0), 500.0));
        assert_eq!(near, far);
    }

    #[test]
    fn a_square_metre_gets_its_pixels_and_one_more_a_side() {
        let eye = Vec3::new(0.5, 0.5, 10.0);
        let (area, aspect) = octaves(footprint(1, &UNIT_PAIR, eye, 640.0));
        let square = 2.0 * 65_f32.log2();
        assert!((area - square).abs() < 0.02 && aspect.abs() < 1e-2);
        let (small, _) = octaves(footprint(1, &UNIT_PAIR, eye, 10.0));
        assert!((small - 2.0).abs() < 0.02, "a pixel's corners");
        let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Y, Vec3::Y];
        let (solo, _) = octaves(footprint(0, &triangle, eye, 640.0));
        assert!((solo - square).abs() < 0.02, "twice its half");
        let strip = [
            Vec3::ZERO,
            Vec3::X,
            2.0 * Vec3::X,
            Vec3::new(2.0, 1.0, 0.0),
            Vec3::Y,
        ];
        let (area, aspect) = octaves(footprint(2, &strip, eye, 640.0));
        let [wide, high] = [129_f32, 65.0].map(f32::log2);
        assert!((area - (wide + high)).abs() < 0.03);
        assert!((aspect - (wide - high)).abs() < 0.02);
    }

    #[test]
    fn the_size_does_not_depend_on_the_view_direction() {
        let eye = Vec3::new(0.3, 0.2, 2.0);
        let straight = octaves(footprint(1, &UNIT_PAIR, eye, 500.0));
        for step in 1..8 {
            let turn = glam::Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), step as f32);
            let corners = UNIT_PAIR.map(|corner| turn * (corner - eye));
            let turned = octaves(footprint(1, &corners, Vec3::ZERO, 500.0));
            assert!((turned.0 - straight.0).abs() < 5e-3);
            assert!((turned.1 - straight.1).abs() < 5e-3);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_triangle_has_a_size(
            numbers in prop::collection::vec(prop::num::f32::ANY, 18),
            pixels_per_radian in prop::num::f32::ANY,
        ) {
            let points: Vec<Vec3> = numbers.chunks_exact(3).map(Vec3::from_slice).collect();
            let corners = [0, 1, 2, 3, 4].map(|i| points[i]);
            for shape in 0..3 {
                let (area, aspect) = octaves(footprint(shape, &corners, points[5], pixels_per_radian));
                prop_assert!((0.0..=32.0).contains(&area));
                prop_assert!((-16.0..=16.0).contains(&aspect));
            }
        }
    }
}
