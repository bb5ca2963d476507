//! Host structs and twins of `atlas.wgsl` and `block_slots.wgsl`.

use bytemuck::{Pod, Zeroable};
use glam::Vec2;

/// Jobs on a side of a tile at most; its paths are judged together.
pub const TILE_SIDE: u32 = 8;

/// What is the same for all jobs of a dispatch.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct LightParameters {
    /// The head, which decides what glossy texels show.
    pub eye: [f32; 3],
    /// Slots that are lit.
    pub slot_count: u32,
    /// In texels.
    pub atlas_width: u32,
    /// Tiles that are lit: see [`TILE_SIDE`].
    pub tile_count: u32,
    /// Width that a pixel's sample has a metre away.
    pub pixel_angle: f32,
    /// Factor from radiance to displayed brightness.
    pub exposure: f32,
}

/// A block whose texels are lit.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct BlockRecord {
    /// Its first job; ascending over the list.
    pub first_job: u32,
    /// Its first tile of jobs; likewise.
    pub first_tile: u32,
    /// x, and y in the upper half.
    pub position: u32,
    /// Of the block: log2 width, log2 height << 4, shape << 8, log2 stride << 10,
    /// whether the patch lies on its side << 14, instance << 16.
    pub layout_bits: u32,
    /// Of the patch, in scene order.
    pub first_triangle: u32,
    /// Which sample of the sequence.
    pub sample_index: u32,
    /// Seeds the sampler.
    pub patch_id: u32,
    /// Samples over which means run at most.
    pub longest_history: f32,
    /// What old glossy samples are still worth, seen from where the eye is now.
    pub glossy_keep: f32,
}

/// How well a slot is known.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Quality {
    /// Mean over the slot of the standard error relative to the tone curve's scale.
    pub noise: f32,
    /// Samples of a texel's diffuse light: their harmonic mean.
    pub samples: f32,
}

/// A point of a patch by one of its triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchPoint {
    /// Which of the patch's triangles.
    pub triangle: u32,
    /// Weights of the triangle's corners 1 and 2.
    pub weights: Vec2,
}

/// Twin of `patch_point`: shape 0 solo, 1 pair, 2 triple; `point` in [0, 1]².
#[must_use]
pub fn patch_point(shape: u32, point: Vec2) -> PatchPoint {
    let (u, v) = (point.x, point.y);
    let (triangle, weights) = match shape {
        0 => {
            let over = (u + v - 1.0).max(0.0) * 0.5;
            (0, Vec2::new((u - over).max(0.0), (v - over).max(0.0)))
        }
        1 if u + v <= 1.0 => (0, point),
        1 => (1, Vec2::new(u + v - 1.0, 1.0 - u)),
        _ if 2.0 * u + v <= 1.0 => (0, Vec2::new(2.0 * u, v)),
        _ if 2.0 * u - v >= 1.0 => (2, Vec2::new(2.0 * u - v - 1.0, v)),
        _ => {
            let third = u - 0.5 * (1.0 - v);
            (1, Vec2::new(third, v - third))
        }
    };
    PatchPoint { triangle, weights }
}

/// Patch coordinates of the centre of texel (`x`, `y`) of a block of `width` by
/// `height` texels: the outer texel centres lie on the patch's edge (SAS 2018, figure 6).
#[must_use]
pub fn texel_coordinates(x: u32, y: u32, width: u32, height: u32) -> Vec2 {
    Vec2::new(
        x as f32 / (width - 1).max(1) as f32,
        y as f32 / (height - 1).max(1) as f32,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Corners and triangles of the three shapes, as the wire protocol has them.
    const CORNERS: [&[[f32; 2]]; 3] = [
        &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        &[[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
    ];
    const TRIANGLES: [&[[usize; 3]]; 3] = [
        &[[0, 1, 2]],
        &[[0, 1, 3], [1, 2, 3]],
        &[[0, 1, 4], [1, 3, 4], [1, 2, 3]],
    ];

    proptest! {
        #[test]
        fn a_point_is_where_its_weights_say(shape in 0u32..3, u in 0.0f32..=1.0, v in 0.0f32..=1.0) {
            let point = Vec2::new(u, v);
            let found = patch_point(shape, point);
            let w = found.weights;
            prop_assert!(w.min_element() >= -1e-6 && w.x + w.y <= 1.0 + 1e-6);
            let corners = TRIANGLES[shape as usize][found.triangle as usize]
                .map(|c| Vec2::from(CORNERS[shape as usize][c]));
            let back = corners[0] * (1.0 - w.x - w.y) + corners[1] * w.x + corners[2] * w.y;
            // Beyond the hypotenuse a solo patch shows its nearest point.
            if shape != 0 || u + v <= 1.0 {
                prop_assert!(back.distance(point) < 1e-5, "{point} became {back}");
            } else {
                prop_assert!((back.x + back.y - 1.0).abs() < 1e-5);
            }
        }
    }
}
