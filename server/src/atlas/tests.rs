//! What must stay true of an atlas, whatever is asked of it.

use std::collections::HashMap;

use proptest::prelude::*;

use super::*;

fn request(patch: u32, log2_area: f32, log2_aspect: f32) -> Request {
    Request {
        patch: PatchId(patch),
        ideal: IdealSize {
            log2_area,
            log2_aspect,
        },
        importance: log2_area.exp2(),
    }
}

/// A small seeded sequence (xorshift), so that plain tests need no crate.
struct Noise(u64);

impl Noise {
    fn below(&mut self, end: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 33) as u32 % end
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.below(1 << 16) as f32 / 65536.0
    }
}

/// An atlas and what a client knows of it, which is all that was ever told.
struct Watched {
    atlas: Atlas,
    size: [u16; 2],
    superblock: u16,
    known: HashMap<PatchId, Block>,
}

impl Watched {
    fn new(size: [u16; 2], superblock: u16) -> Self {
        Self {
            atlas: Atlas::new(size, superblock).expect("a valid size"),
            size,
            superblock,
            known: HashMap::new(),
        }
    }

    /// Places, and checks all that is promised.
    fn place(&mut self, visible: &[Request]) -> Placed {
        let epoch = self.atlas.epoch();
        let placed = self.atlas.place(visible);
        assert_eq!(placed.epoch.0, epoch.0 + u32::from(placed.reset));
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
        for &Placement { patch, block } in &placed.placements {
            self.known.insert(patch, block);
            moved.extend(before.get(&patch).map(|&old| (patch, old, block)));
        }
        assert_eq!(moved, placed.moved);
        for (&patch, &block) in &self.known {
            assert_eq!(self.atlas.block_of(patch), Some(block));
        }
        assert_eq!(placed.stats.patches as usize, self.known.len());
        let mut visible: Vec<PatchId> = visible.iter().map(|request| request.patch).collect();
        visible.sort_unstable();
        visible.dedup();
        let holes = visible
            .iter()
            .filter(|patch| !self.known.contains_key(patch));
        assert_eq!(holes.count(), placed.unplaced as usize);
        self.check_texels(&placed.stats);
        placed
    }

