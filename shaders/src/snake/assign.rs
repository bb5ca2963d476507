//! Triangles get the free slots of their bins. Twin of `assign.wgsl`.
//!
//! Source: Hladky et al., "SnakeBinning", 2021, sections 3.3 and 3.6.

use super::{
    ActiveTriangle, BINS, NONE, ODD, SnakeParameters, bits, capacity_of,
    place::{Active, Packer, Plan},
};

impl Packer {
    /// Each triangle that wants a slot gets the next free one of its bin.
    pub(super) fn assign(
        &mut self,
        active: &mut [Active],
        plans: &[Plan],
        parameters: &SnakeParameters,
    ) {
        let slots = |bin: usize| capacity_of(&self.places[bin]) as usize;
        let mut taken: Vec<Vec<bool>> = (0..BINS).map(|bin| vec![false; slots(bin)]).collect();
        for active in active.iter_mut() {
            let plan = plans[active.bin as usize];
            let record = &mut active.record;
            let is_idle = record.bits & bits::IDLE != 0;
            if record.bits & bits::KEPT != 0 && plan.moved {
                record.bits = record.bits & !bits::KEPT | bits::WANTED | bits::CHANGED;
            } else if is_idle && (plan.moved || plan.evicts) {
                record.shape = NONE;
            } else if is_idle || record.bits & bits::KEPT != 0 {
                taken[active.bin as usize][record.index as usize] = true;
                self.set_slot(record, active.bin, parameters);
            }
        }
        let mut next = vec![0_usize; BINS];
        for active in active.iter_mut().filter(|active| active.is(bits::WANTED)) {
            let bin = active.bin as usize;
            let free = taken[bin].iter().skip(next[bin]).position(|taken| !taken);
            let Some(free) = free else {
                active.record.shape = NONE;
                active.record.bits &= !bits::CHANGED;
                continue;
            };
            active.record.index = (next[bin] + free) as u32;
            next[bin] += free + 1;
            self.set_slot(&mut active.record, active.bin, parameters);
        }
    }

    /// Tells where a slot lies.
    fn set_slot(&self, record: &mut ActiveTriangle, bin: u32, parameters: &SnakeParameters) {
        let (template, mut index) = (&self.templates[bin as usize], record.index);
        let Some(extent) = self.places[bin as usize].iter().find(|extent| {
            let is_here = index < extent.capacity;
            index -= if is_here { 0 } else { extent.capacity };
            is_here
        }) else {
            return;
        };
        let block = self.superblocks.blocks()[extent.superblock as usize];
        let per = template.in_row(block.width);
        let (row, column) = (index / per, index % per);
        let is_odd = column % 2 == 1;
        let pair = template.to_odd + template.to_even;
        let x = block.x + column / 2 * pair + if is_odd { template.to_odd } else { 0 };
        let y = extent.first * parameters.unit + row * (template.height + 1);
        record.at = x | y << 16;
        record.shape = record.shape & !ODD | if is_odd { ODD } else { 0 };
    }
}
