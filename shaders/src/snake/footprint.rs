//! How large, how flat and how foreshortened a triangle is seen. Twin of
//! `footprint.wgsl`.
//!
//! Each triangle has a **virtual camera** at the eye that looks at its middle;
//! where the triangle reaches out of a right angle's view or behind the camera, the
//! camera stands so far back that it sees all of it. There the edges are measured
//! in pixels. So the footprint does not depend on where the head looks, and a
//! triangle about the head has one, too.
//!
//! Source: Hladky et al., "SnakeBinning", 2021, sections 3.1 and 3.2, figure 4. We
//! differ in cutting the rare giant triangle at load (`patches::subdivide`) and not
//! in each frame, and in keeping which edge is the base while another one is
//! hardly longer: all corners would move.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3, vec2};

use super::bins::{LONGEST, OCTAVE, PIXEL, Wish};

/// From where triangles are measured.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SnakeFootprintParameters {
    /// Length of the list.
    pub patch_count: u32,
    /// In the middle of the eye's picture.
    pub pixels_per_radian: f32,
    /// Zero.
    pub padding: [u32; 2],
}

/// No turn is kept.
pub const NO_TURN: u32 = 7;
/// Another edge becomes the base where it is longer by this factor, and the other
/// end has the larger angle where the foot is this much beyond the middle.
const STEADY: f32 = 1.12;

/// The wish of a triangle seen from an eye; corners and eye are in one space.
/// `turn` is that of the slot that it has, or [`NO_TURN`].
#[must_use]
pub fn snake_footprint(
    corners: [Vec3; 3],
    eye: Vec3,
    parameters: &SnakeFootprintParameters,
    turn: u32,
) -> Wish {
    let to = corners.map(|corner| corner - eye);
    let middle = (to[0] + to[1] + to[2]) / 3.0;
    let mut ahead = middle.try_normalize();
    if ahead.is_none() {
        ahead = (to[1] - to[0]).cross(to[2] - to[0]).try_normalize();
    }
    let ahead = ahead.unwrap_or(Vec3::Z);
    let side = if ahead.x.abs() < 0.7 {
        Vec3::X
    } else {
        Vec3::Y
    };
    let right = ahead.cross(side).normalize();
    let up = right.cross(ahead);
    let beside = to.map(|to| vec2(to.dot(right), to.dot(up)));
    let deep = [0, 1, 2].map(|i| to[i].dot(ahead));
    let back = (0..3).fold(0.0_f32, |back, i| back.max(beside[i].length() - deep[i]));
    let depths = deep.map(|depth| (depth + back).max(1e-20));
    let seen = [0, 1, 2].map(|i| beside[i] * (parameters.pixels_per_radian / depths[i]));
    if seen.iter().all(|seen| seen.is_finite()) && depths.iter().all(|depth| depth.is_finite()) {
        measure(seen, depths, turn)
    } else {
        measure([Vec2::ZERO; 3], [1.0; 3], turn)
    }
}

fn measure(seen: [Vec2; 3], depths: [f32; 3], turn: u32) -> Wish {
    // The edge across from each corner.
    let edge = |corner: usize| seen[(corner + 2) % 3] - seen[(corner + 1) % 3];
    let lengths = [0, 1, 2].map(|corner| finite(edge(corner).length()));
    let mut tip = 0;
    for corner in [1, 2] {
        if lengths[corner] > lengths[tip] {
            tip = corner;
        }
    }
    let kept = (turn / 2) as usize;
    if turn < 6 && lengths[kept] * STEADY >= lengths[tip] {
        tip = kept;
    }
    let (base, length) = (edge(tip), lengths[tip]);
    let to_tip = seen[tip] - seen[(tip + 1) % 3];
    let unit = length.max(1e-20);
    let height = finite((base.perp_dot(to_tip) / unit).abs());
    let foot = finite(base.dot(to_tip) / unit / unit);
    // The larger angle is where the foot is nearer.
    let mut before = foot > 0.5;
    if turn < 6 && tip == kept {
        let other_side = if turn & 1 == 1 { 1.0 - foot } else { foot };
        before = (turn & 1 == 1) != (other_side > 0.5 * STEADY);
    }
    let foot = if before { 1.0 - foot } else { foot };
    let log = |pixels: f32| (pixels.max(0.06).log2() * OCTAVE as f32).round() as i32 + PIXEL;
    let least = depths[0].min(depths[1]).min(depths[2]);
    let deeper = depths.map(|depth| (finite((depth / least).log2()) * 8.0).round().min(31.0) as u8);
    Wish {
        height: log(height).clamp(0, LONGEST) as u16,
        length: log(length).clamp(0, LONGEST) as u16,
        tip: (foot * 512.0).round().clamp(0.0, 255.0) as u8,
        turn: (2 * tip + usize::from(before)) as u8,
        depths: deeper,
    }
}

/// Nothing where it is no number, and never beyond what logarithms are kept of.
fn finite(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(-1e9, 1e9) }
}
