//! A session in virtual time: how it connects, ends and connects again.

mod lossy;
mod recovery;
mod server;

use glam::Vec3;
use shadecast_protocol::{
    ClockReply, EyeView, Fov, Method, Pose, ResetReason, ServerTime, Sky, WireError,
};

use super::*;
use crate::{DecodeError, Ticket, YuvPicture};
use server::{Server, picture_of};

const MS: u64 = 1_000_000;
const SECRET: Secret = Secret([7; 16]);

/// A session and the outputs that it gave, in virtual time.
struct Client {
    session: Session,
    now: u64,
}

impl Client {
    fn new() -> Self {
        let session = Session::new(SessionConfig {
            secret: SECRET,
            max_atlas_side: 4096,
        });
        Self { session, now: 0 }
    }

    /// A client whose session is welcomed.
    fn welcomed() -> Self {
        let mut client = Self::new();
        client.input(Input::Tick);
        client.input(Input::Connected);
        client.message(ToClient::Welcome(welcome()));
        client
    }

    fn input(&mut self, input: Input) -> Vec<Output> {
        self.session.handle_input(ClientTime(self.now), input);
        std::iter::from_fn(|| self.session.poll_output()).collect()
    }

    fn message(&mut self, message: ToClient) -> Vec<Output> {
        self.input(Input::Message(message))
    }

    /// Ticks every 10 ms for that long.
    fn pass(&mut self, ms: u64) -> Vec<Output> {
        let mut outputs = Vec::new();
        for _ in 0..ms / 10 {
            self.now += 10 * MS;
            outputs.extend(self.input(Input::Tick));
        }
        outputs
    }

    /// Decodes at once, for as long as the session asks for it.
    fn decode_all(&mut self, mut outputs: Vec<Output>) -> Vec<Output> {
        let mut seen = 0;
        while seen < outputs.len() {
            if let Output::Decode(unit) = &outputs[seen] {
                let decoded = Decoded {
                    ticket: unit.ticket,
                    picture: Ok(picture_of(&unit.bytes).into()),
                };
                let more = self.input(Input::Decoded(decoded));
                outputs.extend(more);
            }
            seen += 1;
        }
        outputs
    }

    /// Receives and decodes a frame's two messages.
    fn frame(&mut self, (update, picture): (ToClient, ToClient)) -> Vec<Output> {
        let mut outputs = self.message(update);
        let decode = self.message(picture);
        outputs.extend(self.decode_all(decode));
        outputs
    }
}

fn welcome() -> Welcome {
    Welcome {
        codec: Codec::H264,
        method: Method::Sas,
        atlas_size: server::ATLAS,
        superblock: 64,
        world_from_play: Pose::IDENTITY,
        sky: Sky {
            width: 1,
            height: 1,
            rgb: vec![0; 3],
        },
    }
}

fn presented(outputs: &[Output]) -> Vec<u32> {
    let frames = outputs.iter().filter_map(|output| match output {
        Output::Present(frame) => Some(frame.frame.0),
        _ => None,
    });
    frames.collect()
}

fn reset_requests(outputs: &[Output]) -> Vec<ResetReason> {
    let requests = outputs.iter().filter_map(|output| match output {
        Output::Send(ToServer::RequestReset(reason)) => Some(*reason),
        _ => None,
    });
    requests.collect()
}

fn disconnected(outputs: &[Output]) -> Option<&str> {
    outputs.iter().find_map(|output| match output {
        Output::Disconnect(reason) => Some(reason.as_str()),
        _ => None,
    })
}

fn failure(outputs: &[Output]) -> Option<&Failure> {
    outputs.iter().find_map(|output| match output {
        Output::Failed(failure) => Some(failure),
        _ => None,
    })
}

fn connects(outputs: &[Output]) -> bool {
    outputs
        .iter()
        .any(|output| matches!(output, Output::Connect))
}

fn head_view(sampled_at: u64) -> HeadView {
    let eye = EyeView {
        head_from_eye: Pose::IDENTITY,
        fov: Fov::symmetric(1.5),
    };
    HeadView {
        sampled_at: ClientTime(sampled_at),
        display_at: ClientTime(sampled_at),
        world_from_head: Pose::IDENTITY,
        linear_velocity: Vec3::ZERO,
        angular_velocity: Vec3::ZERO,
        eyes: [eye; 2],
        eye_resolution: [256, 256],
        hands: [None; 2],
    }
}

