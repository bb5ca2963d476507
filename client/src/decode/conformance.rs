//! What every decoder must do, whatever it is made of: asked of OpenH264, and of
//! a double that behaves as MediaCodec does.
//!
//! The pictures are real ones, of which each has another brightness, so that a
//! picture that comes back for another unit than its own is noticed.

mod scripted;

use std::collections::VecDeque;
use std::sync::mpsc::channel;
use std::time::Duration;

use openh264::encoder::Encoder;
use openh264::formats::YUVBuffer;
use proptest::prelude::*;
use shadecast_protocol::FrameId;

use super::platform::MOST_WAITING;
use super::{
    AccessUnit, DecodeError, Decoded, Decoder, DecoderThread, OpenH264Decoder, PlatformDecoder,
    Ticket,
};
use scripted::{Script, ScriptedCodec};

const SIZE: [u16; 2] = [64, 48];
const OTHER_SIZE: [u16; 2] = [96, 64];

/// Polls after which a decoder that has room for more has given what it will.
const PATIENCE: usize = 64;

/// One access unit a step, the first of them an IDR picture; the picture of step
/// `n` is grey of luma `40 + 16 n`.
fn stream(size: [u16; 2], steps: u8) -> Vec<Vec<u8>> {
    let [width, height] = size.map(usize::from);
    let mut encoder = Encoder::new().expect("the library works");
    (0..steps)
        .map(|step| {
            let mut planes = vec![luma(step); width * height];
            planes.resize(width * height * 3 / 2, 128);
            let picture = YUVBuffer::from_vec(planes, width, height);
            encoder.encode(&picture).expect("it encodes").to_vec()
        })
        .collect()
}

fn luma(step: u8) -> u8 {
    40 + 16 * step
}

fn unit(connection: u32, step: u8, size: [u16; 2], bytes: &[u8]) -> AccessUnit {
    AccessUnit {
        ticket: Ticket {
            connection,
            frame: FrameId(step.into()),
        },
        restart: step == 0,
        size,
        bytes: bytes.to_vec(),
    }
}

/// Sends a stream from its IDR picture on, as [`DecoderThread`] does, and gives
/// what comes back meanwhile and afterwards.
fn play(
    decoder: &mut impl Decoder,
    connection: u32,
    size: [u16; 2],
    units: &[Vec<u8>],
) -> Vec<Decoded> {
    decoder.flush();
    let mut results = Vec::new();
    for (step, bytes) in (0..).zip(units) {
        decoder.send(unit(connection, step, size, bytes));
        results.extend(decoder.poll());
    }
    results.extend(drain(decoder));
    results
}

/// What comes without anything more being sent.
fn drain(decoder: &mut impl Decoder) -> Vec<Decoded> {
    (0..PATIENCE).filter_map(|_| decoder.poll()).collect()
}

/// Every unit came back, in order, with its own picture.
#[track_caller]
fn assert_whole(results: &[Decoded], connection: u32, size: [u16; 2], steps: u8) {
    assert_eq!(results.len(), usize::from(steps), "{results:?}");
    for (step, result) in (0_u32..).zip(results) {
        assert_eq!(result.ticket.connection, connection);
        assert_eq!(result.ticket.frame.0, step);
        assert_own(result, size);
    }
}

/// The picture is that of the unit.
#[track_caller]
fn assert_own(result: &Decoded, size: [u16; 2]) {
    let picture = result.picture.as_ref().expect("a picture");
    let planes = picture.planes().expect("in memory");
    assert_eq!(picture.size(), size.map(u32::from));
    let expected = luma(result.ticket.frame.0 as u8);
    let (middle, chroma) = (planes.y[planes.y.len() / 2], planes.u[0]);
    assert!(middle.abs_diff(expected) < 6, "{middle} is not {expected}");
    assert!(chroma.abs_diff(128) < 3, "{chroma}");
}

/// In the order of sending, and none of them twice.
#[track_caller]
fn assert_ordered(results: &[Decoded], connection: u32) {
    assert!(
        results.is_sorted_by(|a, b| a.ticket.frame < b.ticket.frame),
        "{results:?}"
    );
    for result in results {
        assert_eq!(result.ticket.connection, connection);
    }
}

