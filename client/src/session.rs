//! The client's side of a session, sans-IO: inputs with the time at which they
//! happened go in, outputs come out. It reads no clock, opens no socket and
//! starts no thread, so that a bad minute of Wi-Fi replays in a millisecond.
//!
//! ```text
//!            Connect           Hello            Welcome
//!  Waiting ---------> Connecting ----> Greeting --------> Streaming
//!     ^                   |               |                   |
//!     +---- back off -----+---------------+-------------------+    -> Ended
//! ```
//!
//! While its user looks away the session rests: it leaves the server, which has
//! nothing to compute then, and comes back when it is woken.
//!
//! What runs it does as the outputs say, answers every [`Output::Connect`] with
//! [`Input::Connected`] or [`Input::Disconnected`], and gives no input of an old
//! connection after its [`Output::Disconnect`]. It drains the outputs after
//! each input, and ticks at least every 50 ms.
//!
//! Frames go to the drawing thread through a triple buffer, so that neither side
//! waits for the other: `render::frame_channel`.

mod inbox;
mod io;
mod stream;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::time::Duration;

use shadecast_protocol::{
    Acknowledgement, ClientTime, Codec, FrameId, Hello, Refusal, Secret, ToClient, ToServer,
    ViewReport, ViewSeq, Welcome,
};

use crate::{ClockEstimate, Decoded, Drawn};
use stream::Stream;

pub use io::{Disconnection, Failure, HeadView, Input, Output, Status};

/// First wait before connecting again; doubles up to [`BACKOFF_MAX`].
const BACKOFF_MIN: Duration = Duration::from_millis(200);
/// Longest wait: a server that restarts is found again while its user is still
/// looking.
const BACKOFF_MAX: Duration = Duration::from_secs(2);
/// A server that accepts a connection answers a hello at once, unless it hangs.
const GREETING_TIMEOUT: Duration = Duration::from_secs(5);

/// What a session is started with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SessionConfig {
    /// From the line that the server printed.
    pub secret: Secret,
    /// Largest atlas side that this client's decoder and GPU take, texels.
    pub max_atlas_side: u16,
}

/// A session with a server, across as many connections as it takes.
#[derive(Debug)]
pub struct Session {
    config: SessionConfig,
    state: State,
    /// Connections that reached a server's welcome.
    welcomes: u32,
    backoff: Duration,
    outputs: VecDeque<Output>,
}

#[derive(Debug)]
enum State {
    /// Connects at this time.
    Waiting { until: ClientTime },
    /// [`Output::Connect`] is not answered yet.
    Connecting,
    /// The hello is not answered yet.
    Greeting { since: ClientTime },
    /// The server sends frames.
    Streaming(Box<Connection>),
    /// Until it is woken.
    Resting,
    /// Failed for good, or left.
    Ended,
}

/// What begins with a welcome and ends with its connection.
#[derive(Debug)]
struct Connection {
    stream: Stream,
    clock: ClockEstimate,
    next_view: ViewSeq,
    acknowledged: Option<FrameId>,
}

impl Session {
    /// A session that connects at its first input.
    #[must_use]
    pub fn new(config: SessionConfig) -> Self {
        Self {
            config,
            state: State::Waiting {
                until: ClientTime(0),
            },
            welcomes: 0,
            backoff: BACKOFF_MIN,
            outputs: VecDeque::new(),
        }
    }

    /// What is to be done next; none when there is nothing before another input.
    pub fn poll_output(&mut self) -> Option<Output> {
        self.outputs.pop_front()
    }

    /// Takes what happened at `now`, which never goes backwards.
    pub fn handle_input(&mut self, now: ClientTime, input: Input) {
        match input {
            Input::Connected => self.handle_connected(now),
            Input::Message(message) => self.handle_message(now, message),
            Input::Decoded(decoded) => self.handle_decoded(now, decoded),
            Input::View(view) => self.handle_view(view),
            Input::Drawn(drawn) => self.handle_drawn(&drawn),
            Input::Disconnected(reason) => self.handle_disconnected(now, reason),
            Input::Rest => self.rest(),
            Input::Wake => self.wake(now),
            Input::Leave => self.leave(),
            Input::Tick => {}
        }
        self.keep_time(now);
    }

    /// Nanoseconds to add to a server time to get a client time; none before
    /// the first clock sample of the connection.
    #[must_use]
    pub fn client_minus_server(&self) -> Option<i64> {
        match &self.state {
            State::Streaming(connection) => connection.clock.client_minus_server(),
            _ => None,
        }
    }

