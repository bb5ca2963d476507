//! The twin of all kernels of the atlas: one call a frame.

use super::{
    ActivePatch, AtlasParameters, BIAS_DEAD_BAND, BIAS_STEP, NONE, bias, bits,
    level::{LEVELS, Level, Wish, most_bias, steady_level},
    memory::{Counts, FreeTexels, Memory},
    status,
    superblocks::Superblocks,
};

/// A visible patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    /// Which.
    pub patch: u32,
    /// That it covers; at least 1.
    pub pixels: u32,
    /// What it deserves.
    pub wish: Wish,
}

/// What a frame leaves.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// By ascending patch: all that are visible or had a block.
    pub active: Vec<ActivePatch>,
    /// Visible patches.
    pub visible: u32,
    /// Subtracted from log2 of all areas, steps.
    pub bias: i32,
    /// See [`status`].
    pub status: u32,
}

/// Who has which part of the atlas's memory.
#[derive(Clone, Debug)]
pub struct Placer<M = Superblocks> {
    memory: M,
    /// Patches that have a block, ascending.
    residents: Vec<Resident>,
}

#[derive(Clone, Copy, Debug)]
struct Resident {
    patch: u32,
    position: u32,
    level: Level,
    /// Frames for which it has not been visible.
    age: u32,
}

/// A patch of this frame.
struct Active {
    record: ActivePatch,
    wish: Wish,
}

impl Active {
    fn is(&self, bit: u32) -> bool {
        self.record.bits & bit != 0
    }

    fn old_level(&self) -> Option<Level> {
        (self.record.before != NONE).then(|| Level::of_byte(self.record.bits >> bits::OLD_SHIFT))
    }
}

impl<M: Memory> Placer<M> {
    /// Nothing has a block yet.
    #[must_use]
    pub fn new(memory: M) -> Self {
        Self {
            memory,
            residents: Vec::new(),
        }
    }

    /// What no block occupies.
    #[must_use]
    pub fn free_texels(&self) -> FreeTexels {
        self.memory.free_texels()
    }

    /// The memory behind it.
    #[must_use]
    pub fn memory(&self) -> &M {
        &self.memory
    }

    /// Gives every visible patch a block that suits it, and moves as few as
    /// possible. `seen` ascends by patch.
    pub fn place(&mut self, parameters: &AtlasParameters, seen: &[Seen]) -> Outcome {
        let log2_side = parameters.log2_side as u8;
        let mut outcome = Outcome {
            visible: seen.len() as u32,
            ..Outcome::default()
        };
        let mut active = self.gather(seen);
        if outcome.visible > parameters.most_patches {
            outcome.status |= status::LEFT_OUT;
            leave_out(&mut active, parameters.most_patches);
        }
        outcome.bias = first_bias(&active, parameters);
        let mut counts = choose_levels(&mut active, outcome.bias, log2_side);
        while self.memory.needed(&counts) > u64::from(parameters.budget)
            && outcome.bias < most_bias(log2_side)
        {
            outcome.status |= status::RAISED;
            outcome.bias = (outcome.bias + BIAS_STEP).min(most_bias(log2_side));
            counts = choose_levels(&mut active, outcome.bias, log2_side);
        }
        match self.allocate(&mut active, parameters, &mut outcome.status) {
            Some(provision) => self.assign(&mut active, &provision),
            None => {
                outcome.status |= status::BROKEN;
                self.memory.clear();
            }
        }
        self.residents.clear();
        for Active { record, .. } in &active {
            if record.after != NONE {
                self.residents.push(Resident {
                    patch: record.patch_id,
                    position: record.after,
                    level: Level::of_byte(record.bits),
                    age: record.bits >> bits::AGE_SHIFT,
                });
            }
        }
        outcome.active = active.into_iter().map(|active| active.record).collect();
        outcome
    }

    /// The visible patches and those that have a block, by ascending patch.
    fn gather(&self, seen: &[Seen]) -> Vec<Active> {
        let mut active = Vec::with_capacity(seen.len().max(self.residents.len()));
        let mut residents = self.residents.iter().peekable();
        let of = |seen: Option<&Seen>, resident: Option<&Resident>| {
            let (mut record, mut wish) = (ActivePatch::default(), Wish::default());
            (record.before, record.after) = (NONE, NONE);
            if let Some(resident) = resident {
                let level = resident.level.byte();
                record.patch_id = resident.patch;
                record.before = resident.position;
                record.bits = level | level << bits::OLD_SHIFT;
                record.bits |= (resident.age + 1).min(255) << bits::AGE_SHIFT;
            }
            if let Some(seen) = seen {
                (record.patch_id, record.pixels, wish) = (seen.patch, seen.pixels, seen.wish);
                record.bits = record.bits & 0xffff | bits::SEEN;
            }
            Active { record, wish }
        };
        for seen in seen {
            while let Some(resident) = residents.next_if(|r| r.patch < seen.patch) {
                active.push(of(None, Some(resident)));
            }
            let resident = residents.next_if(|r| r.patch == seen.patch);
            active.push(of(Some(seen), resident));
        }
        active.extend(residents.map(|resident| of(None, Some(resident))));
        active
    }

