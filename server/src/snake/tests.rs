//! What must stay true of an atlas, whatever is asked of it, and that the GPU and
//! its twin do the very same.

mod bad_input;
mod both;
mod courtyard;
mod footprints;
mod watched;

use proptest::prelude::*;
use shadecast_protocol::{Epoch, PatchId};
use shadecast_shaders::snake::{PIXEL, Seen, Wish};

use self::watched::{Watched, texels_of, triangle};
use super::*;
use crate::atlas::{KEEP_UNSEEN, tests::watched::Noise};

fn shape(width: u16, height: u16) -> SnakeShape {
    SnakeShape::new([width, height]).expect("a valid size")
}

fn steps(pixels: f32) -> u16 {
    ((pixels.max(0.1).log2() * 256.0).round() as i32 + PIXEL) as u16
}

/// A triangle that is seen so high over its base, so long.
fn seen(patch: u32, height: f32, length: f32) -> Seen {
    Seen {
        patch,
        pixels: ((height * length * 0.5) as u32).max(1),
        wish: Wish {
            height: steps(height),
            length: steps(length),
            tip: (patch * 37 % 256) as u8,
            turn: (patch % 6) as u8,
            depths: [0, (patch % 3) as u8, (patch % 7) as u8],
        },
    }
}

/// Triangles as they come up in a view: logarithms of heights, and of stretches.
fn view(noise: &mut Noise, count: u32, heights: [f32; 2]) -> Vec<Seen> {
    (0..count)
        .map(|patch| {
            let height = noise.between(heights[0], heights[1]).exp2();
            seen(patch, height, height * noise.between(0.2, 2.5).exp2())
        })
        .collect()
}

/// The same seen nearer: lengths so many octaves longer.
fn nearer(view: &[Seen], octaves: f32) -> Vec<Seen> {
    let mut nearer = view.to_vec();
    for Seen { wish, .. } in &mut nearer {
        let longer = |log: u16| (f32::from(log) + 256.0 * octaves).max(0.0) as u16;
        (wish.height, wish.length) = (longer(wish.height), longer(wish.length));
    }
    nearer
}

#[test]
fn sizes_that_cannot_be_are_refused() {
    assert!(SnakeShape::new([4, 4]).is_ok());
    assert!(SnakeShape::new([8190, 512]).is_ok());
    for size in [[0, 64], [64, 0], [2, 64], [65, 64], [64, 33], [8192, 64]] {
        let refused = SnakeShape::new(size).err();
        assert_eq!(refused, Some(SnakeError::Size(size)));
    }
}

#[test]
fn what_stands_still_is_not_touched() {
    let mut atlas = Watched::new(shape(512, 512));
    let view = view(&mut Noise(1), 2000, [0.0, 4.0]);
    let first = atlas.place(&view);
    assert_eq!((first.placements.len(), first.unplaced), (2000, 0));
    for _ in 0..20 {
        let again = atlas.place(&view);
        assert!(again.placements.is_empty() && again.removals.is_empty());
        assert_eq!(again.bias, first.bias);
    }
}

#[test]
fn a_swaying_eye_moves_no_slots() {
    let mut atlas = Watched::new(shape(512, 512));
    let view = view(&mut Noise(2), 400, [1.0, 4.0]);
    let mut moved = 0;
    for turn in 0..40 {
        // 3 % nearer and farther.
        let sway = if turn % 2 == 0 { 0.04 } else { -0.04 };
        let placed = atlas.place(&nearer(&view, sway));
        if turn > 2 {
            moved += placed.placements.len();
        }
    }
    assert_eq!(moved, 0);
}

/// A walk up to a wall of triangles: each moves a few times at most.
#[test]
fn who_comes_nearer_gets_larger_slots() {
    let mut atlas = Watched::new(shape(1024, 1024));
    let view = view(&mut Noise(6), 400, [1.0, 3.0]);
    let (mut moves, mut first) = (0, 0);
    let mut last = 0;
    for turn in 0..80 {
        let placed = atlas.place(&nearer(&view, turn as f32 * 0.025));
        assert_eq!(placed.unplaced, 0);
        moves += placed.moved.len();
        last = placed.stats.used_texels;
        if turn == 0 {
            first = last;
        }
    }
    assert!(last > first * 6, "{last} after {first} texels");
    assert!(moves < 400 * 8, "{moves} moves over two octaves");
}