/// All that is asked of a decoder.
fn conforms<D: Decoder + Send + 'static>(open: impl Fn() -> D) {
    let units = stream(SIZE, 8);

    // Order and pairing.
    let mut decoder = open();
    let results = play(&mut decoder, 0, SIZE, &units);
    assert_whole(&results, 0, SIZE, 8);
    assert_eq!(decoder.poll(), None);

    // Without an IDR picture there is none, and an IDR picture cures.
    let mut decoder = open();
    for step in 1..4 {
        decoder.send(unit(0, step, SIZE, &units[usize::from(step)]));
    }
    let results = drain(&mut decoder);
    assert!(results.iter().all(|one| one.picture.is_err()));
    assert_whole(&play(&mut decoder, 1, SIZE, &units), 1, SIZE, 8);

    // So it does after a loss in the middle.
    let mut decoder = open();
    decoder.flush();
    for step in [0, 1, 4, 5] {
        decoder.send(unit(0, step, SIZE, &units[usize::from(step)]));
    }
    assert_ordered(&drain(&mut decoder), 0);
    assert_whole(&play(&mut decoder, 1, SIZE, &units), 1, SIZE, 8);

    // The size changes with an IDR picture, and back.
    let others = stream(OTHER_SIZE, 4);
    assert_whole(
        &play(&mut decoder, 2, OTHER_SIZE, &others),
        2,
        OTHER_SIZE,
        4,
    );
    assert_whole(&play(&mut decoder, 3, SIZE, &units), 3, SIZE, 8);

    // Another size than announced is an error of its unit.
    let results = play(&mut decoder, 4, SIZE, &others);
    assert_ordered(&results, 4);
    let (expected, found) = (SIZE.map(u32::from), OTHER_SIZE.map(u32::from));
    let size = Err(DecodeError::Size { expected, found });
    assert_eq!(results.first().map(|one| &one.picture), Some(&size));
    assert_whole(&play(&mut decoder, 5, SIZE, &units), 5, SIZE, 8);

    // Garbage is survived.
    let garbage = vec![
        vec![],
        vec![0; 40],
        vec![0, 0, 0, 1, 0x65, 0xff],
        vec![7; 300],
    ];
    let results = play(&mut decoder, 6, SIZE, &garbage);
    assert_ordered(&results, 6);
    assert!(results.iter().all(|one| one.picture.is_err()));
    assert_whole(&play(&mut decoder, 7, SIZE, &units), 7, SIZE, 8);

    // After a flush nothing comes of what was inside.
    for (step, bytes) in (0..).zip(&units) {
        decoder.send(unit(8, step, SIZE, bytes));
    }
    assert_whole(&play(&mut decoder, 9, SIZE, &units), 9, SIZE, 8);

    // It ends with units inside, and nothing is heard of it afterwards.
    drop(decoder);
    let (results, received) = channel();
    let thread = DecoderThread::spawn(open(), move |decoded| {
        // The test may have failed and gone.
        let _ = results.send(decoded.ticket.frame);
    })
    .expect("a thread");
    for (step, bytes) in (0..).zip(&units) {
        thread
            .send(unit(0, step, SIZE, bytes))
            .expect("it has room");
    }
    let first = received.recv_timeout(Duration::from_secs(20));
    assert_eq!(first, Ok(FrameId(0)));
    drop(thread);
    assert!(received.iter().is_sorted(), "and the channel has ended");
}

#[test]
fn openh264_conforms() {
    conforms(OpenH264Decoder::new);
}

fn platform(
    script: Script,
) -> PlatformDecoder<ScriptedCodec, impl FnMut([u16; 2]) -> Result<ScriptedCodec, DecodeError>> {
    PlatformDecoder::new(move |_| Ok(ScriptedCodec::open(script.clone())))
}

#[test]
fn a_prompt_codec_of_the_platform_conforms() {
    conforms(|| platform(Script::default()));
}

#[test]
fn a_slow_codec_of_the_platform_conforms() {
    conforms(|| {
        platform(Script {
            room: 2,
            delays: VecDeque::from([7, 1, 3, 3, 2]),
            ..Script::default()
        })
    });
}

#[test]
fn a_codec_that_holds_pictures_back_and_mixes_them_up_conforms() {
    conforms(|| {
        platform(Script {
            room: 8,
            delays: VecDeque::from([2, 4, 3]),
            swaps: VecDeque::from([true, false, false]),
            swallows_garbage: true,
            ..Script::default()
        })
    });
}

