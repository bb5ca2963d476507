//! Which bins get more rows, and which lose some. Twin of `lay.wgsl`.
//!
//! Bins that have rows give back what is beyond their last slot in use; they lose all
//! where they stand nearly empty, or in a superblock that is. Then those with too few
//! slots get more, and where there is no room in further extents, they are laid anew.
//!
//! Source: Hladky et al., "SnakeBinning", 2021, section 3.5, algorithm 2, and section
//! 3.6 for spare slots. There, bins shrink when they are half empty.

use super::{
    BINS, COLLAPSE_SHARE, MOST_LARGE, capacity_of,
    place::{Count, Packer, Plan},
    with_spare,
};

impl Packer {
    /// Algorithm 2. With bins that found no room, the plans are an error.
    pub(super) fn lay_bins(
        &mut self,
        counts: &[Count],
        frozen: bool,
    ) -> Result<Vec<Plan>, Vec<Plan>> {
        let mut plans = vec![Plan::default(); BINS];
        for bin in (0..BINS).rev() {
            let (template, count, extents) =
                (&self.templates[bin], counts[bin], &mut self.places[bin]);
            let capacity = capacity_of(extents);
            if capacity == 0 {
                continue;
            }
            let need = count.need();
            plans[bin].evicts = need + count.idles > capacity;
            let live = need + if plans[bin].evicts { 0 } else { count.idles };
            let least = with_spare(live);
            let is_sparse =
                || count.end > 2 * least && self.superblocks.is_sparse(template, extents, least);
            if live == 0 || !frozen && is_sparse() {
                self.superblocks.release(extents);
                plans[bin].moved = true;
            } else if !frozen {
                self.superblocks
                    .shrink(template, extents, least.max(count.end));
            }
        }
        if !frozen {
            self.collapse(&mut plans);
        }
        self.superblocks.columns.drop_last();
        let mut is_full = false;
        for bin in self.short_of_room(counts) {
            let (template, extents) = (&self.templates[bin], &mut self.places[bin]);
            let asks = with_spare(counts[bin].need());
            plans[bin].moved |= extents.is_empty();
            let more = asks - capacity_of(extents);
            if !self.superblocks.extend(template, extents, more) {
                self.superblocks.release(extents);
                plans[bin].moved = true;
                if !self.superblocks.extend(template, extents, asks) {
                    self.superblocks.release(extents);
                    is_full = true;
                }
            }
        }
        if is_full { Err(plans) } else { Ok(plans) }
    }

    /// Bins that have too few slots, in the order in which they get more.
    fn short_of_room(&self, counts: &[Count]) -> Vec<usize> {
        let sheet = self.superblocks.sheet();
        let capacity = |bin: usize| capacity_of(&self.places[bin]);
        let asks = |bin: &usize| counts[*bin].need() > capacity(*bin);
        let area = |bin: usize| {
            let more = with_spare(counts[bin].need()) - capacity(bin);
            sheet.area(&self.templates[bin], more)
        };
        let (mut large, small): (Vec<usize>, Vec<usize>) =
            ((0..BINS).rev().filter(asks)).partition(|&bin| sheet.is_large(area(bin)));
        if large.len() <= MOST_LARGE {
            large.sort_by_key(|&bin| std::cmp::Reverse(area(bin)));
        }
        large.into_iter().chain(small).collect()
    }

    /// Empties superblocks that have become nearly empty.
    fn collapse(&mut self, plans: &mut [Plan]) {
        let units = self.superblocks.sheet().units;
        let falls: Vec<bool> = (self.superblocks.blocks().iter())
            .map(|block| {
                block.used * COLLAPSE_SHARE < units && block.peak * COLLAPSE_SHARE >= 2 * units
            })
            .collect();
        for (extents, plan) in self.places.iter_mut().zip(plans) {
            if extents
                .iter()
                .any(|extent| falls[extent.superblock as usize])
            {
                self.superblocks.release(extents);
                plan.moved = true;
            }
        }
        for superblock in (0..falls.len()).filter(|&superblock| falls[superblock]) {
            self.superblocks.columns.forget_peak(superblock);
        }
    }
}