/// While little changes nobody changes bins, and then all do that have to.
#[test]
fn small_changes_leave_bins_alone_for_a_while() {
    let mut atlas = Watched::new(shape(512, 512));
    let view = view(&mut Noise(7), 300, [1.0, 3.0]);
    atlas.place(&view);
    let grown = nearer(&view, 0.5);
    let frozen = (0..)
        .take_while(|_| atlas.place(&grown).moved.is_empty())
        .count();
    assert_eq!(frozen, shadecast_shaders::snake::FREEZE_FRAMES as usize);
}

#[test]
fn a_glance_away_keeps_the_slot_and_a_longer_one_frees_it() {
    let mut atlas = Watched::new(shape(512, 512));
    let view = [seen(7, 8.0, 12.0)];
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
    assert_eq!((gone.stats.used_texels, gone.stats.superblocks), (0, 0));
}

#[test]
fn ten_times_too_much_raises_the_bias_and_loses_nothing() {
    let mut atlas = Watched::new(shape(512, 512));
    // 40 by 80 pixels: 1600 texels each.
    let view: Vec<_> = (0..1640).map(|i| seen(i, 40.0, 80.0)).collect();
    let placed = atlas.place(&view);
    assert_eq!(placed.unplaced, 0);
    assert!((3.0..6.0).contains(&placed.bias), "{}", placed.bias);
    assert!(placed.stats.used_fraction() > 0.3, "{:?}", placed.stats);
    let areas: Vec<i64> = placed
        .placements
        .iter()
        .map(|placement| texels_of(placement.slot).len() as i64)
        .collect();
    let (least, most) = (areas.iter().min(), areas.iter().max());
    assert!(
        *most.expect("some") < least.expect("some") * 2,
        "all shrink alike"
    );
}

#[test]
fn where_even_the_smallest_slots_are_too_many_the_least_important_wait() {
    let mut atlas = Watched::new(shape(32, 32));
    let view: Vec<_> = (0..2000_u32)
        .map(|i| seen(i, 4.0 + (i % 1000) as f32 * 0.02, 30.0))
        .collect();
    let placed = atlas.place(&view);
    // A quarter of the texels.
    assert_eq!(
        (placed.placements.len(), placed.unplaced),
        (256, 2000 - 256)
    );
    assert!(
        placed
            .placements
            .iter()
            .all(|placement| placement.patch.0 % 1000 >= 800)
    );
    let again = atlas.place(&view);
    assert!(again.placements.is_empty() && !again.reset);
    assert_eq!(again.unplaced, placed.unplaced);
}

#[test]
fn a_forced_reset_places_anew_in_a_new_epoch() {
    let mut atlas = Watched::new(shape(512, 512));
    let view = view(&mut Noise(4), 100, [0.0, 4.0]);
    atlas.place(&view);
    atlas.force_reset();
    let placed = atlas.place(&view);
    assert!(placed.reset && !placed.out_of_memory);
    assert_eq!((placed.epoch, placed.placements.len()), (Epoch(1), 100));
    assert!(!atlas.place(&view).reset);
}

/// Bins come first, and within each the order of the triangles.
#[test]
fn a_bin_is_in_the_order_of_its_triangles() {
    let mut atlas = Watched::new(shape(256, 256));
    let alike: Vec<_> = (0..200)
        .map(|i| Seen {
            patch: i,
            ..seen(0, 6.0, 9.0)
        })
        .collect();
    let placed = atlas.place(&alike);
    let places: Vec<_> = placed
        .placements
        .iter()
        .map(|placement| {
            let slot = triangle(placement.slot);
            let rows = slot.corners.map(|corner| corner[1]);
            let columns = slot.corners.map(|corner| corner[0]);
            (rows.iter().min().copied(), columns.iter().sum::<u16>())
        })
        .collect();
    assert!(places.is_sorted(), "{places:?}");
}

