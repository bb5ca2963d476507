//! A server and a client that talk over two links, a millisecond at a time.

use std::{sync::Arc, time::Duration};

use anyhow::bail;
use glam::{Quat, Vec3};
use shadecast_client::{
    ClientFrame, Decoder, Drawn, HeadView, OpenH264Decoder, Session as Client,
    SessionConfig as ClientConfig,
};
use shadecast_protocol::{
    ClientTime, ClockReply, Codec, EyeView, Fov, FrameId, Method, Motion, Pose, Secret, ServerTime,
    Sky, ToClient, ToServer, ViewReport, Welcome,
};
use shadecast_server::{
    Frame, Gpu, GpuScene, Integrator, Pipeline, Session as Server, SessionConfig as ServerConfig,
    encode::OpenH264,
    patches::{self, PatchLimits},
    scene::Scene,
};

use crate::{Link, Order};

/// Grain of the virtual time.
const STEP: Duration = Duration::from_millis(1);
/// Between two samples of the head: a display of 100 Hz.
const VIEW_PERIOD: Duration = Duration::from_millis(10);
/// How long the server makes a frame, in virtual time.
pub const MAKING: Duration = Duration::from_millis(20);
/// Of every message.
pub const DELAY: Duration = Duration::from_millis(4);
/// Longer than a frame, so that pictures overtake each other.
pub const JITTER: Duration = Duration::from_millis(40);
/// What the client's clock shows when the server's shows zero.
const CLIENT_AHEAD: Duration = Duration::from_secs(3);
/// Of every frame: the same work, however fast the machine is.
const PATHS: u32 = 4096;
/// Width and height of the atlas, texels.
pub const ATLAS_SIZE: [u16; 2] = [256; 2];
/// Side of a superblock, texels.
const SUPERBLOCK: u16 = 32;
/// Pixels of an eye's picture, each way.
const EYE_SIDE: u16 = 160;
/// Height of a standing person's eyes, metres.
const EYE_HEIGHT: f32 = 1.6;
const SECRET: Secret = Secret([0x5c; 16]);

/// Both ends and all that is between them.
pub struct Loopback {
    now: Duration,
    spawn: Pose,
    pipeline: Pipeline,
    config: ServerConfig,
    server: Option<Server>,
    making: Option<(Duration, Box<Frame>)>,
    client: Client,
    decoder: OpenH264Decoder,
    upstream: Link,
    downstream: Link,
    /// When the pictures that are in flight will be there.
    pictures_arrive: Vec<Duration>,
    lost: Option<FrameId>,
    sent: Vec<Vec<u8>>,
    presented: Vec<Arc<ClientFrame>>,
    welcome: Option<Welcome>,
    reported: Option<ViewReport>,
}

impl Loopback {
    /// A server of `scene` and a client that has not connected yet; `seed` is
    /// the network's.
    ///
    /// # Errors
    /// When there is no GPU or the scene does not fit it.
    pub fn new(scene: Scene, seed: u64) -> anyhow::Result<Self> {
        Self::by(Method::Sas, scene, seed)
    }

