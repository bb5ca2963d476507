//! An atlas of which every promise is checked in every frame.

use std::collections::HashMap;

use shadecast_protocol::{Epoch, PatchId, Placement, Slot, TriangleSlot};
use shadecast_shaders::snake::Seen;

use super::super::{SnakeShape, SnakeTwin};
use crate::atlas::Placed;

/// The triangle of a slot.
pub(super) fn triangle(slot: Slot) -> TriangleSlot {
    match slot {
        Slot::Triangle(slot) => slot,
        Slot::Block(block) => panic!("{block:?} is no triangle"),
    }
}

/// Texels that belong to a slot: those about whose centre an open square of two
/// texels meets the triangle, and so all that bilinear lookups in it may touch.
pub(super) fn texels_of(slot: Slot) -> Vec<[i64; 2]> {
    let corners = triangle(slot).corners.map(|corner| corner.map(i64::from));
    let range = |axis: usize| {
        let sides = corners.map(|corner| corner[axis]);
        let (low, high) = (sides.iter().min(), sides.iter().max());
        low.expect("three") / 8 - 2..=high.expect("three") / 8 + 2
    };
    let meets = |centre: [i64; 2]| {
        let axis = |n: [i64; 2]| {
            let on = |p: [i64; 2]| p[0] * n[0] + p[1] * n[1];
            let [a, b, c] = corners.map(on);
            let reach = 8 * (n[0].abs() + n[1].abs());
            // An edge without length separates nothing.
            reach == 0
                || a.max(b).max(c) > on(centre) - reach && a.min(b).min(c) < on(centre) + reach
        };
        let normal = |from: usize, to: usize| {
            let [x, y] = [0, 1].map(|side| corners[to][side] - corners[from][side]);
            [-y, x]
        };
        axis([1, 0])
            && axis([0, 1])
            && [(0, 1), (1, 2), (2, 0)]
                .iter()
                .all(|&(a, b)| axis(normal(a, b)))
    };
    let (columns, rows) = (range(0), range(1));
    rows.flat_map(|y| columns.clone().map(move |x| [x, y]))
        .filter(|&[x, y]| {
            let is_own = meets([8 * x + 4, 8 * y + 4]);
            // What the light and the client take for the slot's own.
            assert_eq!(is_own, x >= 0 && y >= 0 && slot.owns(x as u32, y as u32));
            is_own
        })
        .collect()
}

/// What a client knows of an atlas, which is all that was ever told.
pub(super) struct Told {
    shape: SnakeShape,
    epoch: Epoch,
    known: HashMap<PatchId, Slot>,
}

impl Told {
    pub(super) fn nothing(shape: SnakeShape) -> Self {
        Self {
            shape,
            epoch: Epoch(0),
            known: HashMap::new(),
        }
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
            assert!(self.known.remove(patch).is_some(), "{patch:?} had no slot");
        }
        assert!(placed.placements.is_sorted_by(|a, b| a.patch < b.patch));
        let mut moved = Vec::new();
        for &Placement { patch, slot } in &placed.placements {
            let weights = triangle(slot).weights;
            assert!(weights.contains(&u16::MAX) && !weights.contains(&0));
            self.known.insert(patch, slot);
            moved.extend(before.get(&patch).map(|&old| (patch, old, slot)));
        }
        assert_eq!(moved, placed.moved);
        if !placed.reset {
            let still = placed.moved.iter().filter(|(_, old, new)| old == new);
            assert_eq!(still.count(), 0, "what does not move is not told");
        }
        assert_eq!(placed.stats.patches as usize, self.known.len());
        assert_eq!(placed.visible.len(), visible.len());
        for (seen, found) in visible.iter().zip(&placed.visible) {
            assert_eq!((found.patch.0, found.pixels), (seen.patch, seen.pixels));
            assert_eq!(found.slot, self.known.get(&found.patch).copied());
        }
        let holes = placed.visible.iter().filter(|found| found.slot.is_none());
        assert_eq!(holes.count(), placed.unplaced as usize);
        self.check_texels(placed);
    }

    /// No two slots share a texel, none leaves the atlas, and what is counted is
    /// what is there.
    fn check_texels(&self, placed: &Placed) {
        let [width, height] = self.shape.size().map(i64::from);
        let mut owner: Vec<Option<PatchId>> = vec![None; (width * height) as usize];
        for (patch, slot) in &self.known {
            for [x, y] in texels_of(*slot) {
                assert!(
                    (0..width).contains(&x) && (0..height).contains(&y),
                    "{slot:?} sticks out"
                );
                let before = owner[(y * width + x) as usize].replace(*patch);
                assert!(
                    before.is_none(),
                    "{before:?} and {patch:?} share {x} {y}: {slot:?}"
                );
            }
        }
        let stats = &placed.stats;
        let owned = owner.iter().flatten().count() as u64;
        // A row's ends are cut off in what a triangle costs.
        let rows = stats.used_texels + stats.stacked_texels;
        assert!(owned <= rows, "{owned} texels in {rows}: {stats:?}");
        assert!(rows + stats.tail_texels <= stats.texels);
        assert_eq!(stats.texels as i64, width * height);
    }
}

/// The twin, and what a client knows of it.
pub(super) struct Watched {
    atlas: SnakeTwin,
    told: Told,
}

impl Watched {
    pub(super) fn new(shape: SnakeShape) -> Self {
        Self {
            atlas: SnakeTwin::new(shape),
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
