//! A client's session, without IO: messages and times go in, messages and
//! frame orders come out.
//!
//! The session knows who may connect, where the head was last seen, how long
//! an update takes to be seen, and when the next frame is worth making.

mod hands;
#[cfg(test)]
mod tests;

use std::{collections::VecDeque, time::Duration};

use shadecast_protocol::{
    Codec, FrameId, Hello, Refusal, Secret, ServerTime, ToClient, ToServer, UpdateTiming,
    ViewReport, Welcome,
};

use crate::{
    frame::{Frame, FrameOrder},
    prediction::{HeadFilter, Latency, Prediction},
};

pub use hands::Hands;

/// Weight of a new measurement of the light stage's speed.
const SPEED_WEIGHT: f64 = 0.3;
/// Paths of the first frame, before their speed is known.
const FIRST_PATHS: u32 = 16_384;
/// Longest wait for the first message of a client.
const HELLO_TIMEOUT: Duration = Duration::from_secs(5);

/// What is the same for every session of a server.
#[derive(Clone, Debug)]
pub struct SessionConfig {
    /// Who may connect.
    pub secret: Secret,
    /// The answer to who may.
    pub welcome: Welcome,
    /// Shortest time between two frames.
    pub frame_period: Duration,
    /// Time for the light stage of a frame.
    pub light_budget: Duration,
    /// Most heads sampled over the horizon.
    pub head_samples: u32,
}

/// What happens to a session.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "an input is handled at once; none ever waits"
)]
pub enum Input {
    /// A message arrived.
    Message {
        /// When it did.
        received: ServerTime,
        /// What it says.
        message: ToServer,
    },
    /// A frame that was ordered is made.
    FrameMade(Box<Frame>),
    /// A frame that was ordered could not be made.
    FrameFailed,
}

/// What a session wants done.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "an output is handed over at once; only a few ever wait"
)]
pub enum Output {
    /// Tell the client.
    Send(ToClient),
    /// End the connection.
    Close(String),
}

/// How far the session has come.
#[derive(Clone, Debug)]
enum State {
    AwaitingHello { since: ServerTime },
    Streaming(Box<Stream>),
    Closed,
}

#[derive(Clone, Debug)]
struct Stream {
    next_frame: FrameId,
    heard: Option<Heard>,
    started: Option<ServerTime>,
    in_the_making: bool,
    new_client: bool,
    reset: bool,
    latency: Latency,
    hands: Hands,
}

/// What the client said of its head.
#[derive(Clone, Debug)]
struct Heard {
    received: ServerTime,
    view: ViewReport,
    filter: HeadFilter,
}

/// One client's session.
#[derive(Clone, Debug)]
pub struct Session {
    config: SessionConfig,
    state: State,
    outputs: VecDeque<Output>,
    /// Paths a second of the light stage; outlives the client.
    speed: Option<f64>,
}

impl Session {
    /// A client has connected; `speed` is what [`Session::speed`] said before.
    #[must_use]
    pub fn new(config: SessionConfig, now: ServerTime, speed: Option<f64>) -> Self {
        Self {
            config,
            state: State::AwaitingHello { since: now },
            outputs: VecDeque::new(),
            speed,
        }
    }

    /// Paths a second of the light stage, as far as it is known.
    #[must_use]
    pub fn speed(&self) -> Option<f64> {
        self.speed
    }

    /// True once the client proved that it may be here.
    #[must_use]
    pub fn is_streaming(&self) -> bool {
        matches!(self.state, State::Streaming(_))
    }

    /// Mean of late of the time from a pose to its light.
    #[must_use]
    pub fn latency(&self) -> Option<Duration> {
        match &self.state {
            State::Streaming(stream) => stream.latency.motion_to_photon(),
            _ => None,
        }
    }

    /// What the client's controllers do.
    #[must_use]
    pub fn hands(&self) -> Hands {
        match &self.state {
            State::Streaming(stream) => stream.hands,
            _ => Hands::default(),
        }
    }

    /// Tells the session what happened.
    pub fn handle_input(&mut self, input: Input) {
        match input {
            Input::Message { received, message } => self.handle_message(received, message),
            Input::FrameMade(frame) => self.frame_made(*frame),
            Input::FrameFailed => {
                if let State::Streaming(stream) = &mut self.state {
                    // What the lost frame would have told must be told again.
                    stream.in_the_making = false;
                    stream.new_client = true;
                    stream.reset = true;
                }
            }
        }
    }

    /// What to do next, if anything.
    pub fn poll_output(&mut self) -> Option<Output> {
        self.outputs.pop_front()
    }

