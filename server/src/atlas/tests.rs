//! What must stay true of an atlas, whatever is asked of it, and that the GPU
//! and its twin do the very same.

mod bad_input;
mod both;
mod footprints;
pub(crate) mod watched;

use proptest::prelude::*;
use shadecast_shaders::atlas::{OCTAVE, Seen, Wish};

use self::watched::{Noise, Watched};
use super::*;

fn shape(size: [u16; 2], superblock: u16) -> AtlasShape {
    AtlasShape::new(size, superblock).expect("a valid size")
}

fn seen(patch: u32, log2_area: f32, log2_aspect: f32) -> Seen {
    Seen {
        patch,
        pixels: (log2_area.exp2() as u32).max(1),
        wish: Wish::new(log2_area, log2_aspect),
    }
}

/// Patches with wishes as they come up in a view.
fn view(noise: &mut Noise, count: u32, aspects: [f32; 2]) -> Vec<Seen> {
    let [narrowest, widest] = aspects;
    (0..count)
        .map(|i| {
            seen(
                i,
                noise.between(2.0, 10.0),
                noise.between(narrowest, widest),
            )
        })
        .collect()
}

#[test]
fn sizes_that_cannot_be_are_refused() {
    assert!(AtlasShape::new([512, 256], 64).is_ok());
    assert!(AtlasShape::new([4096, 4096], 256).is_ok());
    for superblock in [0, 1, 2, 48] {
        let refused = AtlasShape::new([512, 512], superblock).err();
        assert_eq!(refused, Some(AtlasError::Superblock(superblock)));
    }
    for size in [[0, 64], [64, 0], [32, 64], [96, 64]] {
        let refused = AtlasShape::new(size, 64).err();
        let superblock = 64;
        assert_eq!(refused, Some(AtlasError::Size { size, superblock }));
    }
}

#[test]
fn what_stands_still_is_not_touched() {
    let mut atlas = Watched::new(shape([512, 512], 64));
    let view = view(&mut Noise(1), 3000, [-1.0, 3.0]);
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
    let mut atlas = Watched::new(shape([512, 512], 64));
    let view = view(&mut Noise(2), 400, [0.0, 3.0]);
    let mut moved = 0;
    for turn in 0..40 {
        // 3 % nearer and farther: a tenth of an octave of area in all.
        let sway = if turn % 2 == 0 { 0.05 } else { -0.05 };
        let octaves = |steps: i32| steps as f32 / OCTAVE as f32;
        let swaying: Vec<_> = view
            .iter()
            .map(|s| {
                let area = octaves(s.wish.area()) + sway;
                seen(s.patch, area, octaves(s.wish.aspect()))
            })
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
    let mut atlas = Watched::new(shape([512, 512], 64));
    let view = [seen(7, 8.0, 0.0)];
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
    let mut atlas = Watched::new(shape([512, 512], 64));
    let view: Vec<_> = (0..2560).map(|i| seen(i, 10.0, 0.0)).collect();
    let placed = atlas.place(&view);
    assert_eq!(placed.unplaced, 0);
    assert!((3.0..4.5).contains(&placed.bias), "{}", placed.bias);
    assert!(placed.stats.used_fraction() > 0.5);
}

#[test]
fn where_even_the_smallest_blocks_are_too_many_the_least_important_wait() {
    let mut atlas = Watched::new(shape([64, 64], 16));
    let view: Vec<_> = (0..2000)
        .map(|i| seen(i, 2.0 + (i % 1000) as f32 * 0.005, 0.0))
        .collect();
    let placed = atlas.place(&view);
    // 12 of 16 superblocks, 64 blocks in each.
    assert_eq!(placed.placements.len(), 768);
    assert_eq!(placed.unplaced, 2000 - 768);
    // Importance counts in eighths of an octave, and the first come first.
    assert!(placed.placements.iter().all(|p| p.patch.0 % 1000 >= 600));
    let again = atlas.place(&view);
    assert!(again.placements.is_empty() && !again.reset);
    assert_eq!(again.unplaced, placed.unplaced);
}

#[test]
fn a_forced_reset_places_anew_in_a_new_epoch() {
    let mut atlas = Watched::new(shape([512, 512], 64));
    let view: Vec<_> = (0..100).map(|i| seen(i, (i % 9) as f32, 1.0)).collect();
    atlas.place(&view);
    atlas.force_reset();
    let placed = atlas.place(&view);
    assert!(placed.reset && !placed.out_of_memory);
    assert_eq!((placed.epoch, placed.placements.len()), (Epoch(1), 100));
    assert!(!atlas.place(&view).reset);
}

/// 10,000 frames of a view that wanders through a scene of 6,000 patches.
#[test]
fn churn_leaks_nothing_and_resets_seldom() {
    let mut atlas = AtlasTwin::new(shape([512, 512], 64));
    let mut noise = Noise(3);
    let sizes: Vec<_> = (0..6000)
        .map(|_| (noise.between(2.0, 9.0), noise.between(-1.0, 3.0)))
        .collect();
    let (mut begin, mut used, mut resets, mut unplaced) = (0, 0.0, 0, 0);
    for turn in 0..10_000_u32 {
        begin += noise.below(3);
        let zoom = (turn as f32 * 0.013).sin();
        let mut view: Vec<_> = (begin..begin + 2000)
            .map(|i| {
                let (area, aspect) = sizes[i as usize % 6000];
                seen(i % 6000, area + zoom, aspect)
            })
            .collect();
        view.sort_unstable_by_key(|seen| seen.patch);
        let placed = atlas.place(&view);
        unplaced += placed.unplaced;
        used += placed.stats.used_fraction();
        resets = placed.stats.resets;
    }
    let used = used / 10_000.0;
    println!("{resets} resets, {used:.2} used");
    assert_eq!(unplaced, 0);
    assert!(resets < 200, "{resets} resets");
    assert!(used > 0.5, "{used} used");
    let last = (0..=KEEP_UNSEEN).map(|_| atlas.place(&[])).last();
    let stats = last.expect("a frame").stats;
    assert_eq!((stats.used_texels, stats.patches), (0, 0));
}

fn any_seen() -> impl Strategy<Value = Seen> {
    let edge_cases = prop_oneof![
        Just(f32::NAN),
        Just(f32::INFINITY),
        Just(f32::NEG_INFINITY),
        Just(-3.0),
    ];
    let area = prop_oneof![20 => 0.0_f32..12.0, 1 => edge_cases.clone()];
    let aspect = prop_oneof![20 => -3.0_f32..6.0, 1 => edge_cases];
    (0_u32..400, area, aspect).prop_map(|(patch, area, aspect)| seen(patch, area, aspect))
}

/// Frames, each ascending by patch, and which of them must begin an epoch.
fn any_frames() -> impl Strategy<Value = Vec<(Vec<Seen>, bool)>> {
    let frame = prop::collection::vec(any_seen(), 0..300).prop_map(|mut frame| {
        frame.sort_by_key(|seen| seen.patch);
        frame.dedup_by_key(|seen| seen.patch);
        frame
    });
    let forced = prop::bool::weighted(0.05);
    prop::collection::vec((frame, forced), 1..25)
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
        let mut watched = Watched::new(shape(size, superblock));
        let mut twin = AtlasTwin::new(shape(size, superblock));
        for (visible, forced) in frames {
            if forced {
                watched.force_reset();
                twin.force_reset();
            }
            prop_assert_eq!(watched.place(&visible), twin.place(&visible));
        }
    }
}
