//! Where in the atlas each visible triangle is shaded by Tessellated Shading Streaming:
//! kernels, and their twin.
//!
//! Each triangle is placed by itself, and all are placed anew for every picture.
//! A triangle of a usual shape is **L-packed**: its samples are those of a regular
//! tessellation, so many to an edge, and lie in the atlas as a right angle whose legs
//! run along rows and columns; two make a rectangle. A **slanted** one, which so would
//! get many samples across and few along, is **oversampled** instead: its longest edge
//! lies along a row, and it has as many columns and rows as it is long and high, in a
//! rectangle of its own. Either way texels are spaced as the eye sees them, and not as
//! they lie on the surface.
//!
//! Sizes are whole numbers of texels in steps of a quarter of an octave ([`Class`]), so
//! rectangles of few kinds fill the atlas in shelves, highest first. Where a shelf
//! begins depends only on how many there are of each kind; a stable sort by kind then
//! tells each triangle its place by ascending patch. So there are only counts, prefix
//! sums and whole numbers: the same input gives the same placement on every driver,
//! and [`Packer`] gives it too. Where not all fit, all become smaller by as many steps
//! as it takes.
//!
//! Source: Hladky et al., "Tessellated Shading Streaming", 2019, as SnakeBinning (Hladky
//! et al., 2021) describes it in sections 2.1 and 5.2 to 5.4. We differ in packing by
//! shelves, in one atlas for both kinds of triangles, in not cutting slanted triangles
//! in two, in measuring lengths as SAS does, and in keeping triangles that have just
//! gone out of sight for as long as SAS keeps blocks.

mod pack;
mod shape;

use bytemuck::{Pod, Zeroable};

pub use pack::{Class, Outcome, Packer, SeenTriangle};
pub use shape::{Shape, shape};

/// Kernel `measure_triangles`.
pub const MEASURE_SOURCE: &str = concat!(
    include_str!("../light/scene.wgsl"),
    include_str!("../atlas/edges.wgsl"),
    include_str!("measure.wgsl")
);

/// Kernels `count_active`, `scan_active`, `gather`, `choose_scale`, `count_digits`,
/// `scan_digits`, `scatter` and `place`.
pub const SOURCE: &str = concat!(
    include_str!("records.wgsl"),
    include_str!("../scan.wgsl"),
    include_str!("gather.wgsl"),
    include_str!("choose.wgsl"),
    include_str!("sort.wgsl"),
    include_str!("place.wgsl"),
);

/// No slot; or, of an age, long out of sight.
pub const NONE: u32 = u32::MAX;

/// Classes of a side, and most steps of scaling down.
pub const CLASSES: usize = 32;

/// Bytes of `Tally` in `records.wgsl`: seen and active triangles by kind.
pub const TALLY_BYTES: u64 = 2 * 4 * (CLASSES * CLASSES) as u64;

/// What became of a frame: bits of [`TssState::status`].
pub mod status {
    /// The smallest rectangles are too many: the last of the smallest triangles wait.
    pub const OVERFULL: u32 = 1;
    /// Triangles out of sight gave way.
    pub const EVICTED: u32 = 2;
}

/// From where triangles are measured.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct MeasureParameters {
    /// Patches of the scene.
    pub patch_count: u32,
    /// In the middle of the eye's picture.
    pub pixels_per_radian: f32,
    /// Frames for which a triangle that is no longer visible keeps being placed.
    pub keep_unseen: u32,
    /// Zero.
    pub padding: u32,
}

/// What a frame is to be placed with.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct TssParameters {
    /// Patches of the scene.
    pub patch_count: u32,
    /// Of the atlas, texels.
    pub width: u32,
    /// Of the atlas, texels.
    pub height: u32,
    /// Largest class of a side: a rectangle of it fits the atlas.
    pub most_class: u32,
    /// As in [`MeasureParameters`].
    pub keep_unseen: u32,
    /// Zero.
    pub padding_0: u32,
    /// Zero.
    pub padding_1: u32,
    /// Zero.
    pub padding_2: u32,
}

/// A triangle that is visible or just was, after the frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct ActiveTriangle {
    /// Which patch.
    pub patch_id: u32,
    /// That it covers in all id pictures.
    pub pixels: u32,
    /// x, and y in the upper half, in eighths of a texel; the first is [`NONE`] where it
    /// has no slot.
    pub corners: [u32; 3],
    /// Of the first corner, of the second in the upper half; of the third.
    pub weights: [u32; 2],
}

/// What the kernels of a frame tell each other and the host.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct TssState {
    /// Triangles that are visible or just were.
    pub active_count: u32,
    /// Triangles that are visible.
    pub seen: u32,
    /// Steps by which all sides are scaled down.
    pub steps: u32,
    /// 1 where only visible triangles are placed.
    pub evict: u32,
    /// Triangles that are to be placed.
    pub placing: u32,
    /// See [`status`].
    pub status: u32,
    /// Texels of all rectangles in use.
    pub used_texels: u32,
    /// Zero.
    pub padding: u32,
}

/// Where the triangles of a kind lie: see `choose.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct CellPlace {
    /// Of those that are placed, in order of kinds, the first of this one.
    pub start: u32,
    /// Rectangles in the shelf that was open before.
    pub in_shelf: u32,
    /// Where they begin: x, and y in the upper half.
    pub first: u32,
    /// Upper row of the first shelf of this kind's own.
    pub next_y: u32,
}
