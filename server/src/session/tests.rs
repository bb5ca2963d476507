//! A session in virtual time: who is let in, and when frames are made.

use glam::Vec3;
use shadecast_protocol::{
    Acknowledgement, ClientTime, Epoch, EyeView, Fov, Method, Picture, Pose, ResetReason, Sky,
    Update, ViewSeq,
};

use super::*;
use crate::{
    atlas::AtlasStats,
    frame::{FrameStats, Stages},
};

const SECRET: Secret = Secret([7; 16]);
const PERIOD: u64 = 20;

fn at(ms: u64) -> ServerTime {
    ServerTime(ms * 1_000_000)
}

fn session() -> Session {
    let config = SessionConfig {
        secret: SECRET,
        welcome: Welcome {
            codec: Codec::H264,
            method: Method::Sas,
            atlas_size: [512, 1024],
            superblock: 64,
            world_from_play: Pose::IDENTITY,
            sky: Sky {
                width: 1,
                height: 1,
                rgb: vec![0; 3],
            },
        },
        frame_period: Duration::from_millis(PERIOD),
        light_budget: Duration::from_millis(10),
        head_samples: 2,
    };
    Session::new(config, at(0), None)
}

fn hello() -> Hello {
    Hello {
        secret: SECRET,
        max_atlas_side: 1024,
        codecs: vec![Codec::H264],
    }
}

fn view(seq: u32) -> ViewReport {
    let eye = EyeView {
        head_from_eye: Pose::IDENTITY,
        fov: Fov::symmetric(1.5),
    };
    ViewReport {
        seq: ViewSeq(seq),
        sampled_at: ClientTime(u64::from(seq)),
        display_at: ClientTime(u64::from(seq)),
        world_from_head: Pose::IDENTITY,
        linear_velocity: Vec3::X,
        angular_velocity: Vec3::ZERO,
        eyes: [eye; 2],
        eye_resolution: [64; 2],
        hands: [None; 2],
    }
}

/// The frame that was ordered, after `light` of path tracing.
fn frame(order: &FrameOrder, light: Duration) -> Box<Frame> {
    Box::new(Frame {
        update: Update {
            frame: order.frame,
            epoch: Epoch(1),
            timing: order.timing,
            world_from_head: Pose::IDENTITY,
            scene_time: 0,
            objects_lead: 0,
            vertices: Vec::new(),
            patches: Vec::new(),
            removals: Vec::new(),
            placements: Vec::new(),
            masks: Vec::new(),
            motions: Vec::new(),
        },
        picture: Picture {
            frame: order.frame,
            epoch: Epoch(1),
            idr: order.reset,
            bytes: vec![0],
        },
        stats: FrameStats {
            stages: Stages {
                light,
                ..Stages::default()
            },
            visible: 0,
            unplaced: 0,
            bias: 0.0,
            atlas: AtlasStats::default(),
            paths: order.paths,
        },
    })
}

impl Session {
    fn hears(&mut self, message: ToServer) -> Vec<Output> {
        self.handle_input(Input::Message {
            received: at(0),
            message,
        });
        self.says()
    }

    fn says(&mut self) -> Vec<Output> {
        std::iter::from_fn(|| self.poll_output()).collect()
    }

    /// Orders the frame that is due and makes it in no time.
    fn makes_frame(&mut self, now: ServerTime) -> FrameOrder {
        let order = self.order_frame(now, 0).expect("a frame is due");
        self.handle_input(Input::FrameMade(frame(&order, Duration::ZERO)));
        order
    }
}

fn streaming() -> Session {
    let mut session = session();
    assert!(matches!(
        session.hears(ToServer::Hello(hello()))[..],
        [Output::Send(ToClient::Welcome(_))]
    ));
    assert!(session.is_streaming());
    session
}

fn viewing() -> Session {
    let mut session = streaming();
    assert!(session.hears(ToServer::View(view(0))).is_empty());
    session
}

/// What a client that is sent away hears: a refusal at most, and no welcome.
fn assert_closed(session: &Session, said: &[Output], refusal: Option<Refusal>) {
    let refused = match said {
        [Output::Close(_)] => None,
        [Output::Send(ToClient::Refused(refusal)), Output::Close(_)] => Some(*refusal),
        other => panic!("{other:?}"),
    };
    assert_eq!(refused, refusal);
    assert!(!session.is_streaming());
}

#[test]
fn a_wrong_secret_is_refused() {
    let mut session = session();
    let mut secret = SECRET;
    secret.0[15] ^= 1;
    let said = session.hears(ToServer::Hello(Hello { secret, ..hello() }));
    assert_closed(&session, &said, Some(Refusal::Secret));
    let said = session.hears(ToServer::Hello(hello()));
    assert!(said.is_empty(), "there is no second try: {said:?}");
    assert!(session.order_frame(at(100), 0).is_none());
}

