//! How full the atlas may be, and when it was emptied: what outlives a frame
//! and needs no kernel.

use shadecast_protocol::{Block, Epoch, Level, PatchId, Placement, Slot};
use shadecast_shaders::atlas::{
    AtlasParameters, FreeTexels, Level as BlockLevel, MIN_LOG2_SIDE, NONE, OCTAVE, Outcome, bits,
    status,
};

use super::{AtlasError, AtlasStats, Placed, VisiblePatch};

/// Share of the superblocks that the visible set may need in an empty atlas.
/// For an eye that walks and looks about, 0.75 halves the resets of 0.85 and
/// costs a quarter of an octave of bias; this lies between.
pub const FILL_TARGET: f32 = 0.8;

/// The fill target never falls below this: with three quarters of the atlas
/// to spare, even a whole new view fits beside the old one.
const LEAST_FILL: f32 = 0.25;

/// Share of superblocks that must be free after provisioning; else the atlas
/// is reset. SAS 2018, section 5.4, sets its high-water mark at 96 %.
const HIGH_WATER_FREE: f32 = 0.04;

/// Frames between two resets below which the second is too soon: SAS 2018,
/// section 5.8, sends its I-frames five frames apart.
const RESET_SPACING: u32 = 5;

/// A reset that comes too soon multiplies the fill target by this.
const FILL_AFTER_EARLY_RESET: f32 = 0.85;

/// What a frame without a reset adds to the fill target, up to
/// [`FILL_TARGET`]: slow against [`RESET_SPACING`], so that it does not swing.
const FILL_RECOVERY: f32 = 0.002;

/// Frames for which a patch that is no longer visible keeps its block, unless
/// the room is needed: a glance away and back at 30 updates a second. The room
/// is needed as soon as new blocks would open another superblock; keeping
/// unseen blocks beyond that tripled the atlas resets.
pub const KEEP_UNSEEN: u32 = 9;

/// Size of an atlas that can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AtlasShape {
    columns: u32,
    rows: u32,
    log2_side: u8,
}

impl AtlasShape {
    /// An atlas of `size` texels, cut into superblocks of side `superblock`.
    ///
    /// # Errors
    /// When the superblock is no power of two, or does not tile the atlas.
    pub fn new(size: [u16; 2], superblock: u16) -> Result<Self, AtlasError> {
        if !superblock.is_power_of_two() || superblock <= 1 << MIN_LOG2_SIDE {
            return Err(AtlasError::Superblock(superblock));
        }
        if size.iter().any(|&side| side == 0 || side % superblock != 0) {
            return Err(AtlasError::Size { size, superblock });
        }
        let [columns, rows] = size.map(|side| u32::from(side / superblock));
        Ok(Self {
            columns,
            rows,
            log2_side: superblock.trailing_zeros() as u8,
        })
    }

    /// log2 of a superblock's side.
    #[must_use]
    pub fn log2_side(self) -> u8 {
        self.log2_side
    }

    /// Superblocks side by side.
    #[must_use]
    pub fn per_row(self) -> u32 {
        self.columns
    }

    /// All superblocks.
    #[must_use]
    pub fn superblocks(self) -> u32 {
        self.columns * self.rows
    }

    /// All texels.
    #[must_use]
    pub fn texels(self) -> u64 {
        u64::from(self.superblocks()) << (2 * self.log2_side)
    }
}

/// What the CPU remembers of the frames before.
#[derive(Clone, Debug)]
pub(super) struct Policy {
    shape: AtlasShape,
    epoch: Epoch,
    /// Counts frames, from 1.
    turn: u32,
    /// Turn of the last reset for want of memory.
    last_reset: Option<u32>,
    resets: u32,
    reset_asked: bool,
    fill: f32,
    /// Steps.
    bias: i32,
}

impl Policy {
    pub(super) fn new(shape: AtlasShape) -> Self {
        Self {
            shape,
            epoch: Epoch(0),
            turn: 0,
            last_reset: None,
            resets: 0,
            reset_asked: false,
            fill: FILL_TARGET,
            bias: 0,
        }
    }

    pub(super) fn shape(&self) -> AtlasShape {
        self.shape
    }

    pub(super) fn epoch(&self) -> Epoch {
        self.epoch
    }

