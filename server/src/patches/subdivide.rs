//! Splits triangles that are too large for the largest block.
//!
//! The longest edge of the scene is cut in the middle, in every triangle that
//! has it, until no edge is too long. All triangles about an edge are split in
//! the same step, so that no crack can open and the work may stop at any
//! moment; and longest edge first makes well-shaped triangles of any others.
//!
//! Source: Mueller et al., "Shading Atlas Streaming", 2018, section 6.4, asks
//! for it; longest-edge bisection is Rivara's, 1984.

use std::collections::{BinaryHeap, HashMap};

use glam::Vec3;

use super::PatchLimits;
use crate::scene::{Corner, Scene};

/// Splits edges until none is too long. Returns how many were split.
pub(super) fn split_long_edges(scene: &mut Scene, limits: PatchLimits) -> usize {
    // A limit that is no length would never be met.
    if limits.longest_edge.is_nan() || limits.longest_edge <= 0.0 {
        return 0;
    }
    let mut splitter = Splitter {
        longest_edge: limits.longest_edge,
        queue: BinaryHeap::new(),
        triangles_of: HashMap::new(),
        middle_corners: HashMap::new(),
    };
    for triangle in 0..scene.triangles.len() {
        let [a, b, c] = scene.triangles[triangle].positions;
        if a == b || b == c || c == a {
            // A line: nobody sees it, and it would have the same edge twice.
            continue;
        }
        for edge in 0..3 {
            splitter.watch(scene, triangle, edge);
        }
    }
    let mut split = 0;
    while let Some((_, ends)) = splitter.queue.pop() {
        let triangles = splitter.triangles_of.remove(&ends).unwrap_or_default();
        if scene.triangles.len() + triangles.len() > limits.most_triangles {
            break;
        }
        if splitter.split(scene, ends, &triangles) {
            split += 1;
        }
    }
    split
}

/// The two ends of an edge, the lesser position first.
type Ends = (u32, u32);

struct Splitter {
    longest_edge: f32,
    /// Long edges by length; bits of positive floats are ordered as the floats.
    queue: BinaryHeap<(u32, Ends)>,
    /// Which triangles have a long edge.
    triangles_of: HashMap<Ends, Vec<u32>>,
    /// The corner between two corners, so that what was shared stays shared.
    middle_corners: HashMap<(u32, u32), u32>,
}

impl Splitter {
    /// Remembers an edge of a triangle if it is too long.
    fn watch(&mut self, scene: &Scene, triangle: usize, edge: usize) {
        let positions = scene.triangles[triangle].positions;
        let ends = sorted(positions[edge], positions[(edge + 1) % 3]);
        let length = scene.positions[ends.0 as usize].distance(scene.positions[ends.1 as usize]);
        if !(length > self.longest_edge && length.is_finite()) {
            return;
        }
        let triangles = self.triangles_of.entry(ends).or_default();
        if triangles.is_empty() {
            self.queue.push((length.to_bits(), ends));
        }
        triangles.push(triangle as u32);
    }

    /// Cuts an edge in all its triangles; false where floats have no number
    /// between its ends.
    fn split(&mut self, scene: &mut Scene, ends: Ends, triangles: &[u32]) -> bool {
        let [a, b] = [ends.0, ends.1].map(|end| scene.positions[end as usize]);
        let middle = a * 0.5 + b * 0.5;
        if middle == a || middle == b {
            return false;
        }
        let middle_position = scene.positions.len() as u32;
        scene.positions.push(middle);
        for &triangle in triangles {
            self.split_triangle(scene, triangle as usize, ends, middle_position);
        }
        true
    }

    /// The triangle keeps the half at the cut edge's start; the other half is
    /// a new triangle.
    fn split_triangle(&mut self, scene: &mut Scene, index: usize, ends: Ends, middle: u32) {
        let whole = scene.triangles[index];
        let Some(start) = (0..3)
            .find(|&edge| sorted(whole.positions[edge], whole.positions[(edge + 1) % 3]) == ends)
        else {
            return;
        };
        let (end, apex) = ((start + 1) % 3, (start + 2) % 3);
        let corner = self.middle_corner(scene, whole.corners[start], whole.corners[end]);

        let (mut first, mut second) = (whole, whole);
        (first.positions[end], first.corners[end]) = (middle, corner);
        (second.positions[start], second.corners[start]) = (middle, corner);
        let added = scene.triangles.len();
        scene.triangles[index] = first;
        scene.triangles.push(second);

        // The edge from end to apex went over to the new triangle.
        let moved = sorted(whole.positions[end], whole.positions[apex]);
        if let Some(owners) = self.triangles_of.get_mut(&moved) {
            for owner in owners.iter_mut().filter(|owner| **owner == index as u32) {
                *owner = added as u32;
            }
        }
        self.watch(scene, index, start);
        self.watch(scene, index, end);
        self.watch(scene, added, start);
        self.watch(scene, added, apex);
    }

    fn middle_corner(&mut self, scene: &mut Scene, a: u32, b: u32) -> u32 {
        let (a, b) = sorted(a, b);
        *self.middle_corners.entry((a, b)).or_insert_with(|| {
            let middle = interpolate(&scene.corners[a as usize], &scene.corners[b as usize]);
            scene.corners.push(middle);
            scene.corners.len() as u32 - 1
        })
    }
}

fn sorted(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// The corner half way between two.
fn interpolate(a: &Corner, b: &Corner) -> Corner {
    let direction = |a: Vec3, b: Vec3| (a + b).try_normalize().unwrap_or(a);
    Corner {
        normal: direction(a.normal, b.normal),
        tangent: direction(a.tangent.truncate(), b.tangent.truncate()).extend(a.tangent.w),
        uv: [0, 1].map(|set| a.uv[set].midpoint(b.uv[set])),
        color: a.color.midpoint(b.color),
    }
}