    /// The next frame, when one is due: the client is there, its head is
    /// known, and the network is not behind.
    pub fn order_frame(
        &mut self,
        now: ServerTime,
        pictures_in_flight: usize,
    ) -> Option<FrameOrder> {
        /// Pictures that may wait in the network before frames are left out.
        const MOST_IN_FLIGHT: usize = 3;
        let stream = match &mut self.state {
            State::AwaitingHello { since } if elapsed(*since, now) > HELLO_TIMEOUT => {
                self.close("it never said hello".to_owned());
                return None;
            }
            State::Streaming(stream) => stream,
            _ => return None,
        };
        let heard = stream.heard.as_ref()?;
        let since_last = stream.started.map(|last| elapsed(last, now));
        let due = since_last.is_none_or(|time| time >= self.config.frame_period);
        if stream.in_the_making || !due || pictures_in_flight > MOST_IN_FLIGHT {
            return None;
        }
        let age = elapsed(heard.received, now);
        stream.latency.begun(stream.next_frame, since_last, age);
        let horizon = stream.latency.horizon();
        let (view, most) = (&heard.view, self.config.head_samples);
        let paths = self.speed.map_or(FIRST_PATHS, |speed| {
            (speed * self.config.light_budget.as_secs_f64()).clamp(256.0, f64::from(1 << 26)) as u32
        });
        stream.started = Some(now);
        stream.in_the_making = true;
        let order = FrameOrder {
            frame: stream.next_frame,
            prediction: Prediction::filtered(view, &heard.filter, age, horizon, most),
            scene_time: Duration::from_nanos(now.0),
            objects_lead: horizon.middle(),
            paths,
            reset: std::mem::take(&mut stream.reset),
            new_client: std::mem::take(&mut stream.new_client),
            timing: UpdateTiming {
                view: view.seq,
                view_sampled: view.sampled_at,
                view_received: heard.received,
                started: now,
                finished: now,
            },
        };
        stream.next_frame.0 = stream.next_frame.0.wrapping_add(1);
        Some(order)
    }

    fn handle_message(&mut self, received: ServerTime, message: ToServer) {
        match (&mut self.state, message) {
            (State::AwaitingHello { .. }, ToServer::Hello(hello)) => self.greet(&hello),
            (State::AwaitingHello { .. }, _) => {
                self.close("it spoke before it said hello".to_owned())
            }
            (State::Streaming(_), ToServer::Hello(_)) => {
                self.close("it said hello twice".to_owned())
            }
            (State::Streaming(stream), ToServer::View(view)) => {
                let known = stream.heard.as_ref().map(|heard| heard.view.seq);
                if known.is_none_or(|known| view.seq > known) {
                    stream.hands.take(view.hands);
                    let heard = stream.heard.get_or_insert_with(|| Heard {
                        received,
                        view,
                        filter: HeadFilter::new(&view),
                    });
                    heard.filter.tell(&view);
                    (heard.received, heard.view) = (received, view);
                }
            }
            (State::Streaming(stream), ToServer::Acknowledge(acknowledgement)) => {
                let seen_after = Duration::from_nanos(acknowledgement.motion_to_photon);
                stream.latency.seen(acknowledgement.frame, seen_after);
            }
            (State::Streaming(stream), ToServer::RequestReset(_)) => stream.reset = true,
            (State::Streaming(_), ToServer::Bye) => self.close("it said goodbye".to_owned()),
            (State::Closed, _) => {}
        }
    }

    fn greet(&mut self, hello: &Hello) {
        let [width, height] = self.config.welcome.atlas_size;
        let refusal = if !hello.secret.matches(&self.config.secret) {
            Some(Refusal::Secret)
        } else if !hello.codecs.contains(&Codec::H264) || hello.max_atlas_side < width.max(height) {
            Some(Refusal::Capabilities)
        } else {
            None
        };
        if let Some(refusal) = refusal {
            self.outputs
                .push_back(Output::Send(ToClient::Refused(refusal)));
            self.close(format!("it was refused: {refusal}"));
            return;
        }
        self.outputs
            .push_back(Output::Send(ToClient::Welcome(self.config.welcome.clone())));
        self.state = State::Streaming(Box::new(Stream {
            next_frame: FrameId(0),
            heard: None,
            started: None,
            in_the_making: false,
            new_client: true,
            reset: true,
            latency: Latency::new(self.config.frame_period),
            hands: Hands::default(),
        }));
    }

    fn frame_made(&mut self, frame: Frame) {
        let State::Streaming(stream) = &mut self.state else {
            return;
        };
        stream.in_the_making = false;
        let seconds = frame.stats.stages.light.as_secs_f64();
        if seconds > 1e-4 && frame.stats.paths > 0 {
            let measured = f64::from(frame.stats.paths) / seconds;
            let speed = self.speed.get_or_insert(measured);
            *speed += (measured - *speed) * SPEED_WEIGHT;
        }
        self.outputs
            .push_back(Output::Send(ToClient::Update(frame.update)));
        self.outputs
            .push_back(Output::Send(ToClient::Picture(frame.picture)));
    }

    fn close(&mut self, reason: String) {
        self.state = State::Closed;
        self.outputs.push_back(Output::Close(reason));
    }
}

fn elapsed(since: ServerTime, now: ServerTime) -> Duration {
    Duration::from_nanos(now.0.saturating_sub(since.0))
}
