//! The atlas itself: one call a frame, three phases.

use shadecast_protocol::{Block, Epoch, Level, MIN_LOG2_SIDE, PatchId, Placement};

use super::{
    AtlasError, AtlasStats, Placed, Request,
    choice::Chosen,
    superblocks::{Counts, Provision, Superblocks, count_of},
};

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

/// Calls of `place` between two resets below which the second is too soon:
/// SAS 2018, section 5.8, sends its I-frames five frames apart.
const RESET_SPACING: u32 = 5;

/// A reset that comes too soon multiplies the fill target by this.
const FILL_AFTER_EARLY_RESET: f32 = 0.85;

/// What a call without a reset adds to the fill target, up to
/// [`FILL_TARGET`]: slow against [`RESET_SPACING`], so that it does not swing.
const FILL_RECOVERY: f32 = 0.002;

/// Calls of `place` for which a patch that is no longer visible keeps its
/// block, unless the room is needed: a glance away and back at 30 updates a
/// second. The room is needed as soon as new blocks would open another
/// superblock; keeping unseen blocks beyond that tripled the atlas resets.
pub const KEEP_UNSEEN: u32 = 9;

/// The shading atlas's memory and who has which part of it.
#[derive(Clone, Debug)]
pub struct Atlas {
    pub(super) superblocks: Superblocks,
    /// By [`PatchId`], as far as any was seen.
    pub(super) patches: Vec<PatchState>,
    /// Patches that have a block.
    resident: Vec<PatchId>,
    epoch: Epoch,
    /// Counts calls of `place`, from 1.
    pub(super) turn: u32,
    /// Turn of the last reset for want of memory.
    last_reset: Option<u32>,
    resets: u32,
    reset_asked: bool,
    pub(super) fill: f32,
    pub(super) bias: f32,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PatchState {
    pub(super) block: Option<Block>,
    /// The turn in which it was last visible; 0 is never.
    pub(super) seen: u32,
}

/// A patch that needs a block, as the request phase leaves it.
struct Wanted {
    patch: PatchId,
    level: Level,
    /// How many asked for the level before it.
    slot: u32,
}

impl Atlas {
    /// An empty atlas of `size` texels, cut into superblocks of side `superblock`.
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
        Ok(Self {
            superblocks: Superblocks::new(size, superblock.trailing_zeros() as u8),
            patches: Vec::new(),
            resident: Vec::new(),
            epoch: Epoch(0),
            turn: 0,
            last_reset: None,
            resets: 0,
            reset_asked: false,
            fill: FILL_TARGET,
            bias: 0.0,
        })
    }

    /// Where a patch is shaded.
    #[must_use]
    pub fn block_of(&self, patch: PatchId) -> Option<Block> {
        self.patches.get(patch.0 as usize)?.block
    }

    /// The current epoch.
    #[must_use]
    pub fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// Makes the next [`place`](Self::place) reset the atlas, for a client
    /// that lost track.
    pub fn force_reset(&mut self) {
        self.reset_asked = true;
    }

    /// Gives every visible patch a block that suits it, and moves as few as
    /// possible.
    ///
    /// The same calls in the same order give the same placement. State grows
    /// with the largest patch id seen.
    pub fn place(&mut self, visible: &[Request]) -> Placed {
        self.turn += 1;
        let choice = self.choose(visible);
        let mut removals = Vec::new();
        self.remove_unseen_for(KEEP_UNSEEN, &mut removals);
        let (mut wanted, mut counts) = self.request(&choice.patches);

        if self.superblocks.fresh_superblocks(&counts) > 0 {
            self.remove_unseen_for(1, &mut removals);
        }
        let mut provision = self.superblocks.provision(&counts);
        let memory_is_short = provision.is_err() || self.above_high_water();
        let reset = memory_is_short || self.reset_asked;
        if reset {
            removals.clear();
            self.reset(memory_is_short);
            (wanted, counts) = request_all(&choice.patches);
            provision = self.superblocks.provision(&counts);
        } else {
            self.fill = (self.fill + FILL_RECOVERY).min(FILL_TARGET);
        }
        let provision = provision.expect("levels are chosen to fit an empty atlas");
        let (placements, moved) = self.assign(wanted, &provision);

        removals.sort_unstable();
        let unplaced = choice
            .left_out
            .iter()
            .filter(|&&patch| self.block_of(patch).is_none())
            .count();
        Placed {
            epoch: self.epoch,
            reset,
            removals,
            placements,
            moved,
            bias: self.bias,
            unplaced: unplaced as u32,
            stats: self.stats(),
        }
    }