    /// No two blocks share a texel, none leaves the atlas or its superblock,
    /// and every texel is counted once.
    fn check_texels(&self, stats: &AtlasStats) {
        let [width, height] = self.size.map(usize::from);
        let mut taken = vec![false; width * height];
        for block in self.known.values() {
            let (w, h) = block.level.size();
            assert!(w >= h && h >= 2);
            assert!(
                block.x % 2 == 0 && block.y % 2 == 0,
                "chroma belongs to one block"
            );
            let side = u32::from(self.superblock);
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
        let side = u64::from(self.superblock);
        let free = u64::from(stats.free_superblocks) * side * side;
        let counted = free + stats.stacked_texels + stats.tail_texels + used;
        assert_eq!(counted, (width * height) as u64);
        assert_eq!(counted, stats.texels);
    }
}

#[test]
fn sizes_that_cannot_be_are_refused() {
    assert!(Atlas::new([512, 256], 64).is_ok());
    assert!(Atlas::new([4096, 4096], 256).is_ok());
    for superblock in [0, 1, 2, 48] {
        let refused = Atlas::new([512, 512], superblock).err();
        assert_eq!(refused, Some(AtlasError::Superblock(superblock)));
    }
    for size in [[0, 64], [64, 0], [32, 64], [96, 64]] {
        let refused = Atlas::new(size, 64).err();
        assert_eq!(
            refused,
            Some(AtlasError::Size {
                size,
                superblock: 64
            })
        );
    }
}

#[test]
fn what_stands_still_is_not_touched() {
    let mut atlas = Watched::new([512, 512], 64);
    let mut noise = Noise(1);
    let view: Vec<_> = (0..3000)
        .map(|i| request(i, noise.between(2.0, 10.0), noise.between(-1.0, 3.0)))
        .collect();
    let first = atlas.place(&view);
    assert_eq!(first.placements.len(), 3000);
    assert!(first.stats.used_fraction() > 0.7, "{:?}", first.stats);
    for _ in 0..20 {
        let again = atlas.place(&view);
        assert!(again.placements.is_empty() && again.removals.is_empty());
        assert_eq!(again.bias, first.bias);
    }
}

#[test]
fn a_swaying_eye_moves_no_blocks() {
    let mut atlas = Watched::new([512, 512], 64);
    let mut noise = Noise(2);
    let view: Vec<_> = (0..400)
        .map(|i| request(i, noise.between(2.0, 10.0), noise.between(0.0, 3.0)))
        .collect();
    let mut moved = 0;
    for turn in 0..40 {
        // 3 % nearer and farther: a tenth of an octave of area in all.
        let sway = if turn % 2 == 0 { 0.05 } else { -0.05 };
        let swaying: Vec<_> = view
            .iter()
            .map(|r| request(r.patch.0, r.ideal.log2_area + sway, r.ideal.log2_aspect))
            .collect();
        let placed = atlas.place(&swaying);
        if turn > 2 {
            moved += placed.placements.len();
        }
    }
    assert_eq!(moved, 0);
}

#[test]
fn a_glance_away_keeps_the_block_and_a_longer_one_frees_it() {
    let mut atlas = Watched::new([512, 512], 64);
    let view = [request(7, 8.0, 0.0)];
    atlas.place(&view);
    for _ in 1..KEEP_UNSEEN {
        assert!(atlas.place(&[]).removals.is_empty());
    }
    assert!(atlas.place(&view).placements.is_empty());
    for _ in 1..KEEP_UNSEEN {
        atlas.place(&[]);
    }
    let gone = atlas.place(&[]);
    assert_eq!(gone.removals, [PatchId(7)]);
    assert_eq!(gone.stats.used_texels, 0);
}

#[test]
fn ten_times_too_much_raises_the_bias_and_loses_nothing() {
    let mut atlas = Watched::new([512, 512], 64);
    let view: Vec<_> = (0..2560).map(|i| request(i, 10.0, 0.0)).collect();
    let placed = atlas.place(&view);
    assert_eq!(placed.unplaced, 0);
    assert!((3.0..4.5).contains(&placed.bias), "{}", placed.bias);
    assert!(placed.stats.used_fraction() > 0.5);
}

#[test]
fn where_even_the_smallest_blocks_are_too_many_the_least_important_wait() {
    let mut atlas = Watched::new([64, 64], 16);
    let view: Vec<_> = (0..2000)
        .map(|i| request(i, 2.0 + (i % 1000) as f32 * 0.005, 0.0))
        .collect();
    let placed = atlas.place(&view);
    // 12 of 16 superblocks, 64 blocks in each.
    assert_eq!(placed.placements.len(), 768);
    assert_eq!(placed.unplaced, 2000 - 768);
    assert!(placed.placements.iter().all(|p| p.patch.0 % 1000 >= 616));
    let again = atlas.place(&view);
    assert!(again.placements.is_empty() && !again.reset);
    assert_eq!(again.unplaced, placed.unplaced);
}

#[test]
fn a_forced_reset_places_anew_in_a_new_epoch() {
    let mut atlas = Watched::new([512, 512], 64);
    let view: Vec<_> = (0..100).map(|i| request(i, (i % 9) as f32, 1.0)).collect();
    atlas.place(&view);
    atlas.atlas.force_reset();
    let placed = atlas.place(&view);
    assert!(placed.reset);
    assert_eq!((placed.epoch, placed.placements.len()), (Epoch(1), 100));
    assert!(!atlas.place(&view).reset);
}

/// 10,000 frames of a view that wanders through a scene of 6,000 patches.
#[test]
fn churn_leaks_nothing_and_resets_seldom() {
    let mut atlas = Atlas::new([512, 512], 64).expect("a valid size");
    let mut noise = Noise(3);
    let sizes: Vec<_> = (0..6000)
        .map(|_| (noise.between(2.0, 9.0), noise.between(-1.0, 3.0)))
        .collect();
    let (mut begin, mut used) = (0, 0.0);
    for turn in 0..10_000_u32 {
        begin += noise.below(3);
        let zoom = (turn as f32 * 0.013).sin();
        let view: Vec<_> = (begin..begin + 2000)
            .map(|i| {
                let (area, aspect) = sizes[i as usize % 6000];
                request(i % 6000, area + zoom, aspect)
            })
            .collect();
        let placed = atlas.place(&view);
        assert_eq!(placed.unplaced, 0);
        used += placed.stats.used_fraction();
    }
    let (resets, used) = (atlas.stats().resets, used / 10_000.0);
    println!("{resets} resets, {used:.2} used");
    assert!(resets < 200, "{resets} resets");
    assert!(used > 0.5, "{used} used");
    for _ in 0..=KEEP_UNSEEN {
        atlas.place(&[]);
    }
    let stats = atlas.stats();
    assert_eq!((stats.used_texels, stats.patches), (0, 0));
}

fn any_request() -> impl Strategy<Value = Request> {
    let edge_cases = prop_oneof![
        Just(f32::NAN),
        Just(f32::INFINITY),
        Just(f32::NEG_INFINITY),
        Just(-3.0),
    ];
    let area = prop_oneof![20 => 0.0_f32..12.0, 1 => edge_cases.clone()];
    let aspect = prop_oneof![20 => -3.0_f32..6.0, 1 => edge_cases];
    (0_u32..400, area, aspect).prop_map(|(patch, area, aspect)| request(patch, area, aspect))
}

fn any_frames() -> impl Strategy<Value = Vec<(Vec<Request>, bool)>> {
    let forced = prop::bool::weighted(0.05);
    prop::collection::vec(
        (prop::collection::vec(any_request(), 0..300), forced),
        1..25,
    )
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) })]

    #[test]
    fn any_sequence_keeps_the_promises(
        frames in any_frames(),
        (size, superblock) in prop_oneof![
            Just(([128, 128], 32)), Just(([64, 192], 64)), Just(([16, 16], 16)), Just(([256, 64], 16)),
        ],
    ) {
        let mut watched = Watched::new(size, superblock);
        let mut twin = Atlas::new(size, superblock).expect("a valid size");
        for (visible, forced) in frames {
            if forced {
                watched.atlas.force_reset();
                twin.force_reset();
            }
            prop_assert_eq!(watched.place(&visible), twin.place(&visible));
        }
    }
}
