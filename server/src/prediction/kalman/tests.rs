//! Heads that move as the model has it, and reports that do not come as they should.

use glam::Quat;
use proptest::prelude::*;
use shadecast_protocol::{EyeView, Fov, ViewSeq};

use super::*;

const TICK: u64 = 11_111_111;

fn report(at: u64, pose: Pose, velocity: Vec3, angular_velocity: Vec3) -> ViewReport {
    ViewReport {
        seq: ViewSeq(0),
        sampled_at: ClientTime(at),
        display_at: ClientTime(at),
        world_from_head: pose,
        linear_velocity: velocity,
        angular_velocity,
        eyes: [EyeView {
            head_from_eye: Pose::IDENTITY,
            fov: Fov::symmetric(1.5),
        }; 2],
        eye_resolution: [64; 2],
        hands: [None; 2],
    }
}

/// A head that walks ahead at a metre a second and turns left at one radian a second.
fn steady(tick: u64) -> Pose {
    let seconds = (tick * TICK) as f32 * 1e-9;
    Pose {
        position: Vec3::NEG_Z * seconds,
        orientation: Quat::from_rotation_y(seconds),
    }
}

fn steady_report(tick: u64) -> ViewReport {
    report(tick * TICK, steady(tick), Vec3::NEG_Z, Vec3::Y)
}

/// Metres and radians between two heads.
fn apart(a: Pose, b: Pose) -> (f32, f32) {
    (
        a.position.distance(b.position),
        a.orientation.angle_between(b.orientation),
    )
}

fn assert_follows(filter: &HeadFilter, tick: u64) {
    let lead = 9;
    let (found, doubt) = filter.after(Duration::from_nanos(lead * TICK));
    let (metres, radians) = apart(found, steady(tick + lead));
    assert!(
        metres < 5e-3 && radians < 1e-2,
        "{metres} m, {radians} rad off"
    );
    assert!(
        doubt.metres > 0.0 && doubt.metres < 0.2 && doubt.radians < 0.5,
        "{doubt:?}"
    );
}

#[test]
fn a_steady_head_is_followed_whether_or_not_rates_are_known() {
    for rates in [true, false] {
        let told = |tick| match rates {
            true => steady_report(tick),
            false => report(tick * TICK, steady(tick), Vec3::ZERO, Vec3::ZERO),
        };
        let mut filter = HeadFilter::new(&told(0));
        for tick in 1..90 {
            filter.tell(&told(tick));
        }
        assert_follows(&filter, 89);
    }
}

#[test]
fn a_turn_that_ends_is_not_predicted_to_go_on_growing() {
    // A gaze of 40 degrees in 0.5 s, minimum jerk, and the head 100 ms on.
    let gaze = |seconds: f64| {
        let s = (seconds / 0.5).clamp(0.0, 1.0);
        40_f64.to_radians() * s.powi(3) * (10.0 + s * (6.0 * s - 15.0))
    };
    let lead = 0.1;
    let (mut filtered, mut linear) = (0.0_f64, 0.0_f64);
    let mut filter: Option<HeadFilter> = None;
    for tick in 0..100_u64 {
        let seconds = (tick * TICK) as f64 * 1e-9 - 0.2;
        let rate = (gaze(seconds + 1e-4) - gaze(seconds - 1e-4)) / 2e-4;
        let pose = Pose {
            position: Vec3::ZERO,
            orientation: Quat::from_rotation_y(gaze(seconds) as f32),
        };
        let told = report(tick * TICK, pose, Vec3::ZERO, Vec3::Y * rate as f32);
        let filter = filter.get_or_insert_with(|| HeadFilter::new(&told));
        filter.tell(&told);
        let truth = Quat::from_rotation_y(gaze(seconds + lead) as f32);
        let (found, _) = filter.after(Duration::from_secs_f64(lead));
        filtered += f64::from(found.orientation.angle_between(truth)).powi(2);
        linear += (gaze(seconds) + rate * lead - gaze(seconds + lead)).powi(2);
    }
    assert!(filtered < 0.7 * linear, "squares {filtered} and {linear}");
}

#[test]
fn late_missing_and_repeated_reports_do_no_harm() {
    let mut filter = HeadFilter::new(&steady_report(0));
    for tick in 1..90 {
        if tick % 7 == 3 {
            continue;
        }
        filter.tell(&steady_report(tick));
        let before = format!("{filter:?}");
        filter.tell(&steady_report(tick));
        filter.tell(&steady_report(tick.saturating_sub(4)));
        assert_eq!(format!("{filter:?}"), before, "nothing new was said");
    }
    assert_follows(&filter, 89);
}

#[test]
fn a_gap_adds_to_the_doubt() {
    let mut filter = HeadFilter::new(&steady_report(0));
    for tick in 1..90 {
        filter.tell(&steady_report(tick));
    }
    let doubts = [0, 50, 100, 200, 400].map(|ms| filter.after(Duration::from_millis(ms)).1);
    for pair in doubts.windows(2) {
        assert!(pair[0].metres < pair[1].metres && pair[0].radians < pair[1].radians);
    }
    filter.tell(&steady_report(120));
    assert_follows(&filter, 120);
}

