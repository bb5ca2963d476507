//! How many texels a patch deserves, seen from an eye.
//!
//! Shading is stored in the atlas and looked at on the screen, so that a block
//! should have about as many texels as its patch covers pixels, and the same
//! proportions. Lengths are angles times pixels per radian: they do not depend
//! on where the eye looks, only on where it is.
//!
//! Source: Mueller et al., "Shading Atlas Streaming", 2018, section 4.3,
//! equations 1 and 2. We differ in giving a side of `n` pixels `n + 1` texels,
//! because the outer ones lie on the patch's edges, and in [`steady_level`], which
//! lets a block stay where rounding alone would make it jump.

use glam::{DVec3, Vec3};
use shadecast_protocol::{Level, MIN_LOG2_SIDE, PatchShape};

/// How far, in octaves of either side, a wish may drift from a block before
/// the block changes. Fresh rounding is off by at most half an octave on a
/// square patch, so that 0.65 lets an eye move by a tenth of its distance,
/// back and forth over any border, without moving a block.
pub const HYSTERESIS: f32 = 0.65;

/// Pixels below which a length counts as this: as good as nothing, and its
/// reciprocal is finite.
const SMALLEST: f32 = 1e-3;

/// The block that a patch would have in an atlas without limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IdealSize {
    /// log2 of its texels; from 0 to 32.
    pub log2_area: f32,
    /// log2 of width over height; from -16 to 16.
    pub log2_aspect: f32,
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
    if pixels.is_nan() { 0.0 } else { pixels }
}

