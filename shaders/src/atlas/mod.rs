//! Where in the atlas each visible patch is shaded: kernels, and their twin.
//!
//! A patch keeps its block while its level is unchanged, so that the video
//! encoder sees a still picture and a path tracer may go on accumulating. A
//! frame gathers the patches that are visible or have a block (`gather`),
//! chooses a bias at which all fit (`bias`, `raise`), and allocates in three
//! phases: *request* (blocks come back, new ones are counted), *provisioning*
//! (room is found for each level) and *assignment* (each patch gets its block).
//!
//! Nothing depends on the order in which threads arrive. Each thread of a
//! request has a **run** of consecutive patches and a column of counters of its
//! own; a prefix sum over the runs then turns counts into slots, by ascending
//! patch. Atomics only add up, and everything is a whole number. So the same
//! input gives the same placement on every driver, and [`Placer`] gives it too.
//!
//! Room that runs out is data: see [`status`]. A pass that finds that the
//! chosen levels do not fit, or that memory is short, says so in
//! `AtlasState::verdict`; the kernels after it raise the bias, or begin an
//! empty atlas, and ask again. What is not asked for returns at once.
//!
//! Source: Mueller et al., "Shading Atlas Streaming", 2018, sections 4.2 and
//! 4.3. We differ in drawing slots by prefix sums and not by racing atomics,
//! and in keeping blocks of patches that have just gone out of sight until
//! their room is needed: rasterised visibility flickers on small patches, and
//! accumulated light should survive a flicker.

mod bias;
pub(crate) mod footprint;
mod level;
mod memory;
mod place;
mod superblocks;

use bytemuck::{Pod, Zeroable};

pub use bias::{equation_3, importance};
pub use footprint::{FootprintParameters, edge_pixels, footprint};
pub use level::{
    LEVELS, Level, MAX_LOG2_SIDE, MIN_LOG2_SIDE, OCTAVE, Wish, level, most_bias, steady_level,
};
pub use memory::{Counts, FreeTexels, Full, Memory};
pub use place::{Outcome, Placer, Seen};
pub use superblocks::{Provision, Superblocks, Tail, free_texels};

/// Kernels `count_active`, `scan_active`, `gather`, `leave_out`, `choose_bias`,
/// `request`, `scan_slots`, `provision`, `walk`, `raise`, `release` and `assign`.
pub const SOURCE: &str = concat!(
    include_str!("records.wgsl"),
    include_str!("../scan.wgsl"),
    include_str!("level.wgsl"),
    include_str!("gather.wgsl"),
    include_str!("bias.wgsl"),
    include_str!("request.wgsl"),
    include_str!("provision.wgsl"),
    include_str!("raise.wgsl"),
    include_str!("assign.wgsl"),
);

/// Kernel `measure_footprints`.
pub const FOOTPRINT_SOURCE: &str = concat!(
    include_str!("../light/scene.wgsl"),
    include_str!("edges.wgsl"),
    include_str!("footprint.wgsl")
);

/// No block, or no superblock.
pub const NONE: u32 = u32::MAX;

/// The bias rises by this until the rounded levels fit, steps: an eighth of an
/// octave of area is a small part of what a level tolerates.
pub const BIAS_STEP: i32 = OCTAVE / 8;

/// The bias of the last frame stays while the visible set could do with this
/// much less, steps, so that it does not follow every patch that comes and goes.
pub const BIAS_DEAD_BAND: i32 = OCTAVE / 4;

/// Bytes of `Tally` in `records.wgsl`.
pub const TALLY_BYTES: u64 = 4 * (1024 + 256 + LEVELS as u64 * (1 + WALK_STEPS as u64));

/// Steps of [`BIAS_STEP`] from no bias to the largest, and one more.
const WALK_STEPS: usize = 225;

/// What became of a frame: bits of [`AtlasState::status`].
pub mod status {
    /// Equation 3 was not enough, and the bias rose until the levels fitted.
    pub const RAISED: u32 = 1;
    /// The smallest blocks would be too many: the least important patches wait.
    pub const LEFT_OUT: u32 = 2;
    /// Memory was too fragmented for the requests.
    pub const FULL: u32 = 4;
    /// Memory was more in use than is good for it.
    pub const HIGH_WATER: u32 = 8;
    /// The atlas was emptied, and everything placed anew.
    pub const RESET: u32 = 16;
    /// What may not be was met: no placement is valid, and memory must be
    /// cleared before the next frame.
    pub const BROKEN: u32 = 32;
}

/// Bits of [`ActivePatch::bits`], above the levels.
pub mod bits {
    /// log2 sides of the new block, or of the old one where it stays.
    pub const LEVEL: u32 = 0xff;
    /// Shifts down to the level of the old block.
    pub const OLD_SHIFT: u32 = 8;
    /// Visible and not left out.
    pub const SEEN: u32 = 1 << 16;
    /// Visible, but there is no room for so many.
    pub const LEFT_OUT: u32 = 1 << 17;
    /// Gets another block than it had.
    pub const WANTED: u32 = 1 << 18;
    /// Gives its block back.
    pub const RELEASED: u32 = 1 << 19;
    /// Gives its block back where room is needed.
    pub const IDLE: u32 = 1 << 20;
    /// Shifts down to the frames for which it has not been visible.
    pub const AGE_SHIFT: u32 = 24;
}