    fn handle_connected(&mut self, now: ClientTime) {
        if !matches!(self.state, State::Connecting) {
            return;
        }
        self.state = State::Greeting { since: now };
        let hello = Hello {
            secret: self.config.secret,
            max_atlas_side: self.config.max_atlas_side,
            codecs: vec![Codec::H264],
        };
        self.outputs.push_back(Output::Send(ToServer::Hello(hello)));
    }

    fn handle_message(&mut self, now: ClientTime, message: ToClient) {
        match (&mut self.state, message) {
            (State::Waiting { .. } | State::Connecting | State::Resting | State::Ended, _) => {}
            (State::Greeting { .. }, ToClient::Welcome(welcome)) => self.enter(now, welcome),
            (State::Greeting { .. }, ToClient::Refused(refusal)) => self.be_refused(now, refusal),
            (State::Greeting { .. } | State::Streaming(_), ToClient::Bye) => {
                self.hang_up(now, "the server ended the session".into());
            }
            (State::Streaming(connection), ToClient::Clock(reply)) => {
                connection.clock.add(now, reply);
            }
            (State::Streaming(connection), ToClient::Update(update)) => {
                connection.stream.take_update(now, update);
                self.advance(now);
            }
            (State::Streaming(connection), ToClient::Picture(picture)) => {
                connection.stream.take_picture(now, picture);
                self.advance(now);
            }
            (State::Greeting { .. } | State::Streaming(_), message) => {
                let name = match message {
                    ToClient::Welcome(_) => "a welcome",
                    ToClient::Refused(_) => "a refusal",
                    ToClient::Clock(_) => "a clock reply",
                    ToClient::Update(_) => "an update",
                    ToClient::Picture(_) => "a picture",
                    ToClient::Bye => "a farewell",
                };
                self.hang_up(now, format!("the server sent {name} out of turn"));
            }
        }
    }

    fn enter(&mut self, now: ClientTime, welcome: Welcome) {
        let [width, height] = welcome.atlas_size;
        let is_possible =
            |side: u16| side != 0 && side.is_multiple_of(2) && side <= self.config.max_atlas_side;
        if !is_possible(width) || !is_possible(height) {
            let reason = format!("the server has an impossible atlas of {width}x{height} texels");
            self.hang_up(now, reason);
            return;
        }
        self.welcomes = self.welcomes.wrapping_add(1);
        self.backoff = BACKOFF_MIN;
        self.state = State::Streaming(Box::new(Connection {
            stream: Stream::new(self.welcomes, welcome.atlas_size, welcome.method),
            clock: ClockEstimate::default(),
            next_view: ViewSeq(0),
            acknowledged: None,
        }));
        self.outputs.push_back(Output::Welcomed(Box::new(welcome)));
        self.outputs.push_back(Output::Status(Status::Filling));
    }

    /// A refusal is final, except that a server which is busy just after it
    /// welcomed this very client has not yet noticed that its connection broke.
    fn be_refused(&mut self, now: ClientTime, refusal: Refusal) {
        if refusal == Refusal::Busy && self.welcomes > 0 {
            self.hang_up(now, refusal.to_string());
        } else {
            self.outputs
                .push_back(Output::Disconnect(refusal.to_string()));
            self.fail(Failure::Refused(refusal));
        }
    }

    fn handle_decoded(&mut self, now: ClientTime, decoded: Decoded) {
        let State::Streaming(connection) = &mut self.state else {
            return;
        };
        match connection.stream.take_decoded(now, decoded) {
            Ok(()) => self.advance(now),
            Err(error) => {
                self.outputs
                    .push_back(Output::Disconnect("the client has no decoder".into()));
                self.fail(Failure::Decoder(error));
            }
        }
    }

    fn handle_view(&mut self, view: HeadView) {
        let State::Streaming(connection) = &mut self.state else {
            return;
        };
        let seq = connection.next_view;
        connection.next_view = ViewSeq(seq.0.wrapping_add(1));
        let report = ViewReport {
            seq,
            sampled_at: view.sampled_at,
            display_at: view.display_at,
            world_from_head: view.world_from_head,
            linear_velocity: view.linear_velocity,
            angular_velocity: view.angular_velocity,
            eyes: view.eyes,
            eye_resolution: view.eye_resolution,
            hands: view.hands,
        };
        self.outputs.push_back(Output::Send(ToServer::View(report)));
    }

