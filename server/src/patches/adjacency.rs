//! Which triangles may share a patch, and how well they would fit.
//!
//! Neighbours share an edge that they run through in opposite directions, are
//! drawn alike, and meet at no sharp crease: bilinear filtering inside a block
//! would blur the light across it.

use glam::Vec3;

use super::Kind;
use crate::scene::Scene;

/// Largest angle between the normals of two triangles of a patch: 30 degrees,
/// as modelling tools take an edge for a crease from there on.
const LEAST_NORMALS_COSINE: f32 = 0.866_025_4;

/// Triangles about one edge beyond which no neighbours are looked for. Meshes
/// have two, leaves and fins a few; this bounds what a hostile file can cost.
const MOST_AROUND_AN_EDGE: usize = 16;

/// A neighbour across an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link {
    pub(super) triangle: u32,
    /// 0 for a flat rectangle, below 0.1 for what looks like one.
    pub(super) cost: f32,
}

/// For each triangle its neighbours across the edges from corner k to k + 1.
pub(super) struct Adjacency {
    links: Vec<[Option<Link>; 3]>,
}

/// An edge as one triangle sees it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct HalfEdge {
    /// The lesser position above the greater.
    ends: u64,
    /// True when it runs from the greater to the lesser.
    backwards: bool,
    triangle: u32,
    edge: u8,
}

impl Adjacency {
    pub(super) fn new(scene: &Scene) -> Self {
        let faces: Vec<Face> = (0..scene.triangles.len())
            .map(|triangle| Face::new(scene, triangle))
            .collect();
        let mut half_edges = half_edges(scene, &faces);
        half_edges.sort_unstable();
        let mut links = vec![[None; 3]; scene.triangles.len()];
        for around in half_edges.chunk_by(|a, b| a.ends == b.ends) {
            if around.len() > MOST_AROUND_AN_EDGE {
                continue;
            }
            let forwards = around.partition_point(|half| !half.backwards);
            let (forwards, backwards) = around.split_at(forwards);
            for a in forwards {
                // Where more than two meet, each takes the best that is left.
                let best = backwards
                    .iter()
                    .filter(|b| links[b.triangle as usize][usize::from(b.edge)].is_none())
                    .filter_map(|b| Some((b, cost(scene, &faces, a, b)?)))
                    .min_by(|(_, x), (_, y)| x.total_cmp(y));
                if let Some((b, cost)) = best {
                    let link = |triangle| Some(Link { triangle, cost });
                    links[a.triangle as usize][usize::from(a.edge)] = link(b.triangle);
                    links[b.triangle as usize][usize::from(b.edge)] = link(a.triangle);
                }
            }
        }
        Self { links }
    }

    /// Triangles of the scene.
    pub(super) fn len(&self) -> usize {
        self.links.len()
    }

    /// Those that `triangle` may share a patch with.
    pub(super) fn neighbours(&self, triangle: u32) -> impl Iterator<Item = Link> + '_ {
        self.links[triangle as usize].iter().flatten().copied()
    }
}

struct Face {
    /// Unit length, or zero for a triangle without area.
    normal: Vec3,
    kind: Kind,
}

impl Face {
    fn new(scene: &Scene, triangle: usize) -> Self {
        let triangle = &scene.triangles[triangle];
        let [a, b, c] = triangle
            .positions
            .map(|index| scene.positions[index as usize]);
        // Scaled first, so that the cross product of small edges is not lost.
        let (u, v) = (b - a, c - a);
        let scale = u.abs().max_element().max(v.abs().max_element()).recip();
        Self {
            normal: (u * scale).cross(v * scale).normalize_or_zero(),
            kind: Kind::of(scene, triangle),
        }
    }
}

fn half_edges(scene: &Scene, faces: &[Face]) -> Vec<HalfEdge> {
    let mut half_edges = Vec::with_capacity(3 * faces.len());
    for ((index, triangle), face) in (0..).zip(&scene.triangles).zip(faces) {
        if face.normal == Vec3::ZERO {
            continue;
        }
        for edge in 0..3_u8 {
            let from = triangle.positions[usize::from(edge)];
            let to = triangle.positions[usize::from(edge + 1) % 3];
            half_edges.push(HalfEdge {
                ends: u64::from(from.min(to)) << 32 | u64::from(from.max(to)),
                backwards: from > to,
                triangle: index,
                edge,
            });
        }
    }
    half_edges
}

/// How far two triangles are from a flat rectangle; none where they must not
/// share a patch.
fn cost(scene: &Scene, faces: &[Face], a: &HalfEdge, b: &HalfEdge) -> Option<f32> {
    let [(face_a, triangle_a), (face_b, triangle_b)] = [a, b].map(|half| {
        let index = half.triangle as usize;
        (&faces[index], &scene.triangles[index])
    });
    let flatness = face_a.normal.dot(face_b.normal);
    if triangle_a.object != triangle_b.object
        || face_a.kind != face_b.kind
        || flatness < LEAST_NORMALS_COSINE
    {
        return None;
    }
    // The quad p, q', q, p' runs from the apex of one over the shared edge to
    // the apex of the other and back.
    let position = |half: &HalfEdge, corner: u8| {
        let triangle = &scene.triangles[half.triangle as usize];
        scene.positions[triangle.positions[usize::from((half.edge + corner) % 3)] as usize]
    };
    let origin = position(a, 2);
    let [start, end, far] = [position(a, 0), position(a, 1), position(b, 2)].map(|p| p - origin);

    let (diagonal, other) = ((end - start).length(), far.length());
    let skew = (far - start - end).length() / (diagonal + other);
    let slant = (diagonal - other).abs() / (diagonal + other);
    let normal = face_a.normal + face_b.normal;
    let convex =
        start.cross(far - start).dot(normal) > 0.0 && (far - end).cross(end).dot(normal) > 0.0;
    let same_material = triangle_a.material == triangle_b.material;
    Some(
        skew + 0.5 * slant
            + 2.0 * (1.0 - flatness).max(0.0)
            + if convex { 0.0 } else { 1.0 }
            + if same_material { 0.0 } else { 0.5 },
    )
}