#[test]
fn a_client_that_cannot_decode_the_atlas_is_refused() {
    let small = Hello {
        max_atlas_side: 1023,
        ..hello()
    };
    let no_codec = Hello {
        codecs: Vec::new(),
        ..hello()
    };
    for hello in [small, no_codec] {
        let mut session = session();
        let said = session.hears(ToServer::Hello(hello));
        assert_closed(&session, &said, Some(Refusal::Capabilities));
    }
}

#[test]
fn the_secret_is_asked_before_anything_is_told() {
    let stranger = Hello {
        secret: Secret([0; 16]),
        max_atlas_side: 64,
        codecs: Vec::new(),
    };
    let mut session = session();
    let said = session.hears(ToServer::Hello(stranger));
    assert_closed(&session, &said, Some(Refusal::Secret));
}

#[test]
fn nothing_is_heard_before_hello() {
    let acknowledgement = Acknowledgement {
        frame: FrameId(0),
        motion_to_photon: 1,
    };
    for message in [
        ToServer::View(view(0)),
        ToServer::Acknowledge(acknowledgement),
        ToServer::RequestReset(ResetReason::Gap),
        ToServer::Bye,
    ] {
        let mut session = session();
        let said = session.hears(message);
        assert_closed(&session, &said, None);
    }
}

#[test]
fn hello_is_said_once() {
    let mut session = streaming();
    let said = session.hears(ToServer::Hello(hello()));
    assert_closed(&session, &said, None);
}

#[test]
fn a_session_ends_once() {
    let mut session = viewing();
    let said = session.hears(ToServer::Bye);
    assert_closed(&session, &said, None);
    for message in [
        ToServer::Bye,
        ToServer::View(view(1)),
        ToServer::Hello(hello()),
    ] {
        assert!(session.hears(message).is_empty());
    }
    assert!(session.order_frame(at(100), 0).is_none());
}

#[test]
fn who_never_says_hello_is_sent_away() {
    let mut session = session();
    assert!(session.order_frame(at(5_000), 0).is_none());
    assert!(session.poll_output().is_none());
    assert!(session.order_frame(at(5_001), 0).is_none());
    let said = session.says();
    assert_closed(&session, &said, None);
}

#[test]
fn no_frame_is_made_for_a_head_that_is_nowhere() {
    let mut session = streaming();
    assert!(session.order_frame(at(100), 0).is_none());
    session.hears(ToServer::View(view(0)));
    let order = session.order_frame(at(100), 0).expect("a frame is due");
    assert_eq!(order.frame, FrameId(0));
    assert!(order.new_client && order.reset);
    assert_eq!(order.prediction.heads.len(), 2);
}

#[test]
fn frames_keep_their_period() {
    let mut session = viewing();
    for number in 0..4 {
        let due = 100 + u64::from(number) * PERIOD;
        assert!(number == 0 || session.order_frame(at(due - 1), 0).is_none());
        let order = session.makes_frame(at(due));
        assert_eq!(order.frame, FrameId(number));
        assert_eq!(order.new_client, number == 0, "what was told stays told");
        assert_eq!(order.reset, number == 0);
        assert!(matches!(
            &session.says()[..],
            [Output::Send(ToClient::Update(update)), Output::Send(ToClient::Picture(picture))]
                if update.frame == order.frame && picture.frame == order.frame
        ));
    }
}

#[test]
fn one_frame_is_made_at_a_time() {
    let mut session = viewing();
    let order = session.order_frame(at(100), 0).expect("a frame is due");
    assert!(session.order_frame(at(500), 0).is_none());
    session.handle_input(Input::FrameMade(frame(&order, Duration::ZERO)));
    assert!(session.order_frame(at(500), 0).is_some());
}

#[test]
fn frames_are_left_out_while_more_than_three_pictures_wait() {
    let mut session = viewing();
    assert!(session.order_frame(at(100), 4).is_none());
    assert!(session.order_frame(at(100), 3).is_some());
}

#[test]
fn a_failed_frame_is_told_anew() {
    let mut session = viewing();
    session.makes_frame(at(100));
    let order = session.order_frame(at(200), 0).expect("a frame is due");
    assert!(!order.reset && !order.new_client);
    session.handle_input(Input::FrameFailed);
    let next = session.makes_frame(at(300));
    assert!(next.reset && next.new_client);
    assert!(next.frame > order.frame);
    let after = session.makes_frame(at(400));
    assert!(!after.reset && !after.new_client);
}

