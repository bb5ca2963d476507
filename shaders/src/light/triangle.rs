//! Host structs and twins of `triangle.wgsl` and `triangle_slots.wgsl`.

use bytemuck::{Pod, Zeroable};
use glam::{IVec2, Vec2, Vec3};

use super::PatchPoint;

/// Units of corners in a texel.
const UNITS: i32 = 8;

/// A triangle's slot whose texels are lit.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct TriangleRecord {
    /// Its first job; ascending over the list.
    pub first_job: u32,
    /// Its first tile of jobs; likewise.
    pub first_tile: u32,
    /// log2 stride << 10, instance << 16.
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
    /// x, and y in the upper half, in eighths of a texel.
    pub corners: [u32; 3],
    /// Of the first corner, of the second in the upper half; of the third.
    pub weights: [u32; 2],
}

/// Twin of `AtlasTriangle`: a triangle in the atlas, and how it is foreshortened there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasTriangle {
    /// First of the texels in its bounds.
    pub first: IVec2,
    /// Texels in its bounds on either axis.
    pub size: IVec2,
    /// In eighths of a texel from the middle of the first texel.
    corners: [IVec2; 3],
    weights: Vec3,
}

impl AtlasTriangle {
    /// Twin of `atlas_triangle`: corners in eighths of a texel from the atlas's corner.
    #[must_use]
    pub fn new(corners: [[u16; 2]; 3], weights: [u16; 3]) -> Self {
        let corners = corners.map(|corner| IVec2::from(corner.map(i32::from)));
        let low = corners[0].min(corners[1]).min(corners[2]);
        let high = corners[0].max(corners[1]).max(corners[2]);
        let first = (low - UNITS / 2).max(IVec2::ZERO) / UNITS;
        let last = (high + UNITS / 2 - 1) / UNITS;
        Self {
            first,
            size: (last - first + 1).max(IVec2::ONE),
            corners: corners.map(|corner| corner - first * UNITS - UNITS / 2),
            weights: Vec3::from(weights.map(f32::from)),
        }
    }

    /// Twin of `owns_texel`: whether a texel within the bounds, counted from their
    /// first, is the triangle's own.
    #[must_use]
    pub fn owns(&self, texel: IVec2) -> bool {
        let p = texel * UNITS;
        let turn_of = |a: IVec2, b: IVec2, p: IVec2| (b - a).perp_dot(p - a);
        let turn = turn_of(self.corners[0], self.corners[1], self.corners[2]).signum();
        !(0..3).any(|i| {
            let (a, b) = (self.corners[i], self.corners[(i + 1) % 3]);
            let side = turn_of(a, b, p);
            let reach = (b - a).abs().element_sum();
            let beyond = if turn == 0 { side.abs() } else { -side * turn };
            reach != 0 && beyond >= UNITS * reach
        })
    }

    /// Twin of `nearest_in`: affine barycentrics of the triangle's point nearest to
    /// `p`, in texels from the middle of the first.
    #[must_use]
    pub fn nearest(&self, p: Vec2) -> Vec3 {
        let corners = self.corners.map(|corner| corner.as_vec2() / UNITS as f32);
        let (ab, ac, ap) = (
            corners[1] - corners[0],
            corners[2] - corners[0],
            p - corners[0],
        );
        let doubled = ab.perp_dot(ac);
        if doubled != 0.0 {
            let (v, w) = (ap.perp_dot(ac) / doubled, ab.perp_dot(ap) / doubled);
            let inside = Vec3::new(1.0 - v - w, v, w);
            if inside.min_element() >= 0.0 {
                return inside;
            }
        }
        let mut least = f32::MAX;
        let mut nearest = Vec3::X;
        for i in 0..3 {
            let j = (i + 1) % 3;
            let edge = corners[j] - corners[i];
            let along = (p - corners[i]).dot(edge) / edge.length_squared().max(1e-12);
            let along = along.clamp(0.0, 1.0);
            let off = (p - corners[i] - edge * along).length_squared();
            if off < least {
                least = off;
                nearest = Vec3::ZERO;
                nearest[i] = 1.0 - along;
                nearest[j] += along;
            }
        }
        nearest
    }

    /// Twin of `on_surface`: barycentrics on the surface of affine ones in the atlas.
    #[must_use]
    pub fn on_surface(&self, affine: Vec3) -> Vec3 {
        let weighted = affine * self.weights;
        weighted / weighted.element_sum()
    }

    /// Twin of `in_atlas`, the inverse.
    #[must_use]
    pub fn in_atlas(&self, surface: Vec3) -> Vec3 {
        let weighted = surface / self.weights;
        weighted / weighted.element_sum()
    }

    /// Twin of `texel_at`: in texels from the middle of the first.
    #[must_use]
    pub fn texel_at(&self, affine: Vec3) -> Vec2 {
        let [a, b, c] = self.corners.map(|corner| corner.as_vec2() / UNITS as f32);
        a * affine.x + b * affine.y + c * affine.z
    }

    /// Twin of `surface_point` in `triangle_slots.wgsl`: what a texel within the bounds
    /// shows.
    #[must_use]
    pub fn point_of_texel(&self, texel: IVec2) -> PatchPoint {
        let surface = self.on_surface(self.nearest(texel.as_vec2()));
        PatchPoint {
            triangle: 0,
            weights: Vec2::new(surface.y, surface.z),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::{array::uniform2, array::uniform3, prelude::*};

    fn any_triangle() -> impl Strategy<Value = AtlasTriangle> {
        let corners = uniform3(uniform2(4_u16..800));
        let weights = uniform3(4096_u16..=65535);
        (corners, weights).prop_map(|(corners, weights)| AtlasTriangle::new(corners, weights))
    }

    proptest! {
        #[test]
        fn a_texel_shows_the_triangle_and_its_own_place(t in any_triangle()) {
            for (x, y) in (0..t.size.y).flat_map(|y| (0..t.size.x).map(move |x| (x, y))) {
                let texel = IVec2::new(x, y);
                if !t.owns(texel) {
                    continue;
                }
                let affine = t.nearest(texel.as_vec2());
                prop_assert!(affine.min_element() >= 0.0 && (affine.element_sum() - 1.0).abs() < 1e-4);
                // Less than a texel away along both axes, so at most a diagonal.
                let off = t.texel_at(affine).distance(texel.as_vec2());
                prop_assert!(off < 1.415, "{texel} is {off} away");
            }
        }

        #[test]
        fn the_surface_leads_back_to_the_atlas(t in any_triangle(), u in 0.0_f32..1.0, v in 0.0_f32..1.0) {
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let affine = Vec3::new(1.0 - u - v, u, v);
            let back = t.in_atlas(t.on_surface(affine));
            prop_assert!(back.distance(affine) < 1e-4, "{affine} became {back}");
        }
    }
}
