//! An atlas of which every promise is checked in every frame.

use std::collections::HashMap;

use shadecast_shaders::atlas::Seen;

use super::super::{AtlasShape, AtlasStats, AtlasTwin, Placed};
use shadecast_protocol::{Block, Epoch, PatchId, Placement, Slot};

/// A small seeded sequence (xorshift), so that plain tests need no crate.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    pub(crate) fn below(&mut self, end: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 33) as u32 % end
    }

    pub(crate) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.below(1 << 16) as f32 / 65536.0
    }
}

/// The only kind of slot here.
pub(super) fn block_of(slot: Slot) -> Block {
    match slot {
        Slot::Block(block) => block,
        Slot::Triangle(slot) => panic!("{slot:?}"),
    }
}

/// What a client knows of an atlas, which is all that was ever told.
pub(super) struct Told {
    shape: AtlasShape,
    epoch: Epoch,
    known: HashMap<PatchId, Block>,
}

impl Told {
    pub(super) fn nothing(shape: AtlasShape) -> Self {
        Self {
            shape,
            epoch: Epoch(0),
            known: HashMap::new(),
        }
    }

    /// The same in a later epoch.
    pub(super) fn begin(&mut self, epoch: Epoch) {
        self.epoch = epoch;
    }

    /// Takes in a frame, and checks all that is promised of it.
    pub(super) fn take_in(&mut self, visible: &[Seen], placed: &Placed) {
        assert_eq!(placed.epoch.0, self.epoch.0 + u32::from(placed.reset));
        self.epoch = placed.epoch;
        let before = std::mem::take(&mut self.known);
        if placed.reset {
            assert!(placed.removals.is_empty());
        } else {
            self.known.clone_from(&before);
        }
        assert!(placed.removals.is_sorted() && placed.moved.is_sorted_by_key(|m| m.0));
        for patch in &placed.removals {
            assert!(self.known.remove(patch).is_some(), "{patch:?} had no block");
        }
        assert!(placed.placements.is_sorted_by(|a, b| a.patch < b.patch));
        let mut moved = Vec::new();
        for &Placement { patch, slot } in &placed.placements {
            self.known.insert(patch, block_of(slot));
            let old = before.get(&patch).map(|old| Slot::Block(*old));
            moved.extend(old.map(|old| (patch, old, slot)));
        }
        assert_eq!(moved, placed.moved);
        assert_eq!(placed.stats.patches as usize, self.known.len());
        assert_eq!(placed.visible.len(), visible.len());
        for (seen, found) in visible.iter().zip(&placed.visible) {
            assert_eq!((found.patch.0, found.pixels), (seen.patch, seen.pixels));
            let known = self.known.get(&found.patch).copied();
            assert_eq!(found.slot, known.map(Slot::Block));
        }
        let holes = placed.visible.iter().filter(|found| found.slot.is_none());
        assert_eq!(holes.count(), placed.unplaced as usize);
        self.check_texels(&placed.stats);
    }

    /// No two blocks share a texel, none leaves the atlas or its superblock,
    /// and every texel is counted once.
    fn check_texels(&self, stats: &AtlasStats) {
        let side = 1_u32 << self.shape.log2_side();
        let columns = self.shape.per_row();
        let width = (columns * side) as usize;
        let height = (self.shape.superblocks() / columns * side) as usize;
        let mut taken = vec![false; width * height];
        for block in self.known.values() {
            let (w, h) = block.level.size();
            assert!(w >= h && h >= 2);
            assert!(
                block.x % 2 == 0 && block.y % 2 == 0,
                "chroma belongs to one block"
            );
            assert!(u32::from(block.x) % side + w <= side && u32::from(block.y) % side + h <= side);
            for y in usize::from(block.y)..usize::from(block.y) + h as usize {
                let row = y * width + usize::from(block.x);
                for texel in &mut taken[row..row + w as usize] {
                    assert!(!std::mem::replace(texel, true), "{block:?} overlaps");
                }
            }
        }
        let used = taken.iter().filter(|&&taken| taken).count() as u64;
        assert_eq!(stats.used_texels, used);
        let free = u64::from(stats.free_superblocks) * u64::from(side) * u64::from(side);
        let counted = free + stats.stacked_texels + stats.tail_texels + used;
        assert_eq!(counted, (width * height) as u64);
        assert_eq!(counted, stats.texels);
    }
}

/// The twin, and what a client knows of it.
pub(super) struct Watched {
    atlas: AtlasTwin,
    told: Told,
}

impl Watched {
    pub(super) fn new(shape: AtlasShape) -> Self {
        Self {
            atlas: AtlasTwin::new(shape),
            told: Told::nothing(shape),
        }
    }

    pub(super) fn force_reset(&mut self) {
        self.atlas.force_reset();
    }

    pub(super) fn place(&mut self, visible: &[Seen]) -> Placed {
        let placed = self.atlas.place(visible);
        self.told.take_in(visible, &placed);
        placed
    }
}