    pub(super) fn force_reset(&mut self) {
        self.reset_asked = true;
    }

    /// What the next frame is to be placed with.
    pub(super) fn parameters(&self, patch_count: u32) -> AtlasParameters {
        let AtlasShape { log2_side, .. } = self.shape;
        let superblocks = self.shape.superblocks();
        let budget = ((superblocks as f32 * self.fill) as u32).max(1);
        let blocks = u64::from(budget) << (2 * (log2_side - MIN_LOG2_SIDE));
        AtlasParameters {
            patch_count,
            log2_side: u32::from(log2_side),
            per_row: self.shape.columns,
            superblocks,
            budget,
            least_free: (superblocks as f32 * HIGH_WATER_FREE) as u32,
            most_patches: u32::try_from(blocks).unwrap_or(u32::MAX),
            keep_unseen: KEEP_UNSEEN,
            bias: self.bias,
            reset: u32::from(self.reset_asked),
            padding: [0; 2],
        }
    }

    /// Takes in what became of the frame; `free` is what no block occupies now.
    pub(super) fn placed(&mut self, outcome: Outcome, free: FreeTexels) -> Placed {
        self.turn += 1;
        let found = outcome.status;
        let broken = found & status::BROKEN != 0;
        let reset = broken || found & status::RESET != 0;
        let memory_is_short = found & (status::FULL | status::HIGH_WATER) != 0;
        if reset {
            self.reset(memory_is_short);
        } else {
            self.fill = (self.fill + FILL_RECOVERY).min(FILL_TARGET);
        }
        self.bias = outcome.bias;
        let mut placed = Placed {
            epoch: self.epoch,
            reset,
            out_of_memory: found & status::FULL != 0,
            visible: Vec::with_capacity(outcome.visible as usize),
            removals: Vec::new(),
            placements: Vec::new(),
            moved: Vec::new(),
            bias: self.bias as f32 / OCTAVE as f32,
            unplaced: 0,
            stats: AtlasStats::default(),
        };
        let mut residents = 0;
        for active in &outcome.active {
            let patch = PatchId(active.patch_id);
            let before = block(active.before, active.bits >> bits::OLD_SHIFT);
            let after = block(active.after, active.bits).filter(|_| !broken);
            residents += u32::from(after.is_some());
            if active.pixels > 0 {
                placed.visible.push(VisiblePatch {
                    patch,
                    pixels: active.pixels,
                    slot: after,
                });
                placed.unplaced += u32::from(after.is_none());
            }
            match (before, after) {
                (Some(_), None) if !reset => placed.removals.push(patch),
                (_, Some(slot)) if active.bits & bits::WANTED != 0 => {
                    placed.placements.push(Placement { patch, slot });
                    placed
                        .moved
                        .extend(before.map(|before| (patch, before, slot)));
                }
                _ => {}
            }
        }
        placed.stats = self.stats(free, residents);
        placed
    }

    fn reset(&mut self, memory_is_short: bool) {
        if memory_is_short {
            if self
                .last_reset
                .is_some_and(|last| self.turn - last < RESET_SPACING)
            {
                self.fill = (self.fill * FILL_AFTER_EARLY_RESET).max(LEAST_FILL);
            }
            self.last_reset = Some(self.turn);
        }
        self.reset_asked = false;
        self.resets += 1;
        self.epoch.0 += 1;
    }

    fn stats(&self, free: FreeTexels, residents: u32) -> AtlasStats {
        let texels = self.shape.texels();
        AtlasStats {
            texels,
            used_texels: texels
                .saturating_sub(free.in_superblocks + free.in_tails + free.in_stacks),
            stacked_texels: free.in_stacks,
            tail_texels: free.in_tails,
            superblocks: self.shape.superblocks(),
            free_superblocks: free.superblocks,
            stacked_blocks: free.stacked,
            patches: residents,
            resets: self.resets,
        }
    }
}

/// The block at a position, with the level in the lowest byte of `level`.
fn block(position: u32, level: u32) -> Option<Slot> {
    let BlockLevel { width, height } = BlockLevel::of_byte(level);
    let block = Block {
        x: position as u16,
        y: (position >> 16) as u16,
        level: Level { width, height },
    };
    (position != NONE).then_some(Slot::Block(block))
}
