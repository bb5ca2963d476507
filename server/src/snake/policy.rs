//! How full the atlas may be, and when it was emptied: what outlives a frame and
//! needs no kernel.

use shadecast_protocol::{Epoch, PatchId, Placement, Slot, TriangleSlot};
use shadecast_shaders::snake::{
    BIN, NONE, OCTAVE, ODD, Outcome, SIZES, SnakeParameters, Template, bits, status, templates,
};

use super::SnakeError;
use crate::atlas::{AtlasStats, KEEP_UNSEEN, Placed, VisiblePatch};

/// Share of the texels that the visible set may cost in an empty atlas, spare slots,
/// slots of what is out of sight and ends of rows not counted.
pub const FILL_TARGET: f32 = 0.68;
/// The fill target never falls below this.
const LEAST_FILL: f32 = 0.1;
/// Frames between two resets below which the second is too soon: a second at 30
/// updates. A reset moves every triangle, so that room is better left free.
const RESET_SPACING: u32 = 30;
/// A reset that comes too soon multiplies the fill target by this.
const FILL_AFTER_EARLY_RESET: f32 = 0.85;
/// What a frame without a reset adds to the fill target, up to [`FILL_TARGET`].
const FILL_RECOVERY: f32 = 0.002;
/// Bits of a superblock's height: as many units as the kernels keep of it.
const MOST_UNITS: u32 = 512;

/// Size of an atlas that can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SnakeShape {
    size: [u16; 2],
}

impl SnakeShape {
    /// An atlas of `size` texels.
    ///
    /// # Errors
    /// When not a single superblock fits, or a side is odd or too long.
    pub fn new(size: [u16; 2]) -> Result<Self, SnakeError> {
        let is_valid = |side: u16| side.is_multiple_of(2) && (4..=8190).contains(&side);
        if size.into_iter().all(is_valid) {
            Ok(Self { size })
        } else {
            Err(SnakeError::Size(size))
        }
    }

    /// Columns and rows, texels.
    #[must_use]
    pub fn size(self) -> [u16; 2] {
        self.size
    }

    /// All texels.
    #[must_use]
    pub fn texels(self) -> u32 {
        u32::from(self.size[0]) * u32::from(self.size[1])
    }

    /// What depends on the size alone.
    pub(super) fn parameters(self) -> SnakeParameters {
        let [width, height] = self.size.map(u32::from);
        let unit = height.div_ceil(MOST_UNITS).next_multiple_of(2);
        let units = height / unit;
        // A footprint of n steps has n + 1 rows, and lies in whole units.
        let has_room = |size: &&u16| u32::from(**size) < width.min(units * unit);
        SnakeParameters {
            width,
            units,
            unit,
            least_width: (width / 8).next_multiple_of(2).max(8).min(width),
            largest: SIZES.iter().take_while(has_room).count() as u32 - 1,
            keep_unseen: KEEP_UNSEEN,
            ..SnakeParameters::default()
        }
    }
}

/// What the CPU remembers of the frames before.
#[derive(Clone, Debug)]
pub(super) struct Policy {
    shape: SnakeShape,
    templates: Vec<Template>,
    epoch: Epoch,
    /// Counts frames, from 1.
    turn: u32,
    /// Turn of the last reset for want of room.
    last_reset: Option<u32>,
    resets: u32,
    reset_asked: bool,
    fill: f32,
    /// Steps.
    bias: i32,
    /// Slots, by patch.
    slots: Vec<Option<Slot>>,
}

impl Policy {
    pub(super) fn new(shape: SnakeShape) -> Self {
        Self {
            shape,
            templates: templates(),
            epoch: Epoch(0),
            turn: 0,
            last_reset: None,
            resets: 0,
            reset_asked: false,
            fill: FILL_TARGET,
            bias: 0,
            slots: Vec::new(),
        }
    }

    #[cfg(test)]
    pub(super) fn shape(&self) -> SnakeShape {
        self.shape
    }

    pub(super) fn epoch(&self) -> Epoch {
        self.epoch
    }

    pub(super) fn force_reset(&mut self) {
        self.reset_asked = true;
    }

    /// What the next frame is to be placed with.
    pub(super) fn parameters(&self, patch_count: u32) -> SnakeParameters {
        let share = |fill: f32| (self.shape.texels() as f32 * fill) as u32;
        SnakeParameters {
            patch_count,
            budget: share(self.fill),
            // As many as the light can move in a frame.
            most_triangles: (self.shape.texels() / 4).max(1),
            bias: self.bias,
            reset: u32::from(self.reset_asked),
            ..self.shape.parameters()
        }
    }