#[test]
fn a_session_greets_and_shows_what_comes() {
    let mut client = Client::new();
    assert!(connects(&client.input(Input::Tick)));
    let outputs = client.input(Input::Connected);
    assert!(matches!(
        &outputs[..],
        [Output::Send(ToServer::Hello(hello))] if hello.secret == SECRET && hello.codecs == [Codec::H264]
    ));
    let outputs = client.message(ToClient::Welcome(welcome()));
    assert!(matches!(
        &outputs[..],
        [Output::Welcomed(_), Output::Status(Status::Filling)]
    ));

    let mut server = Server::default();
    for number in 0..5 {
        assert_eq!(presented(&client.frame(server.frame())), [number]);
    }
}

#[test]
fn views_are_numbered_and_first_drawings_acknowledged_once() {
    let mut client = Client::welcomed();
    for number in 0..3 {
        let outputs = client.input(Input::View(head_view(5)));
        assert!(matches!(
            &outputs[..],
            [Output::Send(ToServer::View(report))]
                if report.seq == ViewSeq(number) && report.sampled_at == ClientTime(5)
        ));
    }
    let drawn = Drawn {
        frame: FrameId(0),
        view_sampled: ClientTime(5),
        started: ClientTime(20),
        finished: ClientTime(35),
    };
    assert!(
        client.input(Input::Drawn(drawn)).is_empty(),
        "of an earlier connection"
    );
    client.frame(Server::default().frame());
    let outputs = client.input(Input::Drawn(drawn));
    let expected = Acknowledgement {
        frame: FrameId(0),
        motion_to_photon: 30,
    };
    assert!(matches!(
        &outputs[..],
        [Output::Send(ToServer::Acknowledge(sent))] if *sent == expected
    ));
    assert!(client.input(Input::Drawn(drawn)).is_empty());
}

#[test]
fn frames_carry_the_clock_offset() {
    let mut client = Client::welcomed();
    client.now = 1_000 * MS;
    client.message(ToClient::Clock(ClockReply {
        client_sent: ClientTime(990 * MS),
        server_received: ServerTime(95 * MS),
        server_sent: ServerTime(95 * MS),
    }));
    assert_eq!(client.session.client_minus_server(), Some(900 * MS as i64));
    let outputs = client.frame(Server::default().frame());
    let frame = outputs.iter().find_map(|output| match output {
        Output::Present(frame) => Some(frame),
        _ => None,
    });
    let timing = frame.unwrap().timing;
    assert_eq!(timing.client_minus_server, 900 * MS as i64);
    assert_eq!((timing.received, timing.decoded), (client.now, client.now));
}

#[test]
fn backs_off_up_to_two_seconds_and_never_gives_up() {
    let mut client = Client::new();
    assert!(connects(&client.input(Input::Tick)));
    for wait in [200, 400, 800, 1600, 2000, 2000, 2000] {
        let reason = Disconnection::Lost("nobody there".into());
        let outputs = client.input(Input::Disconnected(reason));
        let status = Status::Reconnecting {
            reason: "nobody there".into(),
            after: Duration::from_millis(wait),
        };
        assert!(matches!(&outputs[..], [Output::Status(told)] if *told == status));
        assert!(!connects(&client.pass(wait - 10)));
        assert!(connects(&client.pass(10)));
    }
}

#[test]
fn refusals_and_other_protocols_are_final() {
    let refused = |refusal| Failure::Refused(refusal);
    for refusal in [
        Refusal::Secret,
        Refusal::Version(9),
        Refusal::Capabilities,
        Refusal::Busy,
    ] {
        let mut client = Client::new();
        client.input(Input::Tick);
        client.input(Input::Connected);
        let outputs = client.message(ToClient::Refused(refusal));
        assert_eq!(failure(&outputs), Some(&refused(refusal)));
        assert!(client.pass(10_000).is_empty());
    }
    let version = WireError::Version { peer: 9 };
    for (reason, expected) in [
        (
            Disconnection::Invalid(version.clone()),
            Failure::Protocol(version),
        ),
        (
            Disconnection::Untrusted("another certificate".into()),
            Failure::Untrusted("another certificate".into()),
        ),
    ] {
        let mut client = Client::welcomed();
        let outputs = client.input(Input::Disconnected(reason));
        assert_eq!(failure(&outputs), Some(&expected));
        assert!(client.pass(10_000).is_empty());
    }
}

