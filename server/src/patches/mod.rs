//! Cuts a scene into patches: one to three adjacent triangles that are shaded
//! as one rectangle of texels, or, for methods that place triangles by themselves,
//! single triangles.
//!
//! Two triangles that make a flat rectangle fill their block without waste or
//! distortion, so pairs are preferred; a triangle that finds no partner joins
//! a neighbouring pair as a strip of three, and stays alone only where it has
//! no suitable neighbour at all. Before that, triangles with edges too long
//! for the largest block are split (`subdivide`). Afterwards the triangles of
//! a patch are consecutive, the patches of a kind are consecutive, and patches
//! near each other in space have near ids.
//!
//! Source: Mueller et al., "Shading Atlas Streaming", 2018, sections 3.1, 4.1
//! and 6.4, figure 4.

mod adjacency;
mod grouping;
mod layout;
mod subdivide;
#[cfg(test)]
mod tests;

use std::fmt;

use shadecast_protocol::{Method, ObjectId, PatchShape};
use shadecast_shaders::snake::SIZES;

use crate::scene::{Alpha, Scene, Triangle};

/// A scene whose triangles are in the order of its patches.
#[derive(Clone, Debug)]
pub struct PatchedScene {
    /// Its triangles are permuted and the corners of each rotated; upright
    /// quads may be cut along their other diagonal.
    pub scene: Scene,
    /// The index is a [`PatchId`](shadecast_protocol::PatchId).
    pub patches: Vec<Patch>,
    /// What the patches are cut for.
    pub method: Method,
    /// Runs of triangles that are drawn alike; together all triangles, in order.
    pub ranges: Vec<DrawRange>,
    /// What cutting had to say.
    pub report: PatchReport,
}

/// One to three adjacent triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patch {
    /// How the triangles lie in the block.
    pub shape: PatchShape,
    /// Into [`Scene::positions`], in the order of [`PatchShape::corners`];
    /// unused ones repeat the last.
    pub corners: [u32; 5],
    /// Into [`Scene::triangles`]: the first of the patch's, which follow in the
    /// order of [`PatchShape::triangles`], with exactly those corners.
    pub first_triangle: u32,
    /// What it moves with.
    pub object: ObjectId,
    /// Seen from both sides.
    pub double_sided: bool,
    /// Has holes where its material's alpha is below the cutoff.
    pub masked: bool,
}

/// How the triangles of a patch are drawn. Patches do not mix kinds.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Kind {
    double_sided: bool,
    masked: bool,
}

impl Kind {
    fn of(scene: &Scene, triangle: &Triangle) -> Self {
        scene
            .materials
            .get(triangle.material as usize)
            .map_or_else(Self::default, |material| Self {
                double_sided: material.double_sided,
                masked: matches!(material.alpha, Alpha::Mask { .. }),
            })
    }
}

/// Consecutive triangles of one object and kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawRange {
    /// What they move with.
    pub object: ObjectId,
    /// Seen from both sides.
    pub double_sided: bool,
    /// Has holes where its material's alpha is below the cutoff.
    pub masked: bool,
    /// Into [`Scene::triangles`].
    pub first_triangle: u32,
    /// At least one.
    pub triangle_count: u32,
}

/// Texels between the ends of the snake's longest footprint.
const LARGEST_FOOTPRINT: u16 = SIZES[SIZES.len() - 1];

/// Bounds on what is split at load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchLimits {
    /// Edges longer than this are split, metres.
    pub longest_edge: f32,
    /// Splitting stops before there are more triangles than this.
    pub most_triangles: usize,
}

impl PatchLimits {
    /// Nearest distance at which the largest block still gives every pixel its
    /// texel: half a room. Nearer surfaces get as blurred as a video texture does.
    const DISTANCE: f32 = 2.0;

    /// Splitting may not turn a scene into one that loads for minutes: twice
    /// the million triangles that the server is made for.
    const MOST_TRIANGLES: usize = 2_000_000;

    /// Of a triangle that is placed by itself, metres.
    const LONGEST_TRIANGLE: f32 = 1.2;

