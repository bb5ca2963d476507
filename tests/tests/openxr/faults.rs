//! What goes wrong in a headset, and the state in which each thing ends.

use shadecast_client::Input;
use shadecast_client::openxr::{HeadsetConfig, api::SessionState as S};
use shadecast_client::worn::{Display, Turn};
use shadecast_simulated_runtime::sys::{Posef, Quaternionf, Result as R, Vector3f};
use shadecast_simulated_runtime::{Fault, Log, Script};

use crate::rig::{Rig, pixel, pose_of, small_eyes, wall, welcome};

/// Frames from the first on in which nothing is to be drawn yet.
const STARTING: u64 = 2;

fn with(faults: &[(u64, Fault)]) -> Rig {
    Rig::at_the_wall(Script {
        faults: faults.to_vec(),
        ..Script::default()
    })
}

/// Frames without a layer.
fn empty(log: &Log) -> Vec<u64> {
    let empty = log.frames.iter().filter(|frame| frame.layers.is_empty());
    empty.map(|frame| frame.frame).collect()
}

fn state(rig: &Rig) -> S {
    rig.headset.life().expect("a session").state()
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn what_is_not_seen_is_not_drawn_but_paced() {
    let mut rig = with(&[
        (10, Fault::Hide(5)),
        (20, Fault::Blind(4)),
        (30, Fault::Untracked(5)),
    ]);
    rig.run_to(40);
    let log = rig.runtime.log();
    assert_eq!(log.broken_rules(), []);
    let hidden = 10..15;
    // The script takes one frame off before it is asked.
    let blind = 20..23;
    let expected: Vec<u64> = (0..STARTING).chain(hidden).chain(blind).collect();
    assert_eq!(empty(&log), expected);
    assert_eq!(log.frames.len(), 40, "every frame was ended");
    assert_eq!(state(&rig), S::FOCUSED);
    // What is believed and not tracked is drawn as well as anything.
    assert!(log.frames[32].layers.len() == 1);
    // Views are reported where they are known.
    assert_eq!(rig.views().len() as u64, 40 - expected.len() as u64);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_view_that_is_late_is_reported_for_now() {
    let mut rig = with(&[]);
    rig.run_to(10);
    rig.told.clear();
    // Every reading of the clock takes longer than a display interval.
    let clock = std::cell::Cell::new(rig.runtime.now() as u64);
    let slow = || {
        clock.set(clock.get() + 30_000_000);
        shadecast_protocol::ClientTime(clock.get())
    };
    let mut views = Vec::new();
    let turn = rig.headset.turn(&slow, &mut |input| views.push(input));
    assert!(turn.is_ok());
    let [Input::View(view)] = views[..] else {
        panic!("{views:?}");
    };
    assert!(
        view.sampled_at <= view.display_at,
        "the server would refuse it"
    );
    assert_eq!(view.sampled_at.0, clock.get(), "sampled after drawing");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn skipped_intervals_and_another_rate_move_the_times_of_frames() {
    let mut rig = with(&[(10, Fault::Skip(3)), (20, Fault::Rate(120.0))]);
    rig.run_to(30);
    let log = rig.runtime.log();
    assert_eq!(log.broken_rules(), []);
    let times: Vec<i64> = log.frames.iter().map(|frame| frame.display_time).collect();
    let step = |frame: usize| (times[frame] - times[frame - 1]) as f64 * 1e-6;
    assert!((step(9) - 1e3 / 90.0).abs() < 0.01);
    assert!((step(10) - 4e3 / 90.0).abs() < 0.01, "three are left out");
    assert!((step(25) - 1e3 / 120.0).abs() < 0.01);
    assert_eq!(log.frames[25].layers.len(), 1);
    assert_eq!(state(&rig), S::FOCUSED);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_rate_that_is_asked_for_is_the_nearest_that_is_offered() {
    let config = HeadsetConfig {
        display_rate: Some(80.0),
        ..HeadsetConfig::default()
    };
    let mut script = Script::default();
    script.headset.eyes = small_eyes();
    let mut rig = Rig::with(script, config).expect("the headset opens");
    rig.run_to(5);
    assert_eq!(rig.runtime.log().rates, [72.0]);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_headset_is_taken_off_and_put_on_again() {
    let mut rig = with(&[(20, Fault::TakeOff(500))]);
    rig.run_to(21);
    let taken_off = rig.runtime.now();
    rig.run_to(30);
    let log = rig.runtime.log();
    assert_eq!(log.broken_rules(), []);
    assert!(
        rig.runtime.now() - taken_off > 450_000_000,
        "it slept meanwhile"
    );
    let life = [S::IDLE, S::READY, S::SYNCHRONIZED, S::VISIBLE, S::FOCUSED];
    let off = [S::VISIBLE, S::SYNCHRONIZED, S::STOPPING];
    assert_eq!(log.states, [&life[..], &off, &life].concat());
    assert_eq!(log.sessions, 1, "it is the same session");
    let last = log.frames.last().expect("frames");
    assert_eq!(last.layers.len(), 1, "the world is still there");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_lost_session_is_opened_anew_with_the_world_that_was_held() {
    for fault in [Fault::LoseSession(1_500), Fault::LoseInstance(1_500)] {
        let mut rig = Rig::at_the_wall(Script {
            faults: vec![(20, fault)],
            keep: vec![19, 30],
            ..Script::default()
        });
        assert_eq!(rig.run_to_end(), Turn::Lost, "{fault:?}");
        assert!(rig.headset.vulkan().is_none());
        rig.run_to(32);
        let log = rig.runtime.log();
        assert_eq!(log.sessions, 2, "{fault:?}");
        assert_eq!(log.broken_rules(), [], "{fault:?}");
        assert_eq!(state(&rig), S::FOCUSED);
        // No new world came: the wall is the one that was held.
        let [(_, before), (_, after)] = &log.images[..] else {
            panic!("two frames were kept");
        };
        let middle = |images: &[shadecast_simulated_runtime::Image; 2]| pixel(&images[0], 24, 24);
        assert_eq!(middle(before), middle(after), "{fault:?}");
        assert!(
            middle(after)[0] > 150 && middle(after)[2] < 60,
            "{:?}",
            middle(after)
        );
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn an_instance_that_vanishes_within_a_frame_is_a_loss_as_well() {
    let mut rig = with(&[(20, Fault::RefuseFrame(R::ERROR_SESSION_LOST))]);
    assert_eq!(rig.run_to_end(), Turn::Lost);
    rig.run_to(40);
    assert_eq!(rig.runtime.log().sessions, 2);
    assert_eq!(
        rig.runtime
            .log()
            .frames
            .last()
            .map(|frame| frame.layers.len()),
        Some(1)
    );
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_world_that_does_not_fit_the_device_is_not_shown_and_the_one_before_stays() {
    let mut rig = Rig::at_the_wall(Script {
        keep: vec![10, 20],
        ..Script::default()
    });
    rig.run_to(15);
    let mut broken = (*wall()).clone();
    let mut picture = broken.picture.planes().expect("in memory").clone();
    picture.y.pop();
    broken.picture = picture.into();
    rig.sender.send(broken.into());
    rig.run_to(22);
    let notice = rig.headset.notice(rig.now()).expect("the user is told why");
    assert!(
        notice.contains("luma") && notice.contains("255 bytes"),
        "{notice}"
    );
    let log = rig.runtime.log();
    assert_eq!(log.broken_rules(), []);
    let middle = |index: usize| pixel(&log.images[index].1[0], 24, 24);
    assert_eq!(middle(0), middle(1));
    let drawn = |input: &&Input| matches!(input, Input::Drawn(_));
    assert_eq!(
        rig.told.iter().filter(drawn).count(),
        1,
        "only the first was shown"
    );
    rig.sender.send(wall());
    rig.run_to(25);
    assert_eq!(rig.headset.notice(rig.now()), None, "the next one is sound");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_frame_that_is_refused_is_told_and_ended() {
    let mut rig = with(&[(20, Fault::RefuseFrame(R::ERROR_LAYER_INVALID))]);
    rig.run_to(20);
    let runtime = rig.runtime.clone();
    let now = || shadecast_protocol::ClientTime(runtime.now() as u64);
    let error = rig
        .headset
        .turn(&now, &mut |_| {})
        .expect_err("it was refused");
    assert!(
        error.to_string().contains("does not take a frame"),
        "{error}"
    );
    assert!(!error.is_loss());
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn the_user_leaves_by_the_runtime_or_by_the_application() {
    let mut rig = with(&[(20, Fault::Exit)]);
    assert_eq!(rig.run_to_end(), Turn::Exit);
    let states = rig.runtime.log().states;
    assert_eq!(
        states[states.len() - 3..],
        [S::STOPPING, S::IDLE, S::EXITING]
    );

    let mut rig = with(&[]);
    rig.run_to(10);
    rig.headset.request_exit().expect("it is let go");
    assert_eq!(rig.run_to_end(), Turn::Exit);
    assert_eq!(rig.runtime.log().broken_rules(), []);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn centring_anew_moves_the_play_space_and_nothing_else() {
    let centre = Posef {
        orientation: Quaternionf {
            x: 0.0,
            y: 0.6,
            z: 0.0,
            w: 0.8,
        },
        position: Vector3f {
            x: 0.3,
            y: 0.0,
            z: -0.2,
        },
    };
    let mut rig = with(&[(20, Fault::Recentre(centre))]);
    rig.run_to(30);
    let log = rig.runtime.log();
    assert_eq!(log.broken_rules(), []);
    let left = |frame: usize| pose_of(log.frames[frame].layers[0].views[0].pose);
    let old_from_new = pose_of(centre);
    let moved = old_from_new.then(left(25)).position - left(18).position;
    assert!(
        moved.length() < 0.05,
        "{moved}: the head did not jump in the room"
    );
    assert!((left(25).position - left(18).position).length() > 0.2);
    assert_eq!(rig.headset.world_from_play(), welcome().world_from_play);
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn space_warp_is_found_and_not_enabled() {
    let mut script = Script::default();
    script.headset.extensions.push("FB_space_warp");
    let mut rig = Rig::at_the_wall(script);
    rig.run_to(10);
    assert!(rig.headset.offers().expect("a session").space_warp);
    let told = rig.headset.description().expect("a session");
    assert!(told.contains("not needed: space warp"), "{told}");
    let log = rig.runtime.log();
    assert_eq!(log.broken_rules(), []);
    assert!(!log.extensions.iter().any(|name| name == "FB_space_warp"));
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn what_is_not_offered_is_left_out() {
    let mut script = Script::default();
    script.headset.extensions = vec!["KHR_vulkan_enable2"];
    let mut rig = Rig::at_the_wall(script);
    rig.run_to(10);
    let offers = rig.headset.offers().expect("a session");
    let left_out: Vec<_> = offers.left_out().collect();
    let expected = [
        "depth",
        "display rate",
        "clock",
        "local floor",
        "controllers of Pico",
        "space warp",
    ];
    assert_eq!(left_out, expected);
    let told = rig.headset.description().expect("a session");
    assert!(told.starts_with("2x48x48, "), "{told}");
    assert!(told.ends_with(&expected.join(", ")), "{told}");
    let log = rig.runtime.log();
    assert_eq!(log.broken_rules(), []);
    assert_eq!(log.extensions, ["KHR_vulkan_enable2"]);
    assert_eq!(log.swapchains.len(), 1, "no depth is kept");
    assert!(
        log.frames[9].layers[0]
            .views
            .iter()
            .all(|view| view.depth.is_none())
    );
}
