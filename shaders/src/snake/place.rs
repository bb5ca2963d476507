//! The twin of all kernels of the snake: one call a frame.

use super::{
    ActiveTriangle, BIN, BINS, DEAD_BAND, Extent, FORM, FREEZE_FRAMES, MOST_BIAS, NONE, ODD,
    RAISES, SMALL_CHANGE, SnakeParameters, Superblock, Superblocks, Template, Wish, bin_of,
    bins::{TURN, is_foreshortened_alike},
    bits, is_near, least_bias, map_bin,
    scale::{CELLS, cell},
    status, templates,
};
use crate::atlas::importance;

/// A visible triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    /// Which patch.
    pub patch: u32,
    /// That it covers; at least 1.
    pub pixels: u32,
    /// What it deserves.
    pub wish: Wish,
}

/// What a frame leaves.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// By ascending patch: all that are visible or had a slot.
    pub active: Vec<ActiveTriangle>,
    /// Visible triangles.
    pub visible: u32,
    /// Subtracted from log2 of all areas, steps.
    pub bias: i32,
    /// What of it the empty atlas asked for, beyond what areas told.
    pub raised: i32,
    /// See [`status`].
    pub status: u32,
    /// Bins that have rows, texels of those, and slots in them.
    pub reserved: [u32; 3],
    /// All superblocks, from left to right.
    pub superblocks: Vec<Superblock>,
}

/// Who has which slot.
#[derive(Clone, Debug)]
pub struct Packer {
    pub(super) templates: Vec<Template>,
    pub(super) superblocks: Superblocks,
    pub(super) places: Vec<Vec<Extent>>,
    /// Triangles that have a slot, ascending.
    residents: Vec<ActiveTriangle>,
    frozen_for: u32,
}

/// A triangle of this frame.
pub(super) struct Active {
    pub(super) record: ActiveTriangle,
    wish: Wish,
    /// Shape of the slot that it had.
    old: u32,
    /// The bin that it would choose, or has.
    pub(super) bin: u32,
}

impl Active {
    pub(super) fn is(&self, bit: u32) -> bool {
        self.record.bits & bit != 0
    }
}

/// What is counted of the triangles of a bin.
#[derive(Clone, Copy, Default)]
pub(super) struct Count {
    wants: u32,
    stays: u32,
    pub(super) idles: u32,
    /// Behind the last slot that is in use.
    pub(super) end: u32,
}

impl Count {
    /// Visible triangles.
    pub(super) fn need(self) -> u32 {
        self.stays + self.wants
    }
}

/// What becomes of a bin.
#[derive(Clone, Copy, Default)]
pub(super) struct Plan {
    /// Was given rows in this frame, or has lost them.
    pub(super) moved: bool,
    /// Triangles out of sight give their slots back.
    pub(super) evicts: bool,
}

impl Packer {
    /// Nothing has a slot yet.
    #[must_use]
    pub fn new(parameters: &SnakeParameters) -> Self {
        Self {
            templates: templates(),
            superblocks: Superblocks::new(parameters.sheet()),
            places: vec![Vec::new(); BINS],
            residents: Vec::new(),
            frozen_for: 0,
        }
    }

    /// Gives every visible triangle a slot that suits it, and moves as few as
    /// possible. `seen` ascends by patch.
    pub fn place(&mut self, parameters: &SnakeParameters, seen: &[Seen]) -> Outcome {
        let mut active = self.gather(seen);
        let mut outcome = Outcome {
            visible: seen.len() as u32,
            ..Outcome::default()
        };
        let changed = active.iter().filter(|active| {
            let just_gone = !active.is(bits::SEEN) && active.record.bits >> bits::AGE_SHIFT == 1;
            just_gone || active.is(bits::SEEN) && !active.is(bits::HAD)
        });
        let changed = changed.count() as u32;
        if outcome.visible > parameters.most_triangles {
            outcome.status |= status::LEFT_OUT;
            leave_out(&mut active, parameters.most_triangles);
        }
        outcome.bias = self.first_bias(&active, parameters);
        let is_small = changed.saturating_mul(SMALL_CHANGE) < outcome.visible;
        if is_small
            && self.frozen_for < FREEZE_FRAMES
            && outcome.bias == parameters.bias
            && parameters.reset == 0
        {
            outcome.status |= status::FROZEN;
            self.frozen_for += 1;
        } else {
            self.frozen_for = 0;
        }
        let plans = self.make_room(&mut active, parameters, &mut outcome);
        self.assign(&mut active, &plans, parameters);

        self.residents = active.iter().map(|active| active.record).collect();
        self.residents.retain(|record| record.shape != NONE);
        outcome.active = active.into_iter().map(|active| active.record).collect();
        for extents in &self.places {
            outcome.reserved[0] += u32::from(!extents.is_empty());
            for extent in extents {
                let width = self.superblocks.blocks()[extent.superblock as usize].width;
                outcome.reserved[1] += extent.units * parameters.unit * width;
                outcome.reserved[2] += extent.capacity;
            }
        }
        outcome.superblocks = self.superblocks.blocks().to_vec();
        outcome
    }