#[test]
fn a_reset_is_given_once_for_each_request() {
    let mut session = viewing();
    session.makes_frame(at(100));
    session.hears(ToServer::RequestReset(ResetReason::Decoder));
    session.hears(ToServer::RequestReset(ResetReason::Gap));
    let order = session.makes_frame(at(200));
    assert!(order.reset && !order.new_client, "geometry stays known");
    assert!(!session.makes_frame(at(300)).reset);
}

#[test]
fn an_older_view_does_not_replace_a_newer_one() {
    let mut session = streaming();
    for seq in [5, 3, 5, 4] {
        session.hears(ToServer::View(view(seq)));
    }
    assert_eq!(session.makes_frame(at(100)).timing.view, ViewSeq(5));
    session.hears(ToServer::View(view(6)));
    assert_eq!(session.makes_frame(at(200)).timing.view, ViewSeq(6));
}

/// When the last head of an order is, and where: it moves at a metre a second.
fn last_head(order: &FrameOrder) -> (Duration, f32) {
    let last = order.prediction.heads.last().expect("at least one");
    (last.after, last.world_from_head.position.x)
}

#[test]
fn the_horizon_follows_the_latency_and_the_age_of_the_view() {
    let mut session = viewing();
    let order = session.makes_frame(at(100));
    let (after, x) = last_head(&order);
    assert!(
        after > Duration::from_millis(100),
        "light is expected late at first"
    );
    let age = 0.1;
    assert!(
        (x - after.as_secs_f32() - age).abs() < 1e-3,
        "{x} m in {after:?}"
    );
    assert!(order.objects_lead < after);
    // 50 ms after the frame began, its light is seen.
    let acknowledge = |session: &mut Session, frame, motion_to_photon| {
        session.hears(ToServer::Acknowledge(Acknowledgement {
            frame,
            motion_to_photon,
        }));
    };
    acknowledge(&mut session, order.frame, 150_000_000);
    assert_eq!(session.latency(), Some(Duration::from_millis(150)));
    let order = session.makes_frame(at(100 + PERIOD));
    let (after, x) = last_head(&order);
    assert_eq!(after, Duration::from_millis(50 + PERIOD));
    assert!((x - 0.05 - 0.12 - 0.02).abs() < 1e-3, "{x} m");
    for number in 0..100_u64 {
        let order = session.makes_frame(at(200 + number * PERIOD));
        acknowledge(&mut session, order.frame, u64::MAX);
        assert!(last_head(&order).0 <= Duration::from_millis(500));
        assert!(order.objects_lead <= Duration::from_millis(500));
    }
}

#[test]
fn reports_that_come_as_they_should_not_are_survived() {
    let mut session = viewing();
    let mut told = view(1);
    for (number, display_at) in (1..).zip([20, 20, 10, 40, u64::MAX, 0, 5]) {
        told.seq = ViewSeq(number);
        told.display_at = ClientTime(u64::saturating_mul(display_at, 1_000_000));
        told.world_from_head.position.x = number as f32;
        session.hears(ToServer::View(told));
        let order = session.makes_frame(at(u64::from(number) * 100));
        for head in &order.prediction.heads {
            assert!(head.world_from_head.is_valid(), "{head:?}");
        }
    }
}

#[test]
fn paths_fill_the_time_there_is_for_light() {
    let mut session = viewing();
    let order = session.order_frame(at(100), 0).expect("a frame is due");
    assert_eq!(order.paths, FIRST_PATHS);
    // Half the budget was used: twice the paths fit.
    session.handle_input(Input::FrameMade(frame(&order, Duration::from_millis(5))));
    let order = session.order_frame(at(200), 0).expect("a frame is due");
    assert!(order.paths.abs_diff(2 * FIRST_PATHS) <= 1);
    // A clock that stands still measures nothing.
    session.handle_input(Input::FrameMade(frame(&order, Duration::ZERO)));
    let speed = session.speed().expect("it was measured");
    let next = Session::new(session.config.clone(), at(0), Some(speed));
    assert_eq!(next.speed(), Some(speed));
}

#[test]
fn hands_are_those_of_the_newest_view() {
    let mut session = streaming();
    assert_eq!(session.hands(), Hands::default());
    for (seq, presses) in [(0, 5), (2, 7), (1, 6)] {
        let mut view = view(seq);
        view.hands[0] = Some(shadecast_protocol::Hand {
            world_from_aim: Pose::IDENTITY,
            pressed: presses == 7,
            presses,
        });
        session.hears(ToServer::View(view));
    }
    let hands = session.hands();
    assert_eq!(hands.presses, [2, 0], "reports may overtake each other");
    assert!(hands.now[0].is_some_and(|hand| hand.pressed));
}