/// What a frame is to be placed with.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct AtlasParameters {
    /// Patches of the scene.
    pub patch_count: u32,
    /// log2 of a superblock's side: from 2 to [`MAX_LOG2_SIDE`].
    pub log2_side: u32,
    /// Superblocks side by side.
    pub per_row: u32,
    /// All of them.
    pub superblocks: u32,
    /// Superblocks that the visible set may need in an empty atlas; at least 1.
    pub budget: u32,
    /// With fewer free superblocks after provisioning, the atlas is reset.
    pub least_free: u32,
    /// Smallest blocks in the budget.
    pub most_patches: u32,
    /// Frames for which a patch that is no longer visible keeps its block; below 256.
    pub keep_unseen: u32,
    /// Of the last frame, steps.
    pub bias: i32,
    /// 1 where the atlas is to be reset in any case.
    pub reset: u32,
    /// Zero.
    pub padding: [u32; 2],
}

/// A patch that is visible or has a block, after the frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct ActivePatch {
    /// Which.
    pub patch_id: u32,
    /// That it covers in all id pictures.
    pub pixels: u32,
    /// Position of the block that it had, or [`NONE`]: x, and y in the upper half.
    pub before: u32,
    /// Position of the block that it has, or [`NONE`].
    pub after: u32,
    /// See [`bits`].
    pub bits: u32,
}

/// The memory that outlives a frame, and what the kernels of a frame tell each
/// other. Lists of 16 go by log2 width, longer ones by [`Level::index`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct AtlasState {
    /// Patches that are visible or have a block.
    pub active_count: u32,
    /// Patches that are visible.
    pub visible: u32,
    /// Subtracted from log2 of all areas, steps.
    pub bias: i32,
    /// What the next kernels have to do.
    pub verdict: u32,
    /// See [`status`].
    pub status: u32,
    /// 1 where blocks of patches out of sight go back, too.
    pub evict: u32,
    /// Superblocks that are not free, which are the first.
    pub taken: u32,
    /// Zero.
    pub padding: u32,
    /// The partly filled superblock, or [`NONE`].
    pub tail_superblock: [u32; 16],
    /// Texels of column length in use there.
    pub tail_filled: [u32; 16],
    /// The partly filled superblock before the frame.
    pub old_tail: [u32; 16],
    /// The first superblock that the frame draws.
    pub first_fresh: [u32; 16],
    /// Where a stack begins in `stacks`.
    pub stack_base: [u32; LEVELS],
    /// Free blocks on the stack.
    pub stacked: [u32; LEVELS],
    /// The same before the frame.
    pub stacked_before: [u32; LEVELS],
    /// The same before the assignment takes any.
    pub top: [u32; LEVELS],
    /// Patches that want a block.
    pub requested: [u32; LEVELS],
    /// Blocks given back.
    pub released: [u32; LEVELS],
    /// Blocks of patches out of sight.
    pub idle: [u32; LEVELS],
    /// Requests that the stack cannot serve.
    pub required: [u32; LEVELS],
    /// Where those begin, in heights from the first superblock.
    pub offset: [u32; LEVELS],
}

impl AtlasState {
    /// An empty atlas of so many texels. The stack of a level has room for all
    /// blocks of the level that the atlas could be cut into.
    #[must_use]
    pub fn empty(log2_side: u8, texels: u64) -> Self {
        let mut state = Self::zeroed();
        state.tail_superblock = [NONE; 16];
        let mut base = 0;
        for width in MIN_LOG2_SIDE..=log2_side {
            for height in MIN_LOG2_SIDE..=width {
                state.stack_base[level::index(width, height)] = base as u32;
                base += texels >> (width + height);
            }
        }
        state
    }

    /// Words that the stacks take together.
    #[must_use]
    pub fn stack_words(log2_side: u8, texels: u64) -> u64 {
        let heights = |width| MIN_LOG2_SIDE..=width;
        (MIN_LOG2_SIDE..=log2_side)
            .flat_map(|width| heights(width).map(move |height| texels >> (width + height)))
            .sum()
    }

    /// What no block occupies.
    #[must_use]
    pub fn free_texels(&self, log2_side: u8, superblocks: u32) -> FreeTexels {
        let tails: Vec<Option<Tail>> = (self.tail_superblock.iter().zip(&self.tail_filled))
            .map(|(&superblock, &filled)| {
                (superblock != NONE).then_some(Tail { superblock, filled })
            })
            .collect();
        let free = superblocks.saturating_sub(self.taken);
        free_texels(log2_side, free, &tails, &self.stacked)
    }
}