    /// The visible triangles and those that have a slot, by ascending patch.
    fn gather(&self, seen: &[Seen]) -> Vec<Active> {
        let mut active = Vec::with_capacity(seen.len().max(self.residents.len()));
        let mut residents = self.residents.iter().peekable();
        let of = |seen: Option<&Seen>, resident: Option<&ActiveTriangle>| {
            let (mut record, mut wish) = (ActiveTriangle::default(), Wish::default());
            let mut old = NONE;
            (record.shape, record.at) = (NONE, NONE);
            if let Some(resident) = resident {
                (record.patch_id, record.index) = (resident.patch_id, resident.index);
                old = resident.shape & !ODD;
                let age = ((resident.bits >> bits::AGE_SHIFT) + 1).min(255);
                record.bits = bits::HAD | age << bits::AGE_SHIFT;
            }
            if let Some(seen) = seen {
                (record.patch_id, record.pixels, wish) = (seen.patch, seen.pixels, seen.wish);
                record.bits = record.bits & bits::HAD | bits::SEEN;
            }
            Active {
                record,
                wish,
                old,
                bin: 0,
            }
        };
        for seen in seen {
            while let Some(resident) = residents.next_if(|r| r.patch_id < seen.patch) {
                active.push(of(None, Some(resident)));
            }
            let resident = residents.next_if(|r| r.patch_id == seen.patch);
            active.push(of(Some(seen), resident));
        }
        active.extend(residents.map(|resident| of(None, Some(resident))));
        active
    }

    /// The least bias, or what was, where that is only a little more.
    fn first_bias(&self, active: &[Active], parameters: &SnakeParameters) -> i32 {
        let mut counts = [0; CELLS];
        for active in active.iter().filter(|active| active.is(bits::SEEN)) {
            counts[cell(active.wish)] += 1;
        }
        let (largest, budget) = (parameters.largest, parameters.budget);
        let needed = least_bias(&self.templates, &counts, largest, budget);
        if (parameters.bias - DEAD_BAND..=parameters.bias).contains(&needed) {
            parameters.bias
        } else {
            needed
        }
    }

    /// Lets triangles choose bins and gives bins rows, where need be in an empty
    /// atlas, and where need be smaller.
    fn make_room(
        &mut self,
        active: &mut [Active],
        parameters: &SnakeParameters,
        outcome: &mut Outcome,
    ) -> Vec<Plan> {
        self.superblocks.columns.begin();
        if parameters.reset == 0 {
            let counts = self.request(active, parameters, outcome, false);
            if let Ok(plans) = self.lay_bins(&counts, outcome.status & status::FROZEN != 0) {
                return plans;
            }
            outcome.status |= status::FULL;
        }
        outcome.status = outcome.status & !status::FROZEN | status::RESET;
        self.frozen_for = 0;
        let mut raises = RAISES.iter();
        loop {
            self.superblocks.columns.clear();
            self.places.fill(Vec::new());
            let counts = self.request(active, parameters, outcome, true);
            let raise = match (self.lay_bins(&counts, false), raises.next()) {
                (Ok(plans), _) | (Err(plans), None) => return plans,
                (Err(_), Some(raise)) => raise,
            };
            let before = outcome.bias;
            outcome.status |= status::RAISED;
            outcome.bias = (outcome.bias + raise).min(MOST_BIAS);
            outcome.raised += outcome.bias - before;
        }
    }