    /// Request and provisioning, where need be in an empty atlas.
    fn allocate(
        &mut self,
        active: &mut [Active],
        parameters: &AtlasParameters,
        found: &mut u32,
    ) -> Option<M::Provision> {
        let requested = request(active, parameters, false);
        for active in active.iter().filter(|active| active.is(bits::RELEASED)) {
            self.release(active);
        }
        if self.memory.fresh(&requested) > 0 {
            for active in active.iter_mut().filter(|active| active.is(bits::IDLE)) {
                active.record.bits |= bits::RELEASED;
                self.release(active);
            }
        }
        let provision = self.memory.provision(&requested);
        if provision.is_err() {
            *found |= status::FULL;
        } else if self.memory.free() < parameters.least_free {
            *found |= status::HIGH_WATER;
        }
        if *found & (status::FULL | status::HIGH_WATER) == 0 && parameters.reset == 0 {
            return provision.ok();
        }
        *found |= status::RESET;
        self.memory.clear();
        let requested = request(active, parameters, true);
        self.memory.provision(&requested).ok()
    }

    fn release(&mut self, active: &Active) {
        if let Some(level) = active.old_level() {
            self.memory.release(active.record.before, level);
        }
    }

    /// The assignment phase.
    fn assign(&mut self, active: &mut [Active], provision: &M::Provision) {
        let mut drawn: Counts = [0; LEVELS];
        for active in active {
            let record = &mut active.record;
            record.after = if record.bits & bits::WANTED != 0 {
                let level = Level::of_byte(record.bits);
                let slot = &mut drawn[level.index()];
                *slot += 1;
                self.memory.assign(provision, level, *slot - 1)
            } else if record.bits & bits::RELEASED != 0 {
                NONE
            } else {
                record.before
            };
        }
    }
}

/// Takes out all but the `most` most important visible patches, as though they
/// had just gone out of sight.
fn leave_out(active: &mut [Active], most: u32) {
    let mut classes = [0_u32; 256];
    for active in active.iter().filter(|active| active.is(bits::SEEN)) {
        classes[bias::importance(active.record.pixels) as usize] += 1;
    }
    let (mut class, mut left) = (255, most);
    while class > 0 && classes[class] <= left {
        left -= classes[class];
        class -= 1;
    }
    for active in active.iter_mut().filter(|active| active.is(bits::SEEN)) {
        let own = bias::importance(active.record.pixels) as usize;
        if own < class || own == class && left == 0 {
            active.record.bits ^= bits::SEEN | bits::LEFT_OUT;
            active.record.bits |= 1 << bits::AGE_SHIFT;
        } else if own == class {
            left -= 1;
        }
    }
}

/// What equation 3 says, or what was, where that is only a little more.
fn first_bias(active: &[Active], parameters: &AtlasParameters) -> i32 {
    let seen = active.iter().filter(|active| active.is(bits::SEEN));
    let needed = bias::equation_3(
        seen.map(|active| active.wish),
        parameters.log2_side as u8,
        parameters.most_patches,
    );
    if needed > parameters.bias || needed < parameters.bias - BIAS_DEAD_BAND {
        needed
    } else {
        parameters.bias
    }
}

/// Chooses levels at a bias and counts them.
fn choose_levels(active: &mut [Active], bias: i32, log2_side: u8) -> Counts {
    let mut counts = [0; LEVELS];
    for active in active.iter_mut().filter(|active| active.is(bits::SEEN)) {
        let level = steady_level(active.old_level(), active.wish, bias, log2_side);
        active.record.bits = active.record.bits & !bits::LEVEL | level.byte();
        counts[level.index()] += 1;
    }
    counts
}

/// The request phase: who wants a block, and who gives one back.
fn request(active: &mut [Active], parameters: &AtlasParameters, resetting: bool) -> Counts {
    let mut requested = [0; LEVELS];
    for active in active {
        let old = active.old_level();
        let mut flags = 0;
        if active.is(bits::SEEN) {
            let level = Level::of_byte(active.record.bits);
            if resetting || old != Some(level) {
                flags |= bits::WANTED;
                requested[level.index()] += 1;
            }
            if !resetting && old.is_some_and(|old| old != level) {
                flags |= bits::RELEASED;
            }
        } else if old.is_some() {
            let age = active.record.bits >> bits::AGE_SHIFT;
            flags |= if resetting || age >= parameters.keep_unseen {
                bits::RELEASED
            } else {
                bits::IDLE
            };
        }
        let all = bits::WANTED | bits::RELEASED | bits::IDLE;
        active.record.bits = active.record.bits & !all | flags;
    }
    requested
}
