//! A network that stalls: the world stays, and a notice hangs in it.

use shadecast_client::Status;
use shadecast_client::worn::Display;
use shadecast_simulated_runtime::{Image, Script};

use crate::rig::{Rig, pixel, still_head, wall};

/// Shares of pixels that show the wall.
fn wall_share(image: &Image) -> f64 {
    let all = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    let red = all.filter(|(x, y)| {
        let [red, green, blue] = pixel(image, *x, *y);
        red > 150 && green < 80 && blue < 80
    });
    red.count() as f64 / f64::from(image.width * image.height)
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn after_half_a_second_the_user_is_told_and_then_no_longer() {
    let mut rig = Rig::at_the_wall(Script {
        keep: vec![20, 90, 150],
        head: still_head(),
        ..Script::default()
    });
    rig.run_to(40);
    assert_eq!(rig.headset.notice(rig.now()), None);
    rig.headset.take_status(&Status::Reconnecting {
        reason: "gone".into(),
        after: std::time::Duration::ZERO,
    });
    rig.run_to(100);
    let notice = rig.headset.notice(rig.now()).expect("a second has passed");
    assert!(notice.contains("connection is lost"), "{notice}");
    let poses = rig.runtime.log().frames.len();
    assert_eq!(poses, 100, "it drew on meanwhile");

    // The server is back.
    rig.headset.take_status(&Status::Streaming);
    for frame in 100..155 {
        rig.sender.send(wall());
        rig.run_to(frame + 1);
    }
    assert_eq!(rig.headset.notice(rig.now()), None);
    let log = rig.runtime.log();
    assert_eq!(log.broken_rules(), []);
    let [before, during, after] = [0, 1, 2].map(|index: usize| wall_share(&log.images[index].1[0]));
    assert!(before > 0.999 && after > 0.999, "{before} {after}");
    assert!(
        (0.9..0.998).contains(&during),
        "{during}: a small panel before the wall"
    );
    // In the world, so that both eyes see it, a little apart.
    let right = wall_share(&log.images[1].1[1]);
    assert!((during - right).abs() < 0.005, "{during} {right}");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_sentence_is_shown_until_it_is_taken_back() {
    let mut rig = Rig::at_the_wall(Script {
        keep: vec![10, 20, 30],
        head: still_head(),
        ..Script::default()
    });
    rig.run_to(15);
    let sentence = "the server refuses: the secret is wrong: start the client with the line that the server prints";
    rig.headset.say(Some(sentence.to_owned()));
    rig.run_to(25);
    assert_eq!(rig.headset.notice(rig.now()), Some(sentence));
    rig.headset.say(None);
    rig.run_to(31);
    let log = rig.runtime.log();
    let shares = [0, 1, 2].map(|index: usize| wall_share(&log.images[index].1[0]));
    assert!(
        shares[0] > 0.999 && shares[1] < 0.998 && shares[2] > 0.999,
        "{shares:?}"
    );
}