    /// The longest edge that, square to the view and two metres away, covers
    /// no more pixels than a superblock has texels (SAS 2018, section 6.4).
    #[must_use]
    pub fn for_atlas(superblock_side: u16, pixels_per_radian: f32) -> Self {
        // Beyond a right angle, nearness no longer limits the edge.
        let angle = (f32::from(superblock_side) / pixels_per_radian)
            .clamp(0.01, std::f32::consts::FRAC_PI_2);
        Self {
            longest_edge: 2.0 * Self::DISTANCE * (angle * 0.5).tan(),
            most_triangles: Self::MOST_TRIANGLES,
        }
    }

    /// What [`for_atlas`](Self::for_atlas) is for a method. The snake's largest footprint
    /// does not depend on superblocks, and fewer triangles waste less about their edges;
    /// but one that reaches about the head is measured from too far away.
    #[must_use]
    pub fn for_method(method: Method, superblock_side: u16, pixels_per_radian: f32) -> Self {
        match method {
            Method::Sas | Method::Tss => Self::for_atlas(superblock_side, pixels_per_radian),
            Method::Snake => {
                let limits = Self::for_atlas(LARGEST_FOOTPRINT, pixels_per_radian);
                Self {
                    longest_edge: limits.longest_edge.min(Self::LONGEST_TRIANGLE),
                    ..limits
                }
            }
        }
    }
}

/// What became of the triangles. Displayed as one sentence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PatchReport {
    /// Triangles after splitting.
    pub triangles: usize,
    /// Patches of one triangle.
    pub solos: usize,
    /// Patches of two triangles.
    pub pairs: usize,
    /// Patches of three triangles.
    pub triples: usize,
    /// Edges that were split.
    pub split_edges: usize,
    /// Triangles that splitting added.
    pub added_triangles: usize,
}

impl PatchReport {
    /// Shares of the triangles in patches of one, two and three.
    #[must_use]
    pub fn shares(&self) -> [f32; 3] {
        let all = self.triangles.max(1) as f32;
        [self.solos, 2 * self.pairs, 3 * self.triples].map(|triangles| triangles as f32 / all)
    }
}

impl fmt::Display for PatchReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [solo, pair, triple] = self.shares().map(|share| 100.0 * share);
        write!(
            f,
            "{} triangles in {} patches: {pair:.1} % in pairs, {triple:.1} % in threes, \
             {solo:.1} % alone; {} long edges split, {} triangles added",
            self.triangles,
            self.solos + self.pairs + self.triples,
            self.split_edges,
            self.added_triangles,
        )
    }
}

/// Splits what is too large and groups all triangles into patches of one to three.
///
/// Deterministic. Takes about two seconds for a million triangles.
#[must_use]
pub fn cut(scene: Scene, limits: PatchLimits) -> PatchedScene {
    cut_for(Method::Sas, scene, limits)
}

/// The same for any method: where it places triangles by themselves, none are grouped.
#[must_use]
pub fn cut_for(method: Method, mut scene: Scene, limits: PatchLimits) -> PatchedScene {
    let before = scene.triangles.len();
    let split_edges = subdivide::split_long_edges(&mut scene, limits);
    let added_triangles = scene.triangles.len() - before;

    let groups = match method {
        Method::Sas => grouping::group(&adjacency::Adjacency::new(&scene)),
        Method::Tss | Method::Snake => (0..scene.triangles.len() as u32)
            .map(grouping::Group::Solo)
            .collect(),
    };
    let (patches, ranges) = layout::lay_out(&mut scene, groups);

    let count = |shape| patches.iter().filter(|patch| patch.shape == shape).count();
    let report = PatchReport {
        triangles: scene.triangles.len(),
        solos: count(PatchShape::Solo),
        pairs: count(PatchShape::Pair),
        triples: count(PatchShape::Triple),
        split_edges,
        added_triangles,
    };
    PatchedScene {
        scene,
        patches,
        method,
        ranges,
        report,
    }
}
