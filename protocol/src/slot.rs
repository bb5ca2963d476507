//! Where in the atlas a patch is shaded, whichever method placed it.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::Block;

/// How patches are placed in the atlas. A session has one for its whole life.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Method {
    /// Shading Atlas Streaming (Mueller et al., 2018): one to three triangles in a
    /// rectangle that stays.
    #[default]
    Sas,
    /// Tessellated Shading Streaming (Hladky et al., 2019): each triangle by itself,
    /// placed anew for every picture.
    Tss,
    /// SnakeBinning (Hladky et al., 2021): each triangle by itself, among others of its
    /// shape, in a slot that stays.
    Snake,
}

impl Method {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Sas, Self::Tss, Self::Snake];

    /// Its name on a command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sas => "sas",
            Self::Tss => "tss",
            Self::Snake => "snake",
        }
    }

    /// Whether its slots are of this kind.
    #[must_use]
    pub fn places(self, slot: Slot) -> bool {
        match self {
            Self::Sas => matches!(slot, Slot::Block(_)),
            Self::Tss | Self::Snake => matches!(slot, Slot::Triangle(_)),
        }
    }
}

/// There is no method of this name.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("a method is expected: {}", Method::ALL.map(Method::name).join(" or "))]
pub struct UnknownMethod;

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        let mut methods = Self::ALL.into_iter();
        methods
            .find(|method| method.name() == name)
            .ok_or(UnknownMethod)
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Where a patch is shaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Slot {
    /// In a rectangle that is its own.
    Block(Block),
    /// In a triangle, beside others; only for patches of one triangle.
    Triangle(TriangleSlot),
}

/// A rectangle of texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TexelRectangle {
    /// Left column.
    pub x: u32,
    /// Upper row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl TexelRectangle {
    /// Texels in it.
    #[must_use]
    pub fn area(self) -> u32 {
        self.width * self.height
    }
}

impl Slot {
    /// The smallest rectangle that holds all of the slot's texels.
    #[must_use]
    pub fn bounds(self) -> TexelRectangle {
        match self {
            Self::Block(block) => {
                let (width, height) = block.level.size();
                TexelRectangle {
                    x: block.x.into(),
                    y: block.y.into(),
                    width,
                    height,
                }
            }
            Self::Triangle(slot) => slot.bounds(),
        }
    }

    /// Whether a texel is the slot's own: its light is this patch's. A bilinear
    /// lookup inside of the patch touches no other texels.
    #[must_use]
    pub fn owns(self, x: u32, y: u32) -> bool {
        match self {
            Self::Block(_) => {
                let bounds = self.bounds();
                (bounds.x..bounds.x + bounds.width).contains(&x)
                    && (bounds.y..bounds.y + bounds.height).contains(&y)
            }
            Self::Triangle(slot) => slot.owns(x, y),
        }
    }
}

/// Units of [`TriangleSlot::corners`] in a texel.
pub const SLOT_UNITS: i32 = 8;

/// Where a triangle's corners lie in the atlas, and how it is foreshortened there.
///
/// The surface point at affine atlas barycentrics `b` has the barycentrics
/// `b[i] * weights[i]`, normalised: what is evenly spaced in the atlas is evenly
/// spaced in the picture of the camera that the slot was made for, and not on the
/// surface. The atlas point of the surface barycentrics `B` is the other way
/// round at `B[i] / weights[i]`, normalised, which is what a GPU interpolates of the
/// homogeneous coordinates `corner / weight, 1 / weight`.
///
/// Source: SnakeBinning (Hladky et al., 2021), sections 3.7 and 3.9.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct TriangleSlot {
    /// In eighths of a texel from the atlas's upper left corner, x then y: the
    /// middle of the first texel is at 4, 4.
    pub corners: [[u16; 2]; 3],
    /// 1/depth of the corners in the camera that the slot was made for; the largest
    /// is 65535, and none is 0. All are equal where nothing is foreshortened.
    pub weights: [u16; 3],
}

impl TriangleSlot {
    /// See [`Slot::bounds`].
    #[must_use]
    pub fn bounds(self) -> TexelRectangle {
        let along = |axis: usize| {
            let of = self.corners.map(|corner| i32::from(corner[axis]));
            let low = of.into_iter().min().unwrap_or_default();
            let high = of.into_iter().max().unwrap_or_default();
            // Of texels whose middles are less than a texel away from the triangle.
            let first = (low - SLOT_UNITS / 2).div_euclid(SLOT_UNITS);
            let last = (high + SLOT_UNITS / 2 - 1).div_euclid(SLOT_UNITS);
            (first.max(0) as u32, (last - first.max(0) + 1).max(1) as u32)
        };
        let ((x, width), (y, height)) = (along(0), along(1));
        TexelRectangle {
            x,
            y,
            width,
            height,
        }
    }