/// 10,000 frames of a view that wanders through a scene of 6,000 triangles.
#[test]
fn churn_leaks_nothing_and_resets_seldom() {
    let mut atlas = SnakeTwin::new(shape(512, 512));
    let mut noise = Noise(3);
    let scene = view(&mut noise, 6000, [0.0, 3.5]);
    let (mut begin, mut used, mut resets, mut unplaced, mut moves) = (0, 0.0, 0, 0, 0);
    for turn in 0..10_000_u32 {
        begin += noise.below(3);
        let zoom = (turn as f32 * 0.013).sin() * 0.5;
        let mut view: Vec<_> = (begin..begin + 1500)
            .map(|i| scene[i as usize % 6000])
            .collect();
        view.sort_unstable_by_key(|seen| seen.patch);
        let placed = atlas.place(&nearer(&view, zoom));
        unplaced += placed.unplaced;
        used += placed.stats.used_fraction();
        resets = placed.stats.resets;
        moves += placed.moved.len();
    }
    let used = used / 10_000.0;
    println!(
        "{resets} resets, {used:.2} used, {} moves a frame",
        moves / 10_000
    );
    assert_eq!(unplaced, 0);
    assert!(resets < 200, "{resets} resets");
    assert!(used > 0.3, "{used} used");
    let last = (0..=KEEP_UNSEEN).map(|_| atlas.place(&[])).last();
    let stats = last.expect("a frame").stats;
    assert_eq!(
        (stats.used_texels, stats.patches, stats.superblocks),
        (0, 0, 0)
    );
}

fn any_seen() -> impl Strategy<Value = Seen> {
    let log = prop_oneof![20 => 400_u16..2500, 1 => any::<u16>()];
    let rest = (any::<u8>(), 0..6_u8, [0..32_u8, 0..32_u8, 0..32_u8]);
    (0_u32..400, log.clone(), log, rest, 1..5000_u32).prop_map(
        |(patch, height, length, rest, pixels)| {
            let (tip, turn, depths) = rest;
            Seen {
                patch,
                pixels,
                wish: Wish {
                    height,
                    length,
                    tip,
                    turn,
                    depths,
                },
            }
        },
    )
}

/// Frames, each ascending by patch, and which of them must begin an epoch. Some
/// repeat the one before with small changes.
fn any_frames() -> impl Strategy<Value = Vec<(Vec<Seen>, bool)>> {
    let frame = prop::collection::vec(any_seen(), 0..300).prop_map(|mut frame| {
        frame.sort_by_key(|seen| seen.patch);
        frame.dedup_by_key(|seen| seen.patch);
        frame
    });
    let forced = prop::bool::weighted(0.05);
    let repeats = prop_oneof![Just(1_usize), Just(1), Just(4), Just(9)];
    let step = (frame, forced, repeats, -100..100_i32);
    prop::collection::vec(step, 1..12).prop_map(|steps| {
        let mut frames = Vec::new();
        for (frame, forced, repeats, growth) in steps {
            for repeat in 0..repeats {
                let octaves = (growth * repeat as i32) as f32 / 256.0;
                let mut frame = nearer(&frame, octaves);
                frame.truncate(frame.len() - (repeat % 4).min(frame.len()));
                frames.push((frame, forced && repeat == 0));
            }
        }
        frames
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(128) })]

    #[test]
    fn any_sequence_keeps_the_promises(
        frames in any_frames(),
        (width, height) in prop_oneof![
            Just((128, 128)), Just((64, 192)), Just((16, 16)), Just((256, 64)), Just((6, 1100)),
        ],
    ) {
        let mut watched = Watched::new(shape(width, height));
        let mut twin = SnakeTwin::new(shape(width, height));
        for (visible, forced) in frames {
            if forced {
                watched.force_reset();
                twin.force_reset();
            }
            prop_assert_eq!(watched.place(&visible), twin.place(&visible));
        }
    }
}