    /// Frames of an earlier connection may still be drawn; the server of this
    /// one does not hear of them.
    fn handle_drawn(&mut self, drawn: &Drawn) {
        let State::Streaming(connection) = &mut self.state else {
            return;
        };
        let was_presented = connection.stream.presented() >= Some(drawn.frame);
        if !was_presented || connection.acknowledged >= Some(drawn.frame) {
            return;
        }
        connection.acknowledged = Some(drawn.frame);
        let acknowledgement = Acknowledgement {
            frame: drawn.frame,
            motion_to_photon: drawn.motion_to_photon().as_nanos() as u64,
        };
        self.outputs
            .push_back(Output::Send(ToServer::Acknowledge(acknowledgement)));
    }

    fn handle_disconnected(&mut self, now: ClientTime, reason: Disconnection) {
        if matches!(
            self.state,
            State::Waiting { .. } | State::Resting | State::Ended
        ) {
            return;
        }
        match reason {
            Disconnection::Lost(reason) => self.reconnect(now, reason),
            Disconnection::Invalid(error) => match Failure::from_wire(&error) {
                Some(failure) => self.fail(failure),
                None => self.reconnect(now, error.to_string()),
            },
            Disconnection::Untrusted(reason) => self.fail(Failure::Untrusted(reason)),
        }
    }

    fn leave(&mut self) {
        self.take_leave("the client leaves");
        self.state = State::Ended;
    }

    fn rest(&mut self) {
        if matches!(self.state, State::Resting | State::Ended) {
            return;
        }
        self.take_leave("the client rests");
        self.state = State::Resting;
        self.outputs.push_back(Output::Status(Status::Resting));
    }

    fn wake(&mut self, now: ClientTime) {
        if matches!(self.state, State::Resting) {
            self.backoff = BACKOFF_MIN;
            self.state = State::Waiting { until: now };
        }
    }

    /// Tells a server that is there, and closes the connection.
    fn take_leave(&mut self, reason: &str) {
        if matches!(self.state, State::Greeting { .. } | State::Streaming(_)) {
            self.outputs.push_back(Output::Send(ToServer::Bye));
        }
        match self.state {
            State::Connecting | State::Greeting { .. } | State::Streaming(_) => {
                self.outputs.push_back(Output::Disconnect(reason.into()));
            }
            State::Waiting { .. } | State::Resting | State::Ended => {}
        }
    }

    /// Lets the stream decode and present what it can.
    fn advance(&mut self, now: ClientTime) {
        let State::Streaming(connection) = &mut self.state else {
            return;
        };
        let Connection { stream, clock, .. } = connection.as_mut();
        if let Err(error) = stream.advance(now, clock, &mut self.outputs) {
            self.hang_up(
                now,
                format!("the server sent an impossible update: {error}"),
            );
        }
    }

    fn keep_time(&mut self, now: ClientTime) {
        match &mut self.state {
            State::Waiting { until } if *until <= now => {
                self.state = State::Connecting;
                self.outputs.push_back(Output::Status(Status::Connecting));
                self.outputs.push_back(Output::Connect);
            }
            State::Greeting { since } if elapsed(*since, now) >= GREETING_TIMEOUT => {
                self.hang_up(now, "the server does not answer".into());
            }
            State::Streaming(connection) => connection.stream.watch(now, &mut self.outputs),
            _ => {}
        }
    }

    /// Closes a connection that still stands, and connects again later.
    fn hang_up(&mut self, now: ClientTime, reason: String) {
        self.outputs.push_back(Output::Disconnect(reason.clone()));
        self.reconnect(now, reason);
    }

    fn reconnect(&mut self, now: ClientTime, reason: String) {
        let after = self.backoff;
        self.backoff = (self.backoff * 2).min(BACKOFF_MAX);
        self.state = State::Waiting {
            until: ClientTime(now.0.saturating_add(after.as_nanos() as u64)),
        };
        let status = Status::Reconnecting { reason, after };
        self.outputs.push_back(Output::Status(status));
    }

    fn fail(&mut self, failure: Failure) {
        self.state = State::Ended;
        self.outputs.push_back(Output::Failed(failure));
    }
}

fn elapsed(since: ClientTime, now: ClientTime) -> Duration {
    Duration::from_nanos(now.0.saturating_sub(since.0))
}