#[test]
fn what_is_no_pose_is_passed_over() {
    let mut filter = HeadFilter::new(&steady_report(0));
    for tick in 1..60 {
        filter.tell(&steady_report(tick));
        let mut broken = steady_report(tick);
        broken.display_at.0 += TICK / 2;
        for part in 0..4 {
            let mut broken = broken;
            match part {
                0 => broken.world_from_head.position.y = f32::NAN,
                1 => broken.world_from_head.orientation = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0),
                2 => broken.world_from_head.orientation.x = f32::INFINITY,
                _ => broken.world_from_head.position.x = f32::NEG_INFINITY,
            }
            filter.tell(&broken);
        }
    }
    assert_follows(&filter, 59);
    // Rates that are none leave a pose a pose.
    for (tick, rate) in (60..).zip([f32::NAN, f32::INFINITY, 1e9]) {
        let told = report(
            tick * TICK,
            steady(tick),
            Vec3::splat(rate),
            Vec3::splat(rate),
        );
        filter.tell(&told);
        assert_follows(&filter, tick);
    }
    let nowhere = report(
        0,
        Pose {
            position: Vec3::NAN,
            ..Pose::IDENTITY
        },
        Vec3::NAN,
        Vec3::NAN,
    );
    let (pose, doubt) = HeadFilter::new(&nowhere).after(Duration::from_secs(9));
    assert!(pose.is_valid() && doubt.metres.is_finite() && doubt.radians.is_finite());
}

#[test]
fn one_wrong_rate_does_not_turn_the_head() {
    let mut filter = HeadFilter::new(&steady_report(0));
    for tick in 1..90 {
        let mut told = steady_report(tick);
        if tick % 30 == 29 {
            told.angular_velocity = Vec3::X * 12.0;
            told.linear_velocity = Vec3::X * 9.0;
        }
        filter.tell(&told);
    }
    assert_follows(&filter, 89);
}

#[test]
fn where_time_or_the_head_jumps_the_filter_begins_anew() {
    let mut filter = HeadFilter::new(&steady_report(10_000));
    for tick in 10_001..10_090 {
        filter.tell(&steady_report(tick));
    }
    // The client's clock begins anew, and goes on.
    for tick in [0, 1, 2, 3, 1_000_000, 1_000_001] {
        filter.tell(&steady_report(tick));
        assert_follows(&filter, tick);
    }
    // The head is put elsewhere, turned round.
    let elsewhere = Pose {
        position: Vec3::X * 5.0,
        orientation: Quat::from_rotation_y(3.0),
    };
    filter.tell(&report(1_000_002 * TICK, elsewhere, Vec3::ZERO, Vec3::ZERO));
    let (found, _) = filter.after(Duration::from_millis(100));
    let (metres, radians) = apart(found, elsewhere);
    assert!(
        metres < 1e-3 && radians < 1e-3,
        "nothing is left of the motion before"
    );
}

#[test]
fn both_quaternions_of_an_orientation_are_one() {
    let mut filter = HeadFilter::new(&steady_report(0));
    for tick in 1..90 {
        let mut told = steady_report(tick);
        if tick % 2 == 0 {
            told.world_from_head.orientation = -told.world_from_head.orientation;
        }
        filter.tell(&told);
    }
    assert_follows(&filter, 89);
}

proptest! {
    #[test]
    fn whatever_is_reported_the_head_is_somewhere(
        reports in prop::collection::vec(
            (any::<u64>(), any::<bool>(), prop::array::uniform7(prop::num::f32::ANY),
                prop::array::uniform6(prop::num::f32::ANY)),
            1..40,
        ),
        lead in any::<u32>(),
    ) {
        let mut filter: Option<HeadFilter> = None;
        let mut clock = 0_u64;
        for (time, jumps, pose, rates) in reports {
            clock = if jumps { time } else { clock.wrapping_add(time % (3 * TICK)) };
            let q = Quat::from_xyzw(pose[3], pose[4], pose[5], pose[6]);
            let world_from_head = Pose {
                position: Vec3::new(pose[0], pose[1], pose[2]),
                // Half of them are turned to be orientations.
                orientation: if time % 2 == 0 && q.length_recip().is_normal() { q.normalize() } else { q },
            };
            let told = report(
                clock,
                world_from_head,
                Vec3::new(rates[0], rates[1], rates[2]),
                Vec3::new(rates[3], rates[4], rates[5]),
            );
            filter.get_or_insert_with(|| HeadFilter::new(&told)).tell(&told);
        }
        let (pose, doubt) = filter.expect("one").after(Duration::from_nanos(lead.into()));
        prop_assert!(pose.orientation.is_finite() && pose.orientation.is_normalized());
        prop_assert!(!pose.position.is_nan());
        prop_assert!(doubt.metres >= 0.0 && doubt.radians >= 0.0);
        prop_assert!(doubt.metres.is_finite() && doubt.radians.is_finite());
    }
}
