//! Where in the atlas each visible triangle is shaded, in the shape that it is
//! seen in: kernels, and their twin.
//!
//! Triangles that look alike share a **bin** (`bins`), a strip in which they stand
//! in a zigzag, every second one upside down. Sparse bins are mapped to fuller ones
//! (`mapping`), and bins lie in superblocks (`superblocks`). A triangle keeps its
//! slot, and so its light, while its bin stays where it is and still suits it.
//!
//! A frame gathers the triangles that are visible or have a slot (`gather`),
//! chooses a bias at which all fit (`scale`), lets each triangle choose a bin and
//! counts (`request`), gives bins their rows (`superblocks`), and gives triangles
//! the free slots of their bins (`assign`): those that want one are sorted by bin
//! with a stable sort (`sort`), and the nth of a bin gets its nth free slot.
//!
//! Nothing depends on the order in which threads arrive, as in [`atlas`](crate::atlas):
//! atomics only add up, and the rest is prefix sums over runs of triangles, in whole
//! numbers. So the same input gives the same placement on every driver, and
//! [`Packer`] gives it too. Where there is no room, the kernels that ask again (in an
//! empty atlas, then smaller and smaller) find work in `SnakeState::verdict`; else
//! they return at once.
//!
//! Source: Hladky et al., "SnakeBinning", 2021, section 3. The original orders
//! triangles by fragment shader interlock, which WebGPU has not, and packs each bin
//! anew in every frame unless the visible set changes by less than 5 %. We differ
//! in never moving a triangle within its bin, because accumulated light would
//! move with it; below 5 % triangles do not change bins either, and bins
//! not their rows, for a few frames. Bins may lie in several pieces, and so a 16th of
//! spare slots does where the original needs 30 %.

mod assign;
mod bins;
mod columns;
mod footprint;
mod lay;
mod mapping;
mod place;
mod scale;
mod sheet;
mod superblocks;

use bytemuck::{Pod, Zeroable};

pub use bins::{
    BIN, BINS, FORM, LONGEST, OCTAVE, PIXEL, SIZES, Template, Wish, bin_of, is_near, parts,
    size_borders, templates,
};
pub use columns::{MOST_LOOKS, MOST_SUPERBLOCKS, Superblock, UNIT_WORDS};
pub use footprint::{NO_TURN, SnakeFootprintParameters, snake_footprint};
pub use mapping::map_bin;
pub use place::{Outcome, Packer, Seen};
pub use scale::{BIAS_STEP, CELLS, DEAD_BAND, MOST_BIAS, least_bias};
pub use sheet::{MOST_LARGE, Sheet};
pub use superblocks::{Extent, MOST_EXTENTS, Superblocks, capacity_of};

/// Kernels `count_active`, `scan_active`, `gather`, `leave_out`, `choose_scale`,
/// `choose_bins`, `map_bins`, `choose_targets`, `superblocks`, `scan_slots`,
/// `mark_taken`, `scan_taken`, `count_low`, `scan_low`, `scatter_low`, `count_high`,
/// `scan_high`, `scatter_high` and `assign`.
pub const SOURCE: &str = concat!(
    include_str!("records.wgsl"),
    include_str!("../scan.wgsl"),
    include_str!("bins.wgsl"),
    include_str!("gather.wgsl"),
    include_str!("scale.wgsl"),
    include_str!("mapping.wgsl"),
    include_str!("request.wgsl"),
    include_str!("columns.wgsl"),
    include_str!("superblocks.wgsl"),
    include_str!("lay.wgsl"),
    include_str!("sort.wgsl"),
    include_str!("assign.wgsl"),
);

/// Kernel `measure_snake_footprints`.
pub const FOOTPRINT_SOURCE: &str = concat!(
    include_str!("../light/scene.wgsl"),
    include_str!("footprint.wgsl")
);

/// No slot, or no superblock.
pub const NONE: u32 = u32::MAX;
/// Set in a slot's shape where the triangle stands upside down.
pub const ODD: u32 = 1 << 30;

/// Frames in a row that a small change of the visible set leaves triangles in
/// their bins: a fifth of a second at 30 updates a second.
pub const FREEZE_FRAMES: u32 = 6;
/// The change is small while it is less than the visible set by this factor (5 %).
pub const SMALL_CHANGE: u32 = 20;
/// A superblock collapses when less than this share of its units is taken, after
/// twice as much has been.
pub const COLLAPSE_SHARE: u32 = 8;
/// What the bias rises by where the empty atlas is too small for what it was to
/// hold: half an octave, then one, then two, then all that there is.
pub const RAISES: [i32; 4] = [128, 256, 512, MOST_BIAS];

/// Triangles that a bin gets room for: a 16th to spare, and what its last row has
/// besides.
#[must_use]
pub fn with_spare(triangles: u32) -> u32 {
    triangles + triangles / 16
}

