//! Turns upright pairs, since blocks are wide.
//!
//! The shared edge of a pair is the diagonal of its block, which fixes what
//! lies along the block's width. A wall of upright quads would so be shaded
//! too finely across and too coarsely along. Where the two triangles make a
//! parallelogram and everything on it is linear, cutting it along its other
//! diagonal changes nothing that can be seen, and turns the pair by a right
//! angle. All other pairs are left as they are.

use crate::scene::{Corner, Scene, Triangle};

/// Pairs are turned when their width is below this part of their height;
/// nearer to a square it gains nothing, and levels are powers of two anyway.
const UPRIGHT: f32 = 0.9;

/// Deviation from a parallelogram, of positions and of texture coordinates, as
/// a part of its size: a thousandth of a patch is below a pixel.
const SAME_PLACE: f32 = 1e-3;

/// Deviation of unit vectors and colours from being linear: below what eight
/// bits a channel show.
const SAME_SHADE: f32 = 1e-2;

/// The two triangles (0 1 3) and (1 2 3) of a pair cut along the diagonal 0 2
/// instead, where that is better and cannot be seen.
pub(super) fn turned(scene: &Scene, a: &Triangle, b: &Triangle) -> Option<[Triangle; 2]> {
    let quad = [
        a.positions[0],
        a.positions[1],
        b.positions[1],
        a.positions[2],
    ];
    let [p, q, r, s] = quad.map(|index| scene.positions[index as usize]);
    let width = p.distance(q) + s.distance(r);
    let height = p.distance(s) + q.distance(r);
    let corner = |triangle: &Triangle, k: usize| scene.corners[triangle.corners[k] as usize];
    let is_smooth = corner(a, 1) == corner(b, 0) && corner(a, 2) == corner(b, 2);
    let is_linear = || is_linear([corner(a, 0), corner(a, 1), corner(b, 1), corner(a, 2)]);
    // Nor may an edge come to be longer than any that was found short enough.
    let may_turn = width < UPRIGHT * height
        && p.distance(r) <= (1.0 + SAME_PLACE) * q.distance(s)
        && (p + r - q - s).length() <= SAME_PLACE * width
        && a.material == b.material
        && is_smooth
        && is_linear();
    may_turn.then(|| {
        let corners = [a.corners[0], a.corners[1], b.corners[1], a.corners[2]];
        [[1, 2, 0], [2, 3, 0]].map(|ends: [usize; 3]| Triangle {
            positions: ends.map(|k| quad[k]),
            corners: ends.map(|k| corners[k]),
            ..*a
        })
    })
}

/// True when what is interpolated over a quad does not depend on its diagonal.
fn is_linear([p, q, r, s]: [Corner; 4]) -> bool {
    let sets_are_linear = [0, 1].into_iter().all(|set| {
        let [p, q, r, s] = [p, q, r, s].map(|corner| corner.uv[set]);
        (p + r - q - s).length() <= SAME_PLACE * (p.distance(q) + p.distance(s))
    });
    sets_are_linear
        && (p.normal + r.normal - q.normal - s.normal).length() <= SAME_SHADE
        && (p.tangent + r.tangent - q.tangent - s.tangent).length() <= SAME_SHADE
        && (p.color + r.color - q.color - s.color).length() <= SAME_SHADE
}