#[test]
fn a_session_that_rests_leaves_the_server_and_comes_back_when_it_is_woken() {
    let mut client = Client::welcomed();
    client.frame(Server::default().frame());
    let outputs = client.input(Input::Rest);
    assert!(matches!(
        &outputs[..],
        [
            Output::Send(ToServer::Bye),
            Output::Disconnect(_),
            Output::Status(Status::Resting)
        ]
    ));
    assert!(client.input(Input::Rest).is_empty());
    // Whatever is on its way still, it stays away.
    client.input(Input::View(head_view(5)));
    client.message(ToClient::Bye);
    client.input(Input::Disconnected(Disconnection::Lost("closed".into())));
    assert!(client.pass(60_000).is_empty());
    assert!(connects(&client.input(Input::Wake)));
    assert!(client.input(Input::Wake).is_empty(), "it is awake");
    client.input(Input::Connected);
    client.message(ToClient::Welcome(welcome()));
    assert_eq!(
        presented(&client.frame(Server::default().frame())),
        [0],
        "a new connection counts from the start"
    );

    // While it reaches for the server, and when it has left for good.
    let mut client = Client::new();
    assert!(connects(&client.input(Input::Tick)));
    assert!(disconnected(&client.input(Input::Rest)).is_some());
    client.input(Input::Leave);
    assert!(client.input(Input::Wake).is_empty());
    assert!(client.pass(10_000).is_empty());
}

#[test]
fn a_server_still_busy_with_this_client_is_tried_again() {
    let mut client = Client::welcomed();
    client.input(Input::Disconnected(Disconnection::Lost("gone".into())));
    assert!(connects(&client.pass(200)));
    client.input(Input::Connected);
    let outputs = client.message(ToClient::Refused(Refusal::Busy));
    assert_eq!(failure(&outputs), None);
    assert!(connects(&client.pass(2_000)));
}

#[test]
fn messages_out_of_turn_end_the_connection_with_a_sentence() {
    let (update, _) = Server::default().frame();
    let mut client = Client::new();
    client.input(Input::Tick);
    client.input(Input::Connected);
    let outputs = client.message(update);
    assert_eq!(
        disconnected(&outputs),
        Some("the server sent an update out of turn")
    );
    assert!(connects(&client.pass(200)));

    let mut client = Client::welcomed();
    let outputs = client.message(ToClient::Welcome(welcome()));
    assert_eq!(
        disconnected(&outputs),
        Some("the server sent a welcome out of turn")
    );
}

#[test]
fn garbage_an_impossible_update_or_atlas_or_silence_are_tried_again() {
    let mut client = Client::welcomed();
    let garbage = Disconnection::Invalid(WireError::Malformed { what: "update" });
    assert_eq!(failure(&client.input(Input::Disconnected(garbage))), None);
    assert!(connects(&client.pass(200)));

    let mut client = Client::welcomed();
    let (mut update, picture) = Server::default().frame();
    if let ToClient::Update(update) = &mut update {
        update.vertices.clear();
    }
    let outputs = client.frame((update, picture));
    assert_eq!(presented(&outputs), [0; 0]);
    let reason = disconnected(&outputs).unwrap();
    assert!(reason.starts_with("the server sent an impossible update: patch"));
    assert!(connects(&client.pass(200)));

    for side in [0, 65, 8192] {
        let mut client = Client::new();
        client.input(Input::Tick);
        client.input(Input::Connected);
        let mut welcome = welcome();
        welcome.atlas_size[1] = side;
        assert!(disconnected(&client.message(ToClient::Welcome(welcome))).is_some());
    }

    let mut client = Client::new();
    client.input(Input::Tick);
    client.input(Input::Connected);
    assert_eq!(disconnected(&client.pass(4_990)), None);
    assert_eq!(
        disconnected(&client.pass(10)),
        Some("the server does not answer")
    );
}

#[test]
fn a_restarted_server_starts_from_nothing() {
    let mut client = Client::welcomed();
    let mut old = Server::default();
    for _ in 0..10 {
        client.frame(old.frame());
    }
    // A picture of the old connection is still with the decoder.
    let (update, picture) = old.frame();
    client.message(update);
    let outputs = client.message(picture);
    let Some(Output::Decode(late)) = outputs.into_iter().next() else {
        panic!("a picture is decoded");
    };

    assert!(disconnected(&client.message(ToClient::Bye)).is_some());
    assert!(connects(&client.pass(200)));
    client.input(Input::Connected);
    client.message(ToClient::Welcome(welcome()));
    let mut new = Server::default();
    let outputs = client.frame(new.frame());
    assert_eq!(presented(&outputs), [0], "a lower number than before");

    let (update, picture) = new.frame();
    client.message(update);
    client.message(picture);
    let stale = Decoded {
        ticket: Ticket {
            frame: FrameId(1),
            ..late.ticket
        },
        picture: Ok(picture_of(&late.bytes).into()),
    };
    assert_eq!(presented(&client.input(Input::Decoded(stale))), [0; 0]);
}

#[test]
fn leaving_says_farewell_and_is_final() {
    let mut client = Client::welcomed();
    let outputs = client.input(Input::Leave);
    assert!(matches!(
        &outputs[..],
        [Output::Send(ToServer::Bye), Output::Disconnect(_)]
    ));
    assert!(client.pass(10_000).is_empty());
}