    /// Each triangle chooses a bin, and says whether it keeps its slot.
    fn request(
        &self,
        active: &mut [Active],
        parameters: &SnakeParameters,
        outcome: &Outcome,
        anew: bool,
    ) -> Vec<Count> {
        let frozen = !anew && outcome.status & status::FROZEN != 0;
        let (bias, largest) = (outcome.bias, parameters.largest);
        let mut demand = vec![0_u32; BINS];
        for active in active.iter_mut() {
            active.record.bits &= !(bits::KEPT | bits::WANTED | bits::CHANGED | bits::IDLE);
            if !active.is(bits::SEEN) {
                continue;
            }
            let old_bin = active.old & BIN;
            let has_slot = !anew && active.is(bits::HAD);
            let stays = has_slot
                && (frozen
                    || (active.old ^ active.wish.form()) & TURN == 0
                        && is_near(&self.templates, old_bin, active.wish, bias, largest));
            active.bin = if stays {
                active.record.bits |= bits::KEPT;
                old_bin
            } else {
                bin_of(&self.templates, active.wish, bias, largest)
            };
            demand[active.bin as usize] += 1;
        }
        let is_sink = |bin: u32| {
            let row = self.templates[bin as usize].in_row(parameters.least_width);
            !self.places[bin as usize].is_empty() || demand[bin as usize] > row
        };
        let mapping: Vec<u32> = (0..BINS as u32)
            .map(|bin| match demand[bin as usize] {
                0 => bin,
                _ => map_bin(&self.templates, bin, largest, is_sink),
            })
            .collect();
        let mut counts = vec![Count::default(); BINS];
        for active in active.iter_mut() {
            choose_target(active, &mapping, &mut counts, parameters, frozen, anew);
        }
        counts
    }
}

/// Takes out all but the `most` most important visible triangles, as though they
/// had just gone out of sight.
fn leave_out(active: &mut [Active], most: u32) {
    let mut classes = [0_u32; 256];
    for active in active.iter().filter(|active| active.is(bits::SEEN)) {
        classes[importance(active.record.pixels) as usize] += 1;
    }
    let (mut class, mut left) = (255, most);
    while class > 0 && classes[class] <= left {
        left -= classes[class];
        class -= 1;
    }
    for active in active.iter_mut().filter(|active| active.is(bits::SEEN)) {
        let own = importance(active.record.pixels) as usize;
        if own < class || own == class && left == 0 {
            active.record.bits ^= bits::SEEN | bits::LEFT_OUT;
            active.record.bits |= 1 << bits::AGE_SHIFT;
        } else if own == class {
            left -= 1;
        }
    }
}

/// Where a triangle goes once bins are mapped; counts it there.
fn choose_target(
    active: &mut Active,
    mapping: &[u32],
    counts: &mut [Count],
    parameters: &SnakeParameters,
    frozen: bool,
    anew: bool,
) {
    let has_slot = !anew && active.is(bits::HAD);
    let old_bin = active.old & BIN;
    let record = &mut active.record;
    record.shape = NONE;
    if record.bits & bits::SEEN == 0 {
        let age = record.bits >> bits::AGE_SHIFT;
        if has_slot && age < parameters.keep_unseen {
            record.bits |= bits::IDLE;
            record.shape = active.old;
            active.bin = old_bin;
            let count = &mut counts[old_bin as usize];
            count.idles += 1;
            count.end = count.end.max(record.index + 1);
        }
        return;
    }
    if record.bits & bits::KEPT == 0 {
        active.bin = mapping[active.bin as usize];
    }
    let form = active.wish.form();
    record.shape = active.bin | form;
    let count = &mut counts[active.bin as usize];
    if has_slot && active.bin == old_bin {
        let alike = (active.old ^ form) & TURN == 0 && is_foreshortened_alike(active.old, form);
        record.bits |= bits::KEPT;
        if frozen || alike {
            record.shape = active.old;
        } else {
            record.bits |= bits::CHANGED;
        }
        count.stays += 1;
        count.end = count.end.max(record.index + 1);
    } else {
        record.bits |= bits::WANTED | bits::CHANGED;
        count.wants += 1;
    }
    debug_assert!(record.shape & FORM == record.shape & !BIN);
}