    /// Takes the blocks of patches that have not been visible for `turns`.
    fn remove_unseen_for(&mut self, turns: u32, removals: &mut Vec<PatchId>) {
        self.resident.retain(|&patch| {
            let state = &mut self.patches[patch.0 as usize];
            let keep = self.turn - state.seen < turns;
            if !keep && let Some(block) = state.block.take() {
                self.superblocks.release(block);
                removals.push(patch);
            }
            keep
        });
    }

    /// The request phase: patches whose level changed give their block back,
    /// and all that need one are counted. Their old block stays on record
    /// until the assignment.
    fn request(&mut self, chosen: &[Chosen]) -> (Vec<Wanted>, Counts) {
        let mut counts = Counts::default();
        let mut wanted = Vec::new();
        for chosen in chosen {
            match self.block_of(chosen.patch) {
                Some(block) if block.level == chosen.level => continue,
                Some(block) => self.superblocks.release(block),
                None => {}
            }
            wanted.push(Wanted::draw(chosen, &mut counts));
        }
        (wanted, counts)
    }

    fn above_high_water(&self) -> bool {
        let least_free = (self.superblocks.total() as f32 * HIGH_WATER_FREE) as u32;
        self.superblocks.free() < least_free
    }

    /// Drops all placement and begins an epoch. Blocks of visible patches stay
    /// on record until they are placed anew.
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
        self.superblocks.clear();
        self.resident.retain(|&patch| {
            let state = &mut self.patches[patch.0 as usize];
            let visible = state.seen == self.turn;
            if !visible {
                state.block = None;
            }
            visible
        });
    }

    /// The assignment phase. Returns what is placed, and what of it had
    /// another block before.
    fn assign(
        &mut self,
        mut wanted: Vec<Wanted>,
        provision: &Provision,
    ) -> (Vec<Placement>, Vec<(PatchId, Block, Block)>) {
        wanted.sort_unstable_by_key(|wanted| wanted.patch);
        let mut moved = Vec::new();
        let placements = wanted
            .into_iter()
            .map(|Wanted { patch, level, slot }| {
                let block = self.superblocks.assign(provision, level, slot);
                match self.patches[patch.0 as usize].block.replace(block) {
                    Some(old) => moved.push((patch, old, block)),
                    None => self.resident.push(patch),
                }
                Placement { patch, block }
            })
            .collect();
        (placements, moved)
    }

    /// How full the atlas is.
    #[must_use]
    pub fn stats(&self) -> AtlasStats {
        let free = self.superblocks.free_texels();
        let superblocks = self.superblocks.total();
        let texels = u64::from(superblocks) << (2 * self.superblocks.log2_side());
        AtlasStats {
            texels,
            used_texels: texels - free.in_superblocks - free.in_tails - free.in_stacks,
            stacked_texels: free.in_stacks,
            tail_texels: free.in_tails,
            superblocks,
            free_superblocks: free.superblocks,
            stacked_blocks: free.stacked,
            patches: self.resident.len() as u32,
            resets: self.resets,
        }
    }
}

/// The request phase after a reset: all patches need a block.
fn request_all(chosen: &[Chosen]) -> (Vec<Wanted>, Counts) {
    let mut counts = Counts::default();
    let wanted = chosen
        .iter()
        .map(|chosen| Wanted::draw(chosen, &mut counts))
        .collect();
    (wanted, counts)
}

impl Wanted {
    fn draw(chosen: &Chosen, counts: &mut Counts) -> Self {
        let Chosen { patch, level } = *chosen;
        let count = count_of(counts, level);
        let slot = *count;
        *count += 1;
        Self { patch, level, slot }
    }
}
