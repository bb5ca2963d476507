//! Levels for the visible set, so chosen that all of it fits.
//!
//! Equation 3 gives a first bias; from there it rises in small steps until the
//! rounded levels would fit into an empty atlas. That is counted exactly, in
//! superblocks. So an atlas reset always finds room, and a view that asks for
//! too much gets coarser instead of losing patches. Only where the smallest
//! blocks are too many are the least important patches left out.

use shadecast_protocol::{Level, MIN_LOG2_SIDE, PatchId};

use super::{
    Atlas, Request, bias,
    level::steady_level,
    superblocks::{Counts, count_of},
};

/// Bias is added in steps of this: an eighth of an octave of area is a small
/// part of what [`HYSTERESIS`](super::HYSTERESIS) swallows.
const BIAS_STEP: f32 = 0.125;

/// The bias of the last frame stays while the visible set could do with this
/// much less, so that it does not follow every patch that comes and goes.
const BIAS_DEAD_BAND: f32 = 0.25;

/// log2 of the area of the smallest block.
const LEAST_LOG2_AREA: u8 = 2 * MIN_LOG2_SIDE;

/// A patch that is to have a block of this level.
pub(super) struct Chosen {
    pub(super) patch: PatchId,
    pub(super) level: Level,
}

/// What to place.
pub(super) struct Choice {
    /// In the order of the requests.
    pub(super) patches: Vec<Chosen>,
    /// Visible, but not to be placed.
    pub(super) left_out: Vec<PatchId>,
}

impl Atlas {
    /// Chooses levels, updates the bias, and marks the chosen patches as seen.
    pub(super) fn choose(&mut self, visible: &[Request]) -> Choice {
        let log2_side = self.superblocks.log2_side();
        let budget = ((self.superblocks.total() as f32 * self.fill) as u64).max(1);
        let space = budget << (2 * log2_side);
        let most_patches = (space >> LEAST_LOG2_AREA) as usize;

        let mut requests = self.mark_seen(visible);
        let left_out = self.leave_out(&mut requests, most_patches);

        let (least, most) = (f32::from(LEAST_LOG2_AREA), 2.0 * f32::from(log2_side));
        let areas: Vec<f32> = requests
            .iter()
            .map(|request| request.ideal.log2_area.min(most).exp2())
            .collect();
        let needed = bias(&areas, least.exp2(), most.exp2(), space as f64);
        if needed > self.bias || needed < self.bias - BIAS_DEAD_BAND {
            self.bias = needed;
        }
        let mut patches = Vec::with_capacity(requests.len());
        loop {
            let counts = self.levels(&requests, &mut patches);
            // At the largest bias all blocks are smallest, and those fit.
            if self.superblocks.needed(&counts) <= budget || self.bias >= most - least {
                return Choice { patches, left_out };
            }
            self.bias += BIAS_STEP;
        }
    }

    /// The requests without repetitions.
    fn mark_seen(&mut self, visible: &[Request]) -> Vec<Request> {
        let patches = visible
            .iter()
            .map(|request| request.patch.0 as usize + 1)
            .max();
        if let Some(patches) = patches.filter(|&patches| patches > self.patches.len()) {
            self.patches.resize_with(patches, Default::default);
        }
        let is_new = |request: &&Request| {
            let state = &mut self.patches[request.patch.0 as usize];
            std::mem::replace(&mut state.seen, self.turn) != self.turn
        };
        visible.iter().filter(is_new).copied().collect()
    }

    /// Takes out all but the `most` most important requests, as though they
    /// had just gone out of sight.
    fn leave_out(&mut self, requests: &mut Vec<Request>, most: usize) -> Vec<PatchId> {
        if requests.len() <= most {
            return Vec::new();
        }
        let rank = |request: &Request| {
            let importance = request.importance;
            if importance.is_nan() { 0.0 } else { importance }
        };
        requests.sort_unstable_by(|a, b| {
            rank(b)
                .total_cmp(&rank(a))
                .then_with(|| a.patch.cmp(&b.patch))
        });
        let left_out: Vec<PatchId> = requests.drain(most..).map(|r| r.patch).collect();
        requests.sort_unstable_by_key(|request| request.patch);
        for patch in &left_out {
            self.patches[patch.0 as usize].seen = self.turn - 1;
        }
        left_out
    }

    fn levels(&self, requests: &[Request], chosen: &mut Vec<Chosen>) -> Counts {
        let largest = self.superblocks.log2_side();
        let mut counts = Counts::default();
        chosen.clear();
        for &Request { patch, ideal, .. } in requests {
            let current = self.block_of(patch).map(|block| block.level);
            let level = steady_level(current, ideal, self.bias, largest);
            *count_of(&mut counts, level) += 1;
            chosen.push(Chosen { patch, level });
        }
        counts
    }
}
