//! Lays the triangles of each patch into its rectangle, and the patches of a
//! scene one after another.

use glam::Vec3;
use shadecast_protocol::PatchShape;

use super::{DrawRange, Kind, Patch, grouping::Group};
use crate::scene::{Scene, Triangle};

/// Reorders and rotates the scene's triangles by patches.
pub(super) fn lay_out(scene: &mut Scene, groups: Vec<Group>) -> (Vec<Patch>, Vec<DrawRange>) {
    let curve = SpaceCurve::through(&scene.positions);
    let mut order: Vec<_> = groups
        .into_iter()
        .map(|group| {
            let first = &scene.triangles[group.first() as usize];
            let [a, b, c] = first.positions.map(|index| scene.positions[index as usize]);
            let place = curve.place((a + b + c) / 3.0);
            (
                first.object,
                Kind::of(scene, first),
                place,
                group.first(),
                group,
            )
        })
        .collect();
    order.sort_unstable_by_key(|&(object, kind, place, first, _)| (object, kind, place, first));

    let mut patches = Vec::with_capacity(order.len());
    let mut triangles = Vec::with_capacity(scene.triangles.len());
    for (object, kind, _, _, group) in order {
        let laid = Laid::new(scene, group);
        patches.push(Patch {
            shape: laid.shape,
            corners: laid.corners,
            first_triangle: triangles.len() as u32,
            object,
            double_sided: kind.double_sided,
            masked: kind.masked,
        });
        triangles.extend(laid.triangles.into_iter().flatten());
    }
    scene.triangles = triangles;
    let ranges = patches
        .chunk_by(|a, b| {
            (a.object, a.double_sided, a.masked) == (b.object, b.double_sided, b.masked)
        })
        .map(|alike| {
            let first = alike[0];
            let triangle_count = alike.iter().map(|patch| patch.shape.triangles().len());
            DrawRange {
                object: first.object,
                double_sided: first.double_sided,
                masked: first.masked,
                first_triangle: first.first_triangle,
                triangle_count: triangle_count.sum::<usize>() as u32,
            }
        })
        .collect();
    (patches, ranges)
}

impl Group {
    /// The first of its triangles in the source.
    fn first(&self) -> u32 {
        match *self {
            Self::Solo(a) => a,
            Self::Pair(a, b) => a.min(b),
            Self::Triple {
                middle,
                ends: [a, b],
            } => middle.min(a).min(b),
        }
    }
}

/// A patch's corners and its triangles, rotated as its shape names them.
struct Laid {
    shape: PatchShape,
    corners: [u32; 5],
    triangles: [Option<Triangle>; 3],
}

impl Laid {
    fn new(scene: &Scene, group: Group) -> Self {
        let triangle = |index: u32| scene.triangles[index as usize];
        match group {
            Group::Solo(a) => {
                let a = triangle(a);
                let a = rotated(a, squarest_corner(scene, &a));
                let [p, q, r] = a.positions;
                Self {
                    shape: PatchShape::Solo,
                    corners: [p, q, r, r, r],
                    triangles: [Some(a), None, None],
                }
            }
            Group::Pair(a, b) => {
                let (a, b) = (triangle(a), triangle(b));
                // Corners 1 and 3 are the ends of the shared edge.
                let a = rotated(a, shared_edge(&a, &b) + 2);
                let b = rotated(b, shared_edge(&b, &a) + 1);
                let [p, q, s] = a.positions;
                let r = b.positions[1];
                Self {
                    shape: PatchShape::Pair,
                    corners: [p, q, r, s, s],
                    triangles: [Some(a), Some(b), None],
                }
            }
            Group::Triple {
                middle,
                ends: [a, b],
            } => {
                let (middle, a, b) = (triangle(middle), triangle(a), triangle(b));
                // Corner 1 is where the two shared edges meet. The edge that
                // leaves it borders the right triangle, the other the left one.
                let (to_a, to_b) = (shared_edge(&middle, &a), shared_edge(&middle, &b));
                let ((right, to_right), left) = if (to_a + 1) % 3 == to_b {
                    ((b, to_b), a)
                } else {
                    ((a, to_a), b)
                };
                let middle = rotated(middle, to_right);
                let left = rotated(left, shared_edge(&left, &middle) + 2);
                let right = rotated(right, shared_edge(&right, &middle) + 1);
                let [apex, lower_right, lower_left] = middle.positions;
                Self {
                    shape: PatchShape::Triple,
                    corners: [
                        left.positions[0],
                        apex,
                        right.positions[1],
                        lower_right,
                        lower_left,
                    ],
                    triangles: [Some(left), Some(middle), Some(right)],
                }
            }
        }
    }
}

/// The triangle with corner `first` (modulo 3) in front; winding is kept.
fn rotated(triangle: Triangle, first: usize) -> Triangle {
    let turn = |of: [u32; 3]| [0, 1, 2].map(|corner| of[(first + corner) % 3]);
    Triangle {
        positions: turn(triangle.positions),
        corners: turn(triangle.corners),
        ..triangle
    }
}

/// The first corner of the edge of `a` that `b` runs through the other way.
fn shared_edge(a: &Triangle, b: &Triangle) -> usize {
    let edge = |of: &Triangle, k: usize| (of.positions[k], of.positions[(k + 1) % 3]);
    (0..3)
        .find(|&k| (0..3).any(|l| (edge(b, l).1, edge(b, l).0) == edge(a, k)))
        .expect("grouped triangles share an edge")
}

/// The corner to lay into the block's corner: the one nearest to a right angle.
fn squarest_corner(scene: &Scene, triangle: &Triangle) -> usize {
    let position = |corner: usize| scene.positions[triangle.positions[corner % 3] as usize];
    let cosine = |corner: usize| {
        let [u, v] = [1, 2].map(|next| position(corner + next) - position(corner));
        u.normalize_or_zero().dot(v.normalize_or_zero()).abs()
    };
    (0..3)
        .min_by(|a, b| cosine(*a).total_cmp(&cosine(*b)))
        .unwrap_or(0)
}

/// A Z-order curve through the scene: near in space is mostly near on it.
struct SpaceCurve {
    origin: Vec3,
    scale: f32,
}

impl SpaceCurve {
    const BITS: u32 = 20;

    fn through(positions: &[Vec3]) -> Self {
        let finite = || positions.iter().copied().filter(|p| p.is_finite());
        let (low, high) = finite().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| {
            (low.min(p), high.max(p))
        });
        let extent = (high - low).max_element().max(f32::MIN_POSITIVE);
        Self {
            origin: low,
            scale: ((1 << Self::BITS) - 1) as f32 / extent,
        }
    }

    fn place(&self, point: Vec3) -> u64 {
        let cell = (point - self.origin) * self.scale;
        // The cast takes NaN to 0 and clamps what lies outside.
        let [x, y, z] = cell.to_array().map(|c| u64::from(c as u32));
        let bits = 0..Self::BITS;
        bits.fold(0, |place, bit| {
            let of = |axis: u64, shift: u32| (axis >> bit & 1) << (3 * bit + shift);
            place | of(x, 0) | of(y, 1) | of(z, 2)
        })
    }
}