    /// See [`Slot::owns`]: the texels whose middles lie less than a texel, along either
    /// axis, from a point of the triangle. These are what bilinear lookups at points of
    /// the triangle touch, and no more.
    #[must_use]
    pub fn owns(self, x: u32, y: u32) -> bool {
        let bounds = self.bounds();
        if !(bounds.x..bounds.x + bounds.width).contains(&x)
            || !(bounds.y..bounds.y + bounds.height).contains(&y)
        {
            return false;
        }
        let units = i64::from(SLOT_UNITS);
        let middle = [x, y].map(|at| i64::from(at) * units + units / 2);
        let corners = self.corners.map(|corner| corner.map(i64::from));
        let cross = |a: [i64; 2], b: [i64; 2], p: [i64; 2]| {
            (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
        };
        let turn = cross(corners[0], corners[1], corners[2]).signum();
        (0..3).all(|i| {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            let side = cross(a, b, middle);
            // Distance to the edge's outside times its length; without an inside, to either.
            let outside = if turn == 0 { side.abs() } else { -side * turn };
            let reach = (b[0] - a[0]).abs() + (b[1] - a[1]).abs();
            outside < units * reach || reach == 0
        })
    }

    /// Texel coordinates of a corner and its weight's inverse, homogeneous: both
    /// coordinates over the weight, and one over the weight. The weight is in units of
    /// the largest.
    #[must_use]
    pub fn homogeneous(self, corner: usize) -> [f32; 3] {
        let [x, y] = self.corners[corner].map(|at| f32::from(at) / SLOT_UNITS as f32);
        let w = f32::from(u16::MAX) / f32::from(self.weights[corner].max(1));
        [x * w, y * w, w]
    }

    /// Whether its texels lie as those of `other` do, but for a shift by whole texels
    /// and a half turn: then texels can be taken over as they are.
    #[must_use]
    pub fn is_laid_like(self, other: Self) -> bool {
        self.shift_from(other).is_some()
    }

    /// How texels of `other` become those of this slot where both are laid alike: the
    /// texel at `p` comes from `sign * p + offset`.
    #[must_use]
    pub fn shift_from(self, other: Self) -> Option<(i32, [i32; 2])> {
        let (new, old) = (
            self.corners.map(|c| c.map(i32::from)),
            other.corners.map(|c| c.map(i32::from)),
        );
        let edge = |of: &[[i32; 2]; 3], i: usize| [0, 1].map(|axis| of[i][axis] - of[0][axis]);
        let sign = [1, -1].into_iter().find(|sign| {
            (1..3).all(|i| edge(&new, i) == edge(&old, i).map(|along| along * sign))
        })?;
        // In units: middle of old = sign * middle of new + offset.
        let offset = [0, 1].map(|axis| old[0][axis] - sign * new[0][axis]);
        let half = SLOT_UNITS / 2;
        let in_texels = offset.map(|along| along + sign * half - half);
        let whole = in_texels.iter().all(|along| along % SLOT_UNITS == 0);
        (self.weights == other.weights && whole)
            .then(|| (sign, in_texels.map(|along| along / SLOT_UNITS)))
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};
    use proptest::{array::uniform2, array::uniform3, prelude::*};

    use super::*;

    fn slot(corners: [[u16; 2]; 3]) -> TriangleSlot {
        TriangleSlot {
            corners,
            weights: [u16::MAX; 3],
        }
    }

    fn owned(slot: TriangleSlot) -> Vec<(u32, u32)> {
        let TexelRectangle {
            x,
            y,
            width,
            height,
        } = slot.bounds();
        let all = (y..y + height).flat_map(|y| (x..x + width).map(move |x| (x, y)));
        all.filter(|&(x, y)| slot.owns(x, y)).collect()
    }

    #[test]
    fn methods_are_told_by_name() {
        for method in Method::ALL {
            assert_eq!(method.to_string().parse(), Ok(method));
        }
        let unknown = "quadtree".parse::<Method>().unwrap_err();
        assert_eq!(
            unknown.to_string(),
            "a method is expected: sas or tss or snake"
        );
    }

    #[test]
    fn a_right_angle_on_texel_middles_owns_its_half_and_two_diagonals() {
        let upper = slot([[4, 4], [60, 4], [4, 60]]);
        assert_eq!(upper.bounds().area(), 64);
        assert_eq!(owned(upper).len(), 8 + 8 + 7 + 6 + 5 + 4 + 3 + 2);
        // The other half of a rectangle four columns wider than high less one.
        let lower = slot([[84, 60], [28, 60], [84, 4]]);
        assert_eq!(owned(lower).len(), owned(upper).len());
        assert!(owned(lower).iter().all(|&(x, y)| !upper.owns(x, y)));
        assert!(lower.is_laid_like(upper));
        assert!(!lower.is_laid_like(slot([[4, 4], [52, 4], [4, 60]])));
        assert!(
            !upper.is_laid_like(slot([[8, 4], [64, 4], [8, 60]])),
            "half a texel"
        );
        // As small as can be.
        assert_eq!(owned(slot([[4, 4], [12, 4], [4, 12]])).len(), 4);
        assert_eq!(owned(slot([[20, 28]; 3])), [(2, 3)]);
    }

    #[test]
    fn texels_of_slots_laid_alike_are_told_by_shift_and_sign() {
        let old = slot([[4, 4], [60, 4], [4, 60]]);
        for new in [
            slot([[36, 100], [92, 100], [36, 156]]),
            slot([[84, 60], [28, 60], [84, 4]]),
        ] {
            let (sign, offset) = new.shift_from(old).expect("laid alike");
            let mut from: Vec<(u32, u32)> = owned(new)
                .iter()
                .map(|&(x, y)| {
                    let [x, y] = [(x, 0), (y, 1)].map(|(p, axis)| sign * p as i32 + offset[axis]);
                    (x as u32, y as u32)
                })
                .collect();
            from.sort_by_key(|&(x, y)| (y, x));
            assert_eq!(from, owned(old));
        }
    }

    proptest! {
        #[test]
        fn lookups_inside_of_a_triangle_touch_only_its_texels(
            corners in uniform3(uniform2(4_u16..400)),
            points in prop::collection::vec((0.0_f32..=1.0, 0.0_f32..=1.0), 100),
        ) {
            let slot = slot(corners);
            let [a, b, c] = corners.map(|c| Vec2::from(c.map(f32::from)) / SLOT_UNITS as f32);
            for (u, v) in points {
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let at = a + (b - a) * u + (c - a) * v - 0.5;
                let (low, f) = (at.floor(), at - at.floor());
                for (tap, weight) in [
                    (Vec2::ZERO, (1.0 - f.x) * (1.0 - f.y)),
                    (Vec2::X, f.x * (1.0 - f.y)),
                    (Vec2::Y, (1.0 - f.x) * f.y),
                    (Vec2::ONE, f.x * f.y),
                ] {
                    let texel = low + tap;
                    // Of what rounding makes beside a texel's middle nothing is seen.
                    prop_assert!(weight < 1e-3 || slot.owns(texel.x as u32, texel.y as u32),
                        "{texel} of {slot:?} at {at}");
                }
            }
        }

        #[test]
        fn a_turn_about_the_middle_keeps_what_is_owned(corners in uniform3(uniform2(4_u16..400))) {
            let turned = slot(corners.map(|c| c.map(|at| 408 - at)));
            prop_assert!(turned.is_laid_like(slot(corners)));
            prop_assert_eq!(owned(turned).len(), owned(slot(corners)).len());
        }
    }

    /// A floor seen under a steep angle: where a camera sees a point of the surface is
    /// where the slot that was made for this camera has it.
    #[test]
    fn foreshortening_is_that_of_a_camera() {
        let corners = [
            Vec3::new(-1.0, -1.0, -2.0),
            Vec3::new(1.0, -1.0, -2.5),
            Vec3::new(0.5, -1.0, -20.0),
        ];
        let seen = |p: Vec3| Vec2::new(p.x, p.y) / -p.z * 200.0 + 250.0;
        let nearest = corners.iter().map(|p| -p.z).fold(f32::MAX, f32::min);
        let slot = TriangleSlot {
            corners: corners.map(|p| {
                (seen(p) * SLOT_UNITS as f32)
                    .to_array()
                    .map(|at| at.round() as u16)
            }),
            weights: corners.map(|p| (65535.0 * nearest / -p.z).round() as u16),
        };
        for (u, v) in [(0.2, 0.3), (0.1, 0.8), (0.45, 0.45), (0.0, 0.5)] {
            let surface = [1.0 - u - v, u, v];
            let mut point = Vec3::ZERO;
            let mut texel = Vec3::ZERO;
            for i in 0..3 {
                point += corners[i] * surface[i];
                texel += Vec3::from(slot.homogeneous(i)) * surface[i];
            }
            let found = texel.truncate() / texel.z;
            assert!(found.distance(seen(point)) < 0.1, "{found} {}", seen(point));
            // And back: affine in the atlas, times the weights.
            let [a, b, c] = corners.map(seen);
            let area = (b - a).perp_dot(c - a);
            let affine = [
                (b - found).perp_dot(c - found) / area,
                (c - found).perp_dot(a - found) / area,
                (a - found).perp_dot(b - found) / area,
            ];
            let weighted = [0, 1, 2].map(|i| affine[i] * f32::from(slot.weights[i]));
            let sum: f32 = weighted.iter().sum();
            for i in 0..3 {
                assert!((weighted[i] / sum - surface[i]).abs() < 0.01);
            }
        }
    }
}
