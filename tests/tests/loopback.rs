//! The whole path from the head to the display, in virtual time.

use std::time::Duration;

use shadecast_client::{
    AccessUnit, ClientTiming, DecodedPicture, Decoder, OpenH264Decoder, Ticket, World,
};
use shadecast_protocol::{FrameId, Method, Picture, ToClient, Update};
use shadecast_server::scene::courtyard;
use shadecast_tests::{ATLAS_SIZE, DELAY, JITTER, Loopback, MAKING};

const FRAMES: usize = 12;

fn run(method: Method, seed: u64, lost: Option<FrameId>) -> Loopback {
    let mut loopback = Loopback::by(method, courtyard(10_000), seed).expect("a GPU");
    if let Some(frame) = lost {
        loopback.lose_picture(frame);
    }
    loopback
        .run_until_presented(FRAMES)
        .expect("both ends understand each other");
    loopback
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn frames_take_effect_whole_and_a_seed_is_a_run() {
    let first = run(Method::Sas, 1, None);
    picture_and_update_take_effect_together(Method::Sas, &first);
    both_ends_measure_the_network(&first);

    let second = run(Method::Sas, 1, None);
    runs_are_the_same(&first, &second);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn triangles_by_themselves_take_the_same_way() {
    for method in [Method::Tss, Method::Snake] {
        let first = run(method, 1, None);
        picture_and_update_take_effect_together(method, &first);
        let shown = first.presented().last().expect("frames");
        assert!(shown.foreshortened);
        let second = run(method, 1, None);
        runs_are_the_same(&first, &second);
    }
}

/// Byte for byte.
fn runs_are_the_same(first: &Loopback, second: &Loopback) {
    assert_eq!(first.sent().len(), second.sent().len());
    for (index, (one, other)) in first.sent().iter().zip(second.sent()).enumerate() {
        assert!(
            one == other,
            "message {index} differs: {}",
            first_difference(one, other)
        );
    }
}

/// Where two messages begin to differ, for whoever looks for the cause.
fn first_difference(one: &[u8], other: &[u8]) -> String {
    let at = one.iter().zip(other).take_while(|(a, b)| a == b).count();
    let what = match ToClient::decode(one).expect("a message") {
        ToClient::Update(update) => format!("the update of {:?}", update.frame),
        ToClient::Picture(picture) => format!("the picture of {:?}", picture.frame),
        other => format!("{other:?}"),
    };
    let lengths = [one.len(), other.len()];
    format!("{what}, from byte {at} of {lengths:?} on")
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn after_a_lost_picture_a_new_epoch_is_shown_whole() {
    let lost = FrameId(4);
    let loopback = run(Method::Sas, 2, Some(lost));
    picture_and_update_take_effect_together(Method::Sas, &loopback);
    let (before, after): (Vec<_>, Vec<_>) = loopback
        .presented()
        .iter()
        .partition(|shown| shown.frame < lost);
    let (last, first) = (before[before.len() - 1], after[0]);
    assert_eq!(last.frame, FrameId(3), "all before the loss is shown");
    assert!(first.frame > lost && first.epoch > last.epoch);
}

/// What is shown is the picture of a frame and the world after its update, and
/// never those of two frames.
fn picture_and_update_take_effect_together(method: Method, loopback: &Loopback) {
    let (updates, pictures) = frames_sent(loopback);
    let mut decoder = OpenH264Decoder::new();
    let mut world = World::new(ATLAS_SIZE, method);
    let mut shown = loopback.presented().iter().peekable();
    for (update, picture) in updates.iter().zip(&pictures) {
        let frame = update.frame;
        assert_eq!(picture.frame, frame, "updates and pictures alternate");
        world.apply(update).expect("the update fits");
        let picture = decode(&mut decoder, picture);
        let expected = world.frame(update, picture, ClientTiming::default());
        let Some(shown) = shown.next_if(|shown| shown.frame == frame) else {
            continue;
        };
        assert_eq!(shown.epoch, expected.epoch);
        assert_eq!(shown.world_from_head, expected.world_from_head);
        assert!(shown.picture == expected.picture, "picture of {frame:?}");
        assert_eq!(shown.vertices, expected.vertices, "{frame:?}");
        assert_eq!(shown.indices, expected.indices, "{frame:?}");
        assert_eq!(shown.motions, expected.motions, "{frame:?}");
        assert!(shown.patches > 100, "{} patches", shown.patches);
        let luma = &shown.picture.planes().expect("decoded in software").y;
        let bright = luma.iter().filter(|luma| **luma > 60).count();
        assert!(bright > luma.len() / 10, "{bright} lit texels");
    }
    assert!(shown.next().is_none(), "frames are shown in order");
    assert_eq!(loopback.presented().len(), FRAMES);
}

fn frames_sent(loopback: &Loopback) -> (Vec<Update>, Vec<Picture>) {
    let (mut updates, mut pictures) = (Vec::new(), Vec::new());
    for bytes in loopback.sent() {
        match ToClient::decode(bytes).expect("a message") {
            ToClient::Update(update) => updates.push(update),
            ToClient::Picture(picture) => pictures.push(picture),
            _ => {}
        }
    }
    (updates, pictures)
}

fn decode(decoder: &mut OpenH264Decoder, picture: &Picture) -> DecodedPicture {
    let unit = AccessUnit {
        ticket: Ticket {
            connection: 0,
            frame: picture.frame,
        },
        restart: false,
        size: ATLAS_SIZE,
        bytes: picture.bytes.clone(),
    };
    decoder.send(unit);
    let decoded = decoder.poll().expect("an answer to every access unit");
    decoded.picture.expect("a picture")
}

fn both_ends_measure_the_network(loopback: &Loopback) {
    // A sample is off by half the difference between the ways there and back.
    let error = loopback.clock_error().expect("clock samples were taken");
    assert!(error <= JITTER / 2, "{error:?}");
    // A report's way, its wait for the next frame, the making and the way back.
    let latency = loopback.latency().expect("frames were acknowledged");
    let shortest = 2 * DELAY + MAKING;
    let possible = shortest..shortest + 2 * JITTER + Duration::from_millis(100);
    assert!(possible.contains(&latency), "{latency:?}");
}