/// Words of `SnakeTally` in `records.wgsl`.
pub const TALLY_WORDS: u64 = (5 * BINS + CELLS + 256) as u64;

/// What became of a frame: bits of [`SnakeState::status`].
pub mod status {
    /// The empty atlas was too small, and the bias rose.
    pub const RAISED: u32 = 1;
    /// The smallest triangles would be too many: the least important wait.
    pub const LEFT_OUT: u32 = 2;
    /// There was no room for a bin.
    pub const FULL: u32 = 4;
    /// The visible set changed so little that triangles stayed in their bins.
    pub const FROZEN: u32 = 8;
    /// The atlas was emptied, and everything placed anew.
    pub const RESET: u32 = 16;
}

/// Bits of [`ActiveTriangle::bits`].
pub mod bits {
    /// Visible and not left out.
    pub const SEEN: u32 = 1;
    /// Visible, but there is no room for so many.
    pub const LEFT_OUT: u32 = 1 << 1;
    /// Had a slot before the frame.
    pub const HAD: u32 = 1 << 2;
    /// Keeps it.
    pub const KEPT: u32 = 1 << 3;
    /// Asks for a slot.
    pub const WANTED: u32 = 1 << 4;
    /// Is to be told: another slot, or another form of it.
    pub const CHANGED: u32 = 1 << 5;
    /// Has a slot, but is not visible.
    pub const IDLE: u32 = 1 << 6;
    /// Shifts down to the frames for which it has not been visible.
    pub const AGE_SHIFT: u32 = 24;
}

/// What a frame is to be placed with.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct SnakeParameters {
    /// Patches of the scene, each a triangle.
    pub patch_count: u32,
    /// Columns of the atlas.
    pub width: u32,
    /// Units of its height.
    pub units: u32,
    /// Rows of a unit.
    pub unit: u32,
    /// Columns of the narrowest superblock.
    pub least_width: u32,
    /// Index of the largest size that has room.
    pub largest: u32,
    /// Texels that the visible set may cost.
    pub budget: u32,
    /// Visible triangles that the smallest slots have room for.
    pub most_triangles: u32,
    /// Frames for which a triangle that is no longer visible keeps its slot; below 256.
    pub keep_unseen: u32,
    /// Of the last frame, steps.
    pub bias: i32,
    /// 1 where the atlas is to be reset in any case.
    pub reset: u32,
    /// Zero.
    pub padding: u32,
}

impl SnakeParameters {
    /// The atlas as bins see it.
    #[must_use]
    pub fn sheet(&self) -> Sheet {
        Sheet {
            width: self.width,
            units: self.units,
            unit: self.unit,
            least_width: self.least_width,
        }
    }
}

/// A triangle that is visible or had a slot, after the frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct ActiveTriangle {
    /// Which patch.
    pub patch_id: u32,
    /// That it covers in all id pictures.
    pub pixels: u32,
    /// See [`bits`].
    pub bits: u32,
    /// Bin, turn and depths of its slot, and [`ODD`]; [`NONE`] without one.
    pub shape: u32,
    /// Which slot of the bin.
    pub index: u32,
    /// The slot's first texel: x, and y in the upper half.
    pub at: u32,
}

/// The memory that outlives a frame, and what the kernels of a frame tell each other.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct SnakeState {
    /// Triangles that are visible or have a slot.
    pub active_count: u32,
    /// Triangles that are visible.
    pub visible: u32,
    /// Triangles that came into sight or went out of it.
    pub changed: u32,
    /// Subtracted from log2 of all areas, steps.
    pub bias: i32,
    /// What the next kernels have to do.
    pub verdict: u32,
    /// See [`status`].
    pub status: u32,
    /// Frames in a row that were frozen.
    pub frozen_for: u32,
    /// Superblocks that there are.
    pub superblock_count: u32,
    /// Triangles that ask for a slot.
    pub requests: u32,
    /// Words of slots, 32 a word.
    pub words: u32,
    /// Looks for room that were taken.
    pub looks: u32,
    /// Texels of the rows that bins have.
    pub reserved: u32,
    /// Bins that have rows.
    pub bins: u32,
    /// Slots that they have.
    pub slots: u32,
    /// What of the bias the empty atlas asked for, steps.
    pub raised: i32,
    /// Zero.
    pub padding: u32,
    /// First column, columns, units in use and their peak.
    pub superblocks: [[u32; 4]; MOST_SUPERBLOCKS],
}

impl SnakeState {
    /// Bytes of the state with what the CPU never reads: units of each superblock;
    /// superblock, first unit, units and capacity of each extent; a list of bins.
    pub const BYTES: u64 = size_of::<Self>() as u64
        + (MOST_SUPERBLOCKS * UNIT_WORDS * 4 + BINS * (8 + MOST_EXTENTS * 16 + 4)) as u64;
}