#[test]
fn a_unit_that_the_codec_drops_comes_back_as_an_error_in_its_place() {
    let units = stream(SIZE, 8);
    let mut decoder = platform(Script {
        drops: vec![3, 4],
        ..Script::default()
    });
    let results = play(&mut decoder, 0, SIZE, &units);
    assert_eq!(results.len(), 8);
    assert_ordered(&results, 0);
    for (step, result) in results.iter().enumerate() {
        if step == 3 || step == 4 {
            assert_eq!(result.picture, Err(DecodeError::NoPicture));
        } else {
            assert_own(result, SIZE);
        }
    }
}

#[test]
fn a_codec_that_breaks_fails_its_units_and_the_next_idr_opens_another() {
    let units = stream(SIZE, 8);
    let mut opened = 0;
    let mut decoder = PlatformDecoder::new(|_| {
        opened += 1;
        Ok(ScriptedCodec::open(Script {
            breaks_at: (opened == 1).then_some(3),
            ..Script::default()
        }))
    });
    let results = play(&mut decoder, 0, SIZE, &units);
    assert_eq!(results.len(), 8);
    assert!(results[3..].iter().all(|one| one.picture.is_err()));
    assert_whole(&play(&mut decoder, 1, SIZE, &units), 1, SIZE, 8);
    drop(decoder);
    assert_eq!(opened, 2);
}

#[test]
fn a_codec_that_says_nothing_is_replaced_at_the_next_idr() {
    let units = stream(SIZE, 4);
    let mut opened = 0;
    let mut decoder = PlatformDecoder::new(|_| {
        opened += 1;
        Ok(ScriptedCodec::open(Script {
            drops: if opened == 1 {
                (0..4).collect()
            } else {
                vec![]
            },
            ..Script::default()
        }))
    });
    assert_eq!(play(&mut decoder, 0, SIZE, &units), []);
    assert_whole(&play(&mut decoder, 1, SIZE, &units), 1, SIZE, 4);
    assert_whole(&play(&mut decoder, 2, SIZE, &units), 2, SIZE, 4);
    drop(decoder);
    assert_eq!(opened, 2, "one that answers is only flushed");
}

#[test]
fn without_a_codec_the_units_say_so() {
    let mut decoder = PlatformDecoder::new(|_| -> Result<ScriptedCodec, _> {
        Err(DecodeError::Unavailable("there is none for H.264".into()))
    });
    let results = play(&mut decoder, 0, SIZE, &stream(SIZE, 2));
    let message = results[0].picture.as_ref().unwrap_err().to_string();
    assert_eq!(message, "no video decoder: there is none for H.264");
}

#[test]
fn a_codec_with_no_room_left_is_not_sent_without_bounds() {
    let units = stream(SIZE, 1);
    let mut decoder = platform(Script {
        room: 1,
        delays: VecDeque::from([u32::MAX]),
        ..Script::default()
    });
    for _ in 0..100 {
        decoder.send(unit(0, 0, SIZE, &units[0]));
    }
    assert_eq!(decoder.waiting.len(), MOST_WAITING);
    assert_eq!(decoder.poll(), None, "the first ones may still come");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever the codec does to order and time, what comes back is in order,
    /// at most once, and the picture of its unit; what is missing at most is what
    /// nothing came after.
    #[test]
    fn pictures_meet_their_units(
        room in 1_usize..9,
        delays in prop::collection::vec(0_u32..6, 1..8),
        swaps in prop::collection::vec(any::<bool>(), 1..8),
        drops in prop::collection::vec(0_u64..12, 0..4),
        polls in prop::collection::vec(0_usize..4, 12),
    ) {
        let units = stream(SIZE, 12);
        let mut decoder = platform(Script {
            room,
            delays: delays.into(),
            swaps: swaps.into(),
            drops: drops.clone(),
            ..Script::default()
        });
        let mut results = Vec::new();
        for ((step, bytes), polls) in (0..).zip(&units).zip(polls) {
            decoder.send(unit(0, step, SIZE, bytes));
            results.extend((0..polls).filter_map(|_| decoder.poll()));
        }
        results.extend(drain(&mut decoder));
        assert_ordered(&results, 0);
        for result in &results {
            if drops.contains(&u64::from(result.ticket.frame.0)) {
                prop_assert_eq!(&result.picture, &Err(DecodeError::NoPicture));
            } else {
                assert_own(result, SIZE);
            }
        }
        let given = 12 - drops.iter().min().map_or(0, |first| 12 - *first as usize);
        prop_assert!(results.len() >= given);
        assert_whole(&play(&mut decoder, 1, SIZE, &units[..3]), 1, SIZE, 3);
    }
}
