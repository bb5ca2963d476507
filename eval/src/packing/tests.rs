//! Strategies that are compared must be sound themselves.

use std::collections::HashMap;

use proptest::prelude::*;
use shadecast_protocol::{Block, PatchId, Slot};
use shadecast_server::atlas::{AtlasShape, AtlasTwin};
use shadecast_shaders::atlas::{Memory, Seen, Wish};

use super::{
    quadtree::Quadtree,
    strategies::{Grids, Without},
};

const SIDE: u16 = 128;
const SUPERBLOCK: u16 = 32;

fn shape() -> AtlasShape {
    AtlasShape::new([SIDE; 2], SUPERBLOCK).expect("a valid size")
}

fn any_frames() -> impl Strategy<Value = Vec<Vec<Seen>>> {
    let seen = (0_u32..300, 0.0_f32..9.0, -3.0_f32..3.0).prop_map(|(patch, area, aspect)| Seen {
        patch,
        pixels: 1 + patch % 9,
        wish: Wish::new(area, aspect),
    });
    let frame = prop::collection::vec(seen, 0..200).prop_map(|mut frame| {
        frame.sort_by_key(|seen| seen.patch);
        frame.dedup_by_key(|seen| seen.patch);
        frame
    });
    prop::collection::vec(frame, 1..30)
}

/// No two blocks share a texel, and every texel is counted once.
fn check<M: Memory>(memory: M, frames: &[Vec<Seen>]) -> AtlasTwin<M> {
    let mut atlas = AtlasTwin::over(shape(), memory);
    let mut known: HashMap<PatchId, Block> = HashMap::new();
    for frame in frames {
        let placed = atlas.place(frame);
        if placed.reset {
            known.clear();
        }
        for patch in &placed.removals {
            assert!(known.remove(patch).is_some());
        }
        known.extend(placed.placements.iter().map(|p| match p.slot {
            Slot::Block(block) => (p.patch, block),
            Slot::Triangle(slot) => panic!("{slot:?}"),
        }));
        let mut taken = vec![false; usize::from(SIDE) * usize::from(SIDE)];
        for block in known.values() {
            let (width, height) = block.level.size();
            for y in u32::from(block.y)..u32::from(block.y) + height {
                for x in u32::from(block.x)..u32::from(block.x) + width {
                    let texel = &mut taken[(y * u32::from(SIDE) + x) as usize];
                    assert!(!std::mem::replace(texel, true), "{block:?} overlaps");
                }
            }
        }
        let used = taken.iter().filter(|taken| **taken).count() as u64;
        assert_eq!(placed.stats.used_texels, used);
    }
    atlas
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn the_quadtree_keeps_blocks_apart_and_merges_all(frames in any_frames()) {
        let shape = shape();
        let tree = Quadtree::new(shape.log2_side(), shape.per_row(), shape.superblocks());
        let mut atlas = check(tree, &frames);
        for _ in 0..10 {
            atlas.place(&[]);
        }
        prop_assert_eq!(atlas.memory().free_texels().superblocks, shape.superblocks());
    }

    #[test]
    fn simpler_strategies_keep_blocks_apart(frames in any_frames()) {
        let shape = shape();
        for (stacks, resets) in [(false, false), (true, false), (true, true)] {
            let without = Without { stacks, resets };
            let grids = Grids::new(without, shape.log2_side(), shape.per_row(), shape.superblocks());
            let mut atlas = check(grids, &frames);
            let last = atlas.place(&[]);
            prop_assert!(!resets || last.stats.resets == 0);
        }
    }
}