    /// Takes in what became of the frame.
    pub(super) fn placed(&mut self, outcome: &Outcome) -> Placed {
        self.turn += 1;
        let is = |bit: u32| outcome.status & bit != 0;
        let reset = is(status::RESET);
        if reset {
            self.reset(is(status::FULL), outcome.raised);
        } else {
            self.fill = (self.fill + FILL_RECOVERY).min(FILL_TARGET);
        }
        self.bias = outcome.bias;
        let mut placed = Placed {
            epoch: self.epoch,
            reset,
            out_of_memory: is(status::FULL),
            visible: Vec::with_capacity(outcome.visible as usize),
            removals: Vec::new(),
            placements: Vec::new(),
            moved: Vec::new(),
            bias: self.bias as f32 / OCTAVE as f32,
            unplaced: 0,
            stats: AtlasStats::default(),
        };
        let (mut used, mut residents) = (0, 0);
        let most = outcome
            .active
            .last()
            .map_or(0, |last| last.patch_id as usize + 1);
        if self.slots.len() < most {
            self.slots.resize(most, None);
        }
        for active in &outcome.active {
            let patch = PatchId(active.patch_id);
            let before = self.slots[active.patch_id as usize];
            let is_new = active.bits & bits::CHANGED != 0;
            let after = if active.shape == NONE {
                None
            } else {
                let template = &self.templates[(active.shape & BIN) as usize];
                used += u64::from(template.cost);
                residents += 1;
                Some(Slot::Triangle(slot(template, active.shape, active.at)))
            };
            self.slots[active.patch_id as usize] = after;
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
                // A bin may have moved to where it was.
                (_, Some(after)) if is_new && (reset || before != Some(after)) => {
                    placed.placements.push(Placement { patch, slot: after });
                    placed
                        .moved
                        .extend(before.map(|before| (patch, before, after)));
                }
                _ => {}
            }
        }
        placed.stats = self.stats(outcome, used, residents);
        placed
    }

    fn reset(&mut self, is_full: bool, raised: i32) {
        // Areas were to tell all that the bias had to be.
        self.fill *= (-raised as f32 / OCTAVE as f32).exp2();
        if is_full {
            let last = self.last_reset.replace(self.turn);
            if last.is_some_and(|last| self.turn - last < RESET_SPACING) {
                self.fill *= FILL_AFTER_EARLY_RESET;
            }
        }
        self.fill = self.fill.max(LEAST_FILL);
        self.reset_asked = false;
        self.resets += 1;
        self.epoch.0 += 1;
    }

    fn stats(&self, outcome: &Outcome, used: u64, residents: u32) -> AtlasStats {
        let height = u64::from(self.shape.size[1]);
        let columns: u32 = outcome.superblocks.iter().map(|block| block.width).sum();
        let [_, reserved, slots] = outcome.reserved;
        AtlasStats {
            texels: self.shape.texels().into(),
            used_texels: used,
            stacked_texels: u64::from(reserved).saturating_sub(used),
            tail_texels: (u64::from(columns) * height).saturating_sub(reserved.into()),
            superblocks: outcome.superblocks.len() as u32,
            free_superblocks: 0,
            stacked_blocks: slots.saturating_sub(residents),
            patches: residents,
            resets: self.resets,
        }
    }
}

/// 65535 times the powers of a half, an eighth of an octave apart.
fn weight(depth: u32) -> u16 {
    (65535.0 * (-(f64::from(depth)) / 8.0).exp2()).round() as u16
}

/// The slot of this shape with its first texel there.
fn slot(template: &Template, shape: u32, at: u32) -> TriangleSlot {
    let texels = template.corners([at & 0xffff, at >> 16], shape & ODD != 0);
    // The middle of a texel, in eighths.
    let [larger, smaller, tip] = texels.map(|texel| texel.map(|side| (8 * side + 4) as u16));
    let turn = (shape >> 12 & 7) as usize;
    let mut corners = [tip; 3];
    let (after, before) = ((turn / 2 + 1) % 3, (turn / 2 + 2) % 3);
    (corners[after], corners[before]) = if turn.is_multiple_of(2) {
        (larger, smaller)
    } else {
        (smaller, larger)
    };
    let depths = [15, 20, 25].map(|shift| shape >> shift & 31);
    let nearest = depths.into_iter().min().unwrap_or(0);
    TriangleSlot {
        corners,
        weights: depths.map(|depth| weight(depth - nearest)),
    }
}