/// The block that `shape` with these corners deserves. Unused corners do not
/// matter; corners and eye are in one space.
///
/// The triangles of a pair and of a triple fill their block, so that its area
/// is their sum; a solo triangle fills half of it. Width and height are the
/// longest edges that run along them in the layout; the two upper edges of a
/// triple together span its width.
#[must_use]
pub fn ideal_size(
    shape: PatchShape,
    corners: &[Vec3; 5],
    eye: Vec3,
    pixels_per_radian: f32,
) -> IdealSize {
    let edge = |a: usize, b: usize| edge_pixels(corners[a], corners[b], eye, pixels_per_radian);
    let (area, width, height) = match shape {
        PatchShape::Solo => {
            let (width, height) = (edge(0, 1), edge(0, 2));
            let area = 2.0 * triangle_area(width, height, edge(1, 2));
            (area, width, height)
        }
        PatchShape::Pair => {
            let (top, right, bottom, left) = (edge(0, 1), edge(1, 2), edge(2, 3), edge(3, 0));
            let diagonal = edge(1, 3);
            let area = triangle_area(top, diagonal, left) + triangle_area(right, bottom, diagonal);
            (area, top.max(bottom), left.max(right))
        }
        PatchShape::Triple => {
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
    IdealSize {
        log2_area: log2(area).clamp(0.0, 32.0),
        log2_aspect: (log2(width) - log2(height)).clamp(-16.0, 16.0),
    }
}

/// Heron's formula in Kahan's order, which stays exact for needles; zero where
/// the lengths make no triangle.
fn triangle_area(a: f32, b: f32, c: f32) -> f32 {
    let mut sides = [a, b, c].map(f64::from);
    sides.sort_by(|x, y| y.total_cmp(x));
    let [a, b, c] = sides;
    let product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    (0.25 * product.max(0.0).sqrt()) as f32
}

/// The level that is nearest to what a patch deserves at a bias (equation 2).
/// No side exceeds `2^largest` texels.
#[must_use]
pub fn level(ideal: IdealSize, bias: f32, largest: u8) -> Level {
    Wish::new(ideal, bias, largest).rounded(largest)
}

/// As [`level`], but `current` stays while it is within [`HYSTERESIS`] of the
/// wish on both sides.
#[must_use]
pub fn steady_level(current: Option<Level>, ideal: IdealSize, bias: f32, largest: u8) -> Level {
    let wish = Wish::new(ideal, bias, largest);
    match current {
        Some(current) if wish.tolerates(current) => current,
        _ => wish.rounded(largest),
    }
}

/// log2 of area and aspect, within what blocks can be but not yet rounded.
struct Wish {
    area: f32,
    aspect: f32,
}

impl Wish {
    /// `max` and `min` rather than `clamp`: they let no NaN through.
    fn new(ideal: IdealSize, bias: f32, largest: u8) -> Self {
        let (least, most) = (2.0 * f32::from(MIN_LOG2_SIDE), 2.0 * f32::from(largest));
        let area = (ideal.log2_area.min(most) - bias).max(least).min(most);
        let widest = (area - least).min(most - area);
        Self {
            area,
            aspect: ideal.log2_aspect.max(-widest).min(widest),
        }
    }

    /// The aspect takes the parity of the area, so that both sides come out whole.
    fn rounded(&self, largest: u8) -> Level {
        let area = self.area.round() as i32;
        let parity = area & 1;
        let aspect = 2 * ((self.aspect.abs() - parity as f32) * 0.5).round() as i32 + parity;
        let (least, most) = (2 * i32::from(MIN_LOG2_SIDE), 2 * i32::from(largest));
        let aspect = aspect.min(area - least).min(most - area).max(parity);
        let aspect = if self.aspect < 0.0 { -aspect } else { aspect };
        Level {
            width: ((area + aspect) / 2) as u8,
            height: ((area - aspect) / 2) as u8,
        }
    }

    fn tolerates(&self, level: Level) -> bool {
        let (width, height) = (
            (self.area + self.aspect) * 0.5,
            (self.area - self.aspect) * 0.5,
        );
        (width - f32::from(level.width)).abs() <= HYSTERESIS
            && (height - f32::from(level.height)).abs() <= HYSTERESIS
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const UNIT_PAIR: [Vec3; 5] = [
        Vec3::ZERO,
        Vec3::X,
        Vec3::new(1.0, 1.0, 0.0),
        Vec3::Y,
        Vec3::Y,
    ];

    fn at(width: u8, height: u8) -> Level {
        Level { width, height }
    }

    fn ideal(log2_area: f32, log2_aspect: f32) -> IdealSize {
        IdealSize {
            log2_area,
            log2_aspect,
        }
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
        let size = ideal_size(PatchShape::Pair, &UNIT_PAIR, eye, 640.0);
        let square = 2.0 * 65_f32.log2();
        assert!((size.log2_area - square).abs() < 0.02 && size.log2_aspect.abs() < 1e-5);
        let small = ideal_size(PatchShape::Pair, &UNIT_PAIR, eye, 10.0);
        assert!((small.log2_area - 2.0).abs() < 0.02, "a pixel's corners");
        let solo = ideal_size(
            PatchShape::Solo,
            &[Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Y, Vec3::Y],
            eye,
            640.0,
        );
        assert!((solo.log2_area - square).abs() < 0.02, "twice its half");
        let strip = [
            Vec3::ZERO,
            Vec3::X,
            2.0 * Vec3::X,
            Vec3::new(2.0, 1.0, 0.0),
            Vec3::Y,
        ];
        let triple = ideal_size(PatchShape::Triple, &strip, eye, 640.0);
        let [wide, high] = [129_f32, 65.0].map(f32::log2);
        assert!((triple.log2_area - (wide + high)).abs() < 0.03);
        assert!((triple.log2_aspect - (wide - high)).abs() < 0.02);
    }

    #[test]
    fn the_size_does_not_depend_on_the_view_direction() {
        let eye = Vec3::new(0.3, 0.2, 2.0);
        let straight = ideal_size(PatchShape::Pair, &UNIT_PAIR, eye, 500.0);
        for step in 1..8 {
            let turn = glam::Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), step as f32);
            let corners = UNIT_PAIR.map(|corner| turn * (corner - eye));
            let turned = ideal_size(PatchShape::Pair, &corners, Vec3::ZERO, 500.0);
            assert!((turned.log2_area - straight.log2_area).abs() < 1e-4);
            assert!((turned.log2_aspect - straight.log2_aspect).abs() < 1e-4);
        }
    }

    #[test]
    fn levels_are_equation_2() {
        assert_eq!(level(ideal(8.0, 0.0), 0.0, 6), at(4, 4));
        assert_eq!(level(ideal(8.0, 0.0), 2.0, 6), at(3, 3));
        assert_eq!(
            level(ideal(7.0, 0.0), 0.0, 6),
            at(4, 3),
            "odd areas cannot be square"
        );
        assert_eq!(level(ideal(7.0, 2.6), 0.0, 6), at(5, 2));
        assert_eq!(level(ideal(8.0, -2.0), 0.0, 6), at(3, 5), "on its side");
        assert_eq!(level(ideal(7.0, -0.1), 0.0, 6), at(3, 4));
        assert_eq!(level(ideal(8.0, 16.0), 0.0, 6), at(6, 2));
        assert_eq!(level(ideal(4.0, 16.0), 0.0, 6), at(3, 1));
        assert_eq!(level(ideal(32.0, 0.0), 0.0, 6), at(6, 6));
        assert_eq!(level(ideal(0.0, 5.0), 100.0, 6), at(1, 1));
    }

    #[test]
    fn a_level_stays_until_the_wish_is_well_past_the_border() {
        let stays = |area| steady_level(Some(at(4, 4)), ideal(area, 0.0), 0.0, 6) == at(4, 4);
        assert!(stays(8.0) && stays(9.29) && stays(6.71));
        assert!(!stays(9.5) && !stays(6.5));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_triangle_has_a_size_and_a_level(
            numbers in prop::collection::vec(prop::num::f32::ANY, 18),
            pixels_per_radian in prop::num::f32::ANY,
            bias in prop::num::f32::ANY,
            largest in 2_u8..12,
        ) {
            let points: Vec<Vec3> = numbers.chunks_exact(3).map(Vec3::from_slice).collect();
            let corners = [0, 1, 2, 3, 4].map(|i| points[i]);
            for shape in [PatchShape::Solo, PatchShape::Pair, PatchShape::Triple] {
                let size = ideal_size(shape, &corners, points[5], pixels_per_radian);
                prop_assert!((0.0..=32.0).contains(&size.log2_area));
                prop_assert!((-16.0..=16.0).contains(&size.log2_aspect));
                let level = level(size, bias, largest);
                let sides = MIN_LOG2_SIDE..=largest;
                prop_assert!(sides.contains(&level.width) && sides.contains(&level.height));
            }
        }

        #[test]
        fn a_level_is_near_its_wish(area in 2.0_f32..12.0, aspect in -8.0_f32..8.0) {
            let found = level(ideal(area, aspect), 0.0, 6);
            let found_area = f32::from(found.width + found.height);
            prop_assert!((found_area - area).abs() <= 0.5);
            let found_aspect = f32::from(found.width) - f32::from(found.height);
            let widest = (area - 2.0).min(12.0 - area);
            let possible = aspect.clamp(-widest, widest);
            prop_assert!((found_aspect - possible).abs() <= 1.5);
        }
    }
}