    /// The same by another method.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn by(method: Method, scene: Scene, seed: u64) -> anyhow::Result<Self> {
        let limits = PatchLimits::for_method(method, SUPERBLOCK, 165.0);
        let patched = patches::cut_for(method, scene, limits);
        let spawn = patched.scene.spawn.unwrap_or(Pose::IDENTITY);
        let gpu = Gpu::open()?;
        let gpu_scene = GpuScene::new(
            &gpu,
            &patched.scene,
            Integrator::with_bounces(1),
            &mut |_| (),
        )?;
        let encoder = OpenH264::new(4_000_000, 30.0)?;
        let pipeline = Pipeline::new(
            gpu,
            gpu_scene,
            patched,
            ATLAS_SIZE,
            SUPERBLOCK,
            Box::new(encoder),
            0.5,
        )?;
        let config = ServerConfig {
            secret: SECRET,
            welcome: Welcome {
                codec: Codec::H264,
                method,
                atlas_size: ATLAS_SIZE,
                superblock: SUPERBLOCK,
                world_from_play: spawn,
                sky: Sky {
                    width: 1,
                    height: 1,
                    rgb: vec![128; 3],
                },
            },
            frame_period: Duration::from_millis(33),
            light_budget: Duration::from_millis(10),
            head_samples: 2,
        };
        let link = |seed| Link::new(seed, DELAY, JITTER);
        Ok(Self {
            now: Duration::ZERO,
            spawn,
            pipeline,
            config,
            server: None,
            making: None,
            client: Client::new(ClientConfig {
                secret: SECRET,
                max_atlas_side: 4096,
            }),
            decoder: OpenH264Decoder::new(),
            upstream: link(seed),
            downstream: link(!seed),
            pictures_arrive: Vec::new(),
            lost: None,
            sent: Vec::new(),
            presented: Vec::new(),
            welcome: None,
            reported: None,
        })
    }

    /// The server makes a frame this often; before the client connects.
    pub fn set_frame_period(&mut self, period: Duration) {
        self.config.frame_period = period;
    }

    /// The network will lose the picture of `frame`.
    pub fn lose_picture(&mut self, frame: FrameId) {
        self.lost = Some(frame);
    }

    /// Lets virtual time pass until the client has presented `frames` frames.
    ///
    /// # Errors
    /// When an end fails, closes the connection, or sends what the other end
    /// does not understand, and after ten virtual seconds.
    pub fn run_until_presented(&mut self, frames: usize) -> anyhow::Result<()> {
        while self.presented.len() < frames {
            if self.now > Duration::from_secs(10) {
                bail!("only {} frames after 10 s", self.presented.len());
            }
            self.step()?;
            if (self.now.as_nanos()).is_multiple_of(VIEW_PERIOD.as_nanos()) {
                let view = self.view();
                self.tell(shadecast_client::Input::View(view))?;
            }
        }
        Ok(())
    }

    /// Lets virtual time pass until `now`, with a client that has its own head.
    ///
    /// # Errors
    /// As [`run_until_presented`](Self::run_until_presented).
    pub fn run_until(&mut self, now: Duration) -> anyhow::Result<()> {
        while self.now < now {
            self.step()?;
        }
        Ok(())
    }

    fn step(&mut self) -> anyhow::Result<()> {
        self.now += STEP;
        self.step_server()?;
        while let Some(bytes) = self.downstream.receive(self.now) {
            self.tell(shadecast_client::Input::Message(ToClient::decode(&bytes)?))?;
        }
        self.tell(shadecast_client::Input::Tick)
    }

    /// What the client shows on its clock when `elapsed` has passed.
    #[must_use]
    pub fn client_clock(elapsed: Duration) -> ClientTime {
        ClientTime((elapsed + CLIENT_AHEAD).as_nanos() as u64)
    }

    /// What the client was welcomed with, once.
    pub fn take_welcome(&mut self) -> Option<Welcome> {
        self.welcome.take()
    }

    /// What has come for the display since the last time; it is not in
    /// [`presented`](Self::presented) any more, nor what was sent in
    /// [`sent`](Self::sent).
    pub fn take_presented(&mut self) -> Vec<Arc<ClientFrame>> {
        self.sent.clear();
        std::mem::take(&mut self.presented)
    }

    /// The newest view that the server has.
    #[must_use]
    pub fn reported(&self) -> Option<&ViewReport> {
        self.reported.as_ref()
    }

    /// Every message that the server has sent, as bytes; with the lost one.
    #[must_use]
    pub fn sent(&self) -> &[Vec<u8>] {
        &self.sent
    }

    /// What the client has drawn, in order.
    #[must_use]
    pub fn presented(&self) -> &[Arc<ClientFrame>] {
        &self.presented
    }

    /// How far the client's estimate of the server's clock is off; none before
    /// it has one.
    #[must_use]
    pub fn clock_error(&self) -> Option<Duration> {
        let estimate = self.client.client_minus_server()?;
        let ahead = CLIENT_AHEAD.as_nanos() as i64;
        Some(Duration::from_nanos(estimate.abs_diff(ahead)))
    }

    /// The server's estimate of the time from a pose to its light.
    #[must_use]
    pub fn latency(&self) -> Option<Duration> {
        self.server.as_ref()?.latency()
    }

    fn server_time(&self) -> ServerTime {
        ServerTime(self.now.as_nanos() as u64)
    }

    fn client_time(&self) -> ClientTime {
        Self::client_clock(self.now)
    }

    fn step_server(&mut self) -> anyhow::Result<()> {
        use shadecast_server::{Input, Output};

        let now = self.server_time();
        let Some(mut server) = self.server.take() else {
            return Ok(());
        };
        while let Some(bytes) = self.upstream.receive(self.now) {
            let message = ToServer::decode(&bytes)?;
            if let ToServer::View(view) = &message {
                self.reported = Some(*view);
                let reply = ClockReply {
                    client_sent: view.sampled_at,
                    server_received: now,
                    server_sent: now,
                };
                self.send_to_client(ToClient::Clock(reply))?;
            }
            server.handle_input(Input::Message {
                received: now,
                message,
            });
        }
        if let Some((_, mut frame)) = self.making.take_if(|(done, _)| *done <= self.now) {
            frame.update.timing.finished = now;
            server.handle_input(Input::FrameMade(frame));
        }
        self.pictures_arrive.retain(|arrival| *arrival > self.now);
        if let Some(mut order) = server.order_frame(now, self.pictures_arrive.len()) {
            order.paths = PATHS;
            // A clock that stands still: the frame depends on no machine's speed.
            let frame = self.pipeline.frame(&order, &|| Duration::ZERO)?;
            self.making = Some((self.now + MAKING, Box::new(frame)));
        }
        while let Some(output) = server.poll_output() {
            match output {
                Output::Send(message) => self.send_to_client(message)?,
                Output::Close(reason) => bail!("the server closed: {reason}"),
            }
        }
        self.server = Some(server);
        Ok(())
    }

    fn send_to_client(&mut self, message: ToClient) -> anyhow::Result<()> {
        let bytes = message.encode()?;
        let order = match &message {
            ToClient::Clock(_) | ToClient::Picture(_) => Order::Free,
            _ => Order::InOrder,
        };
        self.sent.push(bytes.clone());
        let picture = match message {
            ToClient::Picture(picture) => Some(picture.frame),
            _ => None,
        };
        if picture.is_some() && picture == self.lost {
            return Ok(());
        }
        let arrival = self.downstream.send(self.now, order, bytes);
        if picture.is_some() {
            self.pictures_arrive.push(arrival);
        }
        Ok(())
    }

    /// Tells the client what happened, and does what it wants done.
    ///
    /// # Errors
    /// When the client fails or hangs up.
    pub fn tell(&mut self, input: shadecast_client::Input) -> anyhow::Result<()> {
        use shadecast_client::{Input, Output};

        let now = self.client_time();
        let mut inputs = vec![input];
        while let Some(input) = inputs.pop() {
            self.client.handle_input(now, input);
            while let Some(output) = self.client.poll_output() {
                match output {
                    Output::Connect => {
                        let config = self.config.clone();
                        self.server = Some(Server::new(config, self.server_time(), None));
                        inputs.push(Input::Connected);
                    }
                    Output::Send(message) => {
                        let order = match message {
                            ToServer::View(_) => Order::Free,
                            _ => Order::InOrder,
                        };
                        self.upstream.send(self.now, order, message.encode()?);
                    }
                    Output::Decode(unit) => {
                        self.decoder.send(unit);
                        inputs.extend(self.decoder.poll().map(Input::Decoded));
                    }
                    Output::Present(frame) => {
                        inputs.push(Input::Drawn(Drawn::new(&frame, now, now)));
                        self.presented.push(frame);
                    }
                    Output::Welcomed(welcome) => self.welcome = Some(*welcome),
                    Output::Status(_) => {}
                    Output::Disconnect(reason) => bail!("the client hung up: {reason}"),
                    Output::Failed(failure) => bail!("the client failed: {failure}"),
                }
            }
        }
        Ok(())
    }

    fn view(&self) -> HeadView {
        let seconds = self.now.as_secs_f32();
        // Velocities by central differences, as a tracker would report them.
        let ends = [seconds - 0.005, seconds + 0.005].map(head_at);
        let head = Motion::along(head_at(seconds), ends, 0.01).seen_from(self.spawn);
        HeadView {
            sampled_at: self.client_time(),
            display_at: ClientTime(self.client_time().0 + VIEW_PERIOD.as_nanos() as u64),
            world_from_head: head.pose,
            linear_velocity: head.linear_velocity,
            angular_velocity: head.angular_velocity,
            eyes: [-0.032, 0.032].map(|x| EyeView {
                head_from_eye: Pose {
                    position: Vec3::X * x,
                    orientation: Quat::IDENTITY,
                },
                fov: Fov::symmetric(1.5),
            }),
            eye_resolution: [EYE_SIDE; 2],
            hands: [None; 2],
        }
    }
}

/// The scripted head in the play space: it sways and looks around.
fn head_at(seconds: f32) -> Pose {
    Pose {
        position: Vec3::new(
            0.2 * (2.0 * seconds).sin(),
            EYE_HEIGHT + 0.03 * (5.0 * seconds).sin(),
            -0.3 * seconds,
        ),
        orientation: Quat::from_rotation_y(0.6 * seconds),
    }
}
