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
    visibility::Prediction,
};

pub use hands::Hands;

/// Horizon before any acknowledgement told how long updates take.
const FIRST_HORIZON: Duration = Duration::from_millis(150);
/// Beyond this a linear prediction is worth nothing.
const LONGEST_HORIZON: Duration = Duration::from_millis(500);
/// Weight of a new measurement of the latency.
const LATENCY_WEIGHT: f64 = 0.1;
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
    /// Heads sampled over the horizon.
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
    view: Option<(ServerTime, ViewReport)>,
    started: Option<ServerTime>,
    in_the_making: bool,
    new_client: bool,
    reset: bool,
    /// From the sampling of a pose to the first light of the frame made for it, seconds.
    latency: Option<f64>,
    /// Between two frames, seconds.
    period: f64,
    hands: Hands,
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

    /// Median-like estimate of the time from a pose to its light.
    #[must_use]
    pub fn latency(&self) -> Option<Duration> {
        match &self.state {
            State::Streaming(stream) => stream.latency.map(Duration::from_secs_f64),
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
        let (view_received, view) = stream.view?;
        let due = stream
            .started
            .is_none_or(|last| elapsed(last, now) >= self.config.frame_period);
        if stream.in_the_making || !due || pictures_in_flight > MOST_IN_FLIGHT {
            return None;
        }
        if let Some(last) = stream.started {
            let period = elapsed(last, now).as_secs_f64().min(1.0);
            stream.period += (period - stream.period) * LATENCY_WEIGHT;
        }
        let horizon = stream.latency.map_or(FIRST_HORIZON, |latency| {
            Duration::from_secs_f64(latency + stream.period).min(LONGEST_HORIZON)
        });
        // Objects stand where they will be halfway through the frame's time on display.
        let lead = horizon.saturating_sub(Duration::from_secs_f64(stream.period * 0.5));
        let paths = self.speed.map_or(FIRST_PATHS, |speed| {
            (speed * self.config.light_budget.as_secs_f64()).clamp(256.0, f64::from(1 << 26)) as u32
        });
        stream.started = Some(now);
        stream.in_the_making = true;
        let order = FrameOrder {
            frame: stream.next_frame,
            prediction: Prediction::linear(&view, horizon, self.config.head_samples),
            scene_time: Duration::from_nanos(now.0),
            objects_lead: lead,
            paths,
            reset: std::mem::take(&mut stream.reset),
            new_client: std::mem::take(&mut stream.new_client),
            timing: UpdateTiming {
                view: view.seq,
                view_sampled: view.sampled_at,
                view_received,
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
                let newer = stream.view.is_none_or(|(_, known)| view.seq > known.seq);
                if newer {
                    stream.hands.take(view.hands);
                    stream.view = Some((received, view));
                }
            }
            (State::Streaming(stream), ToServer::Acknowledge(acknowledgement)) => {
                let seconds = acknowledgement.motion_to_photon as f64 * 1e-9;
                let seconds = seconds.min(LONGEST_HORIZON.as_secs_f64());
                let latency = stream.latency.get_or_insert(seconds);
                *latency += (seconds - *latency) * LATENCY_WEIGHT;
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
            view: None,
            started: None,
            in_the_making: false,
            new_client: true,
            reset: true,
            latency: None,
            period: self.config.frame_period.as_secs_f64(),
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
