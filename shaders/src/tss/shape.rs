//! How a triangle looks from an eye: what it deserves of the atlas, in whole numbers.
//! Twin of `measure.wgsl`.
//!
//! Lengths are pixels of a sphere about the eye, as SAS measures them: TSS projects to
//! the server's camera, whose wide field of view stretches what is at its edges
//! (SnakeBinning, section 5.2), and which knows nothing of what is behind it.

use glam::{DVec3, Vec3};

use crate::atlas::footprint::{edge_pixels, triangle_area};

/// log2 of a length in steps of 1/256 octave is below this.
const MOST_STEPS: i32 = 4096;
/// Pixels below which a length counts as this.
const SMALLEST: f32 = 1e-3;
/// Steps of nearness in an octave of depth. Coarse, so that a head that hardly moves
/// leaves slots as they are.
pub(super) const NEARNESS_OCTAVE: f32 = 16.0;
/// Corners further away than this many times the nearest count as so far: of a
/// triangle that reaches past the eye the rest would get no texels.
const MOST_DEPTH_RATIO: f32 = 16.0;

/// What is asked of the atlas for a triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shape {
    /// log2 of the longest edge in pixels, 1/256 octaves.
    pub width: u16,
    /// log2 of the height on it.
    pub height: u16,
    /// Where on it the height stands, eighths from its first corner.
    pub foot: u8,
    /// The corner at which the longest edge begins; it ends at the next.
    pub longest: u8,
    /// log2 of the depths of the corners over the least, 1/16 octaves.
    pub depths: [u8; 3],
}

impl Shape {
    /// As kernels have it.
    #[must_use]
    pub fn words(self) -> [u32; 2] {
        let [a, b, c] = self.depths.map(u32::from);
        [
            u32::from(self.width) | u32::from(self.height) << 16,
            u32::from(self.foot) | u32::from(self.longest) << 4 | a << 8 | b << 16 | c << 24,
        ]
    }

    /// The inverse of [`words`](Self::words).
    #[must_use]
    pub fn of_words([lengths, rest]: [u32; 2]) -> Self {
        Self {
            width: lengths as u16,
            height: (lengths >> 16) as u16,
            foot: (rest & 15) as u8,
            longest: (rest >> 4 & 3) as u8,
            depths: [8, 16, 24].map(|shift| (rest >> shift) as u8),
        }
    }
}

/// The shape of a triangle with these corners; corners and eye are in one space.
#[must_use]
pub fn shape(corners: [Vec3; 3], eye: Vec3, pixels_per_radian: f32) -> Shape {
    let edge = |i: usize| edge_pixels(corners[i], corners[(i + 1) % 3], eye, pixels_per_radian);
    let edges = [edge(0), edge(1), edge(2)];
    let mut longest = 0;
    for i in 1..3 {
        if edges[i] > edges[longest] {
            longest = i;
        }
    }
    let base = edges[longest].max(SMALLEST);
    let [after, before] = [1, 2].map(|next| edges[(longest + next) % 3]);
    let height = 2.0 * triangle_area(edges[0], edges[1], edges[2]) / base;
    // Law of cosines, in units of the base.
    let squares = (before - after) / base * ((before + after) / base);
    let foot = (4.0 * (1.0 + squares)).round().clamp(0.0, 8.0);
    let steps = |length: f32| {
        let steps = (length.max(SMALLEST).log2() * 256.0).round() as i32;
        steps.clamp(0, MOST_STEPS - 1) as u16
    };
    Shape {
        width: steps(base),
        height: steps(height),
        foot: foot as u8,
        longest: longest as u8,
        depths: depths(corners, eye),
    }
}

/// Depths in a camera that looks at the middle of the triangle (SnakeBinning, section
/// 3.1): all zero where the eye is within it, or nothing is a number.
fn depths(corners: [Vec3; 3], eye: Vec3) -> [u8; 3] {
    let from_eye = corners.map(|corner| corner.as_dvec3() - eye.as_dvec3());
    let middle: DVec3 = from_eye.into_iter().sum::<DVec3>() / 3.0;
    let forwards = middle.normalize_or_zero();
    let depths = from_eye.map(|corner| corner.dot(forwards) as f32);
    let furthest = depths.into_iter().fold(0.0, f32::max);
    if !(furthest > 0.0 && furthest < 1e30) {
        return [0; 3];
    }
    let nearest = depths.into_iter().fold(furthest, f32::min);
    let nearest = nearest.max(furthest / MOST_DEPTH_RATIO);
    depths.map(|depth| ((depth.max(nearest) / nearest).log2() * NEARNESS_OCTAVE).round() as u8)
}
