//! `shadecast serve`: the network on one thread, frames on another.

mod network;
mod stats;

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError},
    time::{Duration, Instant},
};

use anyhow::Context;
use glam::Vec3;
use shadecast_protocol::{Codec, ServerTime, Sky, ToClient, Welcome};
use shadecast_server::{
    Gpu, GpuScene, Input, Integrator, Output, Pipeline, Session, SessionConfig,
    encode::OpenH264,
    patches::{self, PatchLimits},
    scene::{self, Scene},
    still::StillPass,
    tone_map,
};

use crate::{cli::ServeArguments, status::Status};
use network::{Connection, Event, Network};
use stats::Stats;

/// Pixels per radian for which triangles are subdivided at load: a headset of
/// today has about 1200 of them.
const PIXELS_PER_RADIAN: f32 = 1200.0;
/// The same for a small atlas: half of what a software renderer's eyes have,
/// because twice the triangles cost it more than a blurred floor at one's feet.
const SMALL_PIXELS_PER_RADIAN: f32 = 88.0;
/// Triangles that a software renderer may be given by subdivision whatever the scene had.
const FEW_TRIANGLES: usize = 40_000;
/// Clients that may be connected without having proved that they may.
const MOST_STRANGERS: usize = 8;

pub(crate) fn serve(arguments: &ServeArguments) -> anyhow::Result<()> {
    // The port first: nobody wants to wait for a tree and then hear it is taken.
    let network = Network::start(arguments.listen, arguments.identity.as_deref())?;
    let status = Status::new();

    status.say("loading the scene");
    let scene = crate::load(&arguments.scene)?;
    for warning in &scene.notes.warnings {
        status.print(&format!("note: {warning}"));
    }
    let gpu = Gpu::open()?;
    let side = arguments
        .atlas
        .unwrap_or(if gpu.is_software { 512 } else { 2048 });
    let light_ms = arguments
        .light_ms
        .unwrap_or(if gpu.is_software { 140.0 } else { 15.0 });
    let superblock = arguments.superblock.unwrap_or_else(|| superblock_of(side));
    anyhow::ensure!(
        side.is_multiple_of(superblock),
        "an atlas of {side} texels a side cannot be cut into superblocks of {superblock}"
    );
    let density = if side <= 1024 {
        SMALL_PIXELS_PER_RADIAN
    } else {
        PIXELS_PER_RADIAN
    };
    let mut limits = PatchLimits::for_method(arguments.method, superblock, density);
    if gpu.is_software {
        // Sharp walls at one's nose are not worth drawing many times the scene.
        limits.most_triangles = FEW_TRIANGLES.max(scene.triangles.len() * 2);
    }
    let patched = patches::cut_for(arguments.method, scene, limits);
    status.print(&patched.report.to_string());
    let spawn = patched.scene.place_to_stand();

    let bar = status.progress("building the BVH");
    let gpu_scene = GpuScene::new(
        &gpu,
        &patched.scene,
        Integrator::with_bounces(arguments.bounces),
        &mut |share| bar(share),
    )?;
    if gpu_scene.texture_halvings > 0 {
        status.print(&format!(
            "note: images were halved {} times to fit the GPU",
            gpu_scene.texture_halvings
        ));
    }
    let eye = patched.scene.first_eye();
    status.say("compiling kernels and measuring the exposure");
    let exposure = match arguments.exposure {
        Some(exposure) => exposure as f32,
        None => StillPass::new(&gpu, &gpu_scene)?.automatic_exposure(&gpu, &gpu_scene, eye)?,
    };
    let sky = sky_picture(&patched.scene, exposure);
    let mut stats = Stats::new(arguments, &gpu.adapter, &patched, exposure);
    let encoder = OpenH264::new((arguments.bitrate * 1e6) as u32, arguments.rate as f32)?;
    let mut pipeline = Pipeline::new(
        gpu,
        gpu_scene,
        patched,
        [side, side],
        superblock,
        Box::new(encoder),
        exposure,
    )
    .context("cannot serve the scene")?;

    let config = SessionConfig {
        secret: network.line.secret,
        welcome: Welcome {
            codec: Codec::H264,
            method: arguments.method,
            atlas_size: [side, side],
            superblock,
            world_from_play: spawn,
            sky,
        },
        frame_period: Duration::from_secs_f64(1.0 / arguments.rate),
        light_budget: Duration::from_secs_f64(light_ms * 1e-3),
        head_samples: arguments.head_samples,
    };
    status.print("ready; start a client with:");
    println!("{}", network.line);

    let result = Server {
        config,
        network: &network,
        stats: &mut stats,
        status: &status,
        strangers: Vec::new(),
        client: None,
        speed: None,
    }
    .run(&mut pipeline, &network.events, arguments.once);
    status.clear();
    if let Some(path) = &arguments.stats {
        stats.write(path)?;
    }
    network.stop();
    result
}

struct Client {
    session: Session,
    connection: Connection,
}

struct Server<'a> {
    config: SessionConfig,
    network: &'a Network,
    stats: &'a mut Stats,
    status: &'a Status,
    strangers: Vec<Client>,
    client: Option<Client>,
    speed: Option<f64>,
}

impl Server<'_> {
    fn run(
        mut self,
        pipeline: &mut Pipeline,
        events: &Receiver<Event>,
        once: bool,
    ) -> anyhow::Result<()> {
        let epoch = Instant::now();
        loop {
            match events.recv_timeout(Duration::from_millis(2)) {
                Ok(Event::Stop) => return Ok(()),
                Ok(event) => {
                    let gone = self.handle(event);
                    if gone && once {
                        return Ok(());
                    }
                    continue;
                }
                Err(RecvTimeoutError::Disconnected) => anyhow::bail!("the network thread ended"),
                Err(RecvTimeoutError::Timeout) => {}
            }
            let now = self.network.now();
            for stranger in &mut self.strangers {
                // Only to notice those who never say hello.
                let _ = stranger.session.order_frame(now, 0);
            }
            self.flush();
            let Some(client) = &mut self.client else {
                continue;
            };
            let Some(order) = client
                .session
                .order_frame(now, client.connection.pictures_in_flight())
            else {
                continue;
            };
            match pipeline.frame(&order, &|| epoch.elapsed()) {
                Ok(mut frame) => {
                    frame.update.timing.finished = self.network.now();
                    self.stats.add(&frame);
                    client
                        .session
                        .handle_input(Input::FrameMade(Box::new(frame)));
                    self.speed = client.session.speed();
                    self.stats.sent(client.connection.sent_bytes());
                    self.status.live(|| {
                        self.stats
                            .line(client.session.latency(), &client.session.hands())
                    });
                }
                Err(error) => {
                    self.stats.failures += 1;
                    anyhow::ensure!(self.stats.failures < 10, "frames keep failing: {error}");
                    self.status.print(&format!("a frame failed: {error}"));
                    client.session.handle_input(Input::FrameFailed);
                }
            }
            self.flush();
        }
    }

    /// Returns true when the client that was streamed to has gone.
    fn handle(&mut self, event: Event) -> bool {
        match event {
            Event::Connected(connection) => {
                if self.strangers.len() >= MOST_STRANGERS {
                    self.strangers
                        .remove(0)
                        .connection
                        .close("too many clients");
                }
                let session = Session::new(self.config.clone(), self.network.now(), self.speed);
                self.strangers.push(Client {
                    session,
                    connection,
                });
            }
            Event::Message {
                id,
                received,
                message,
            } => {
                let clients = self.strangers.iter_mut().chain(&mut self.client);
                if let Some(client) = clients.into_iter().find(|c| c.connection.id == id) {
                    let before = client.session.hands();
                    client
                        .session
                        .handle_input(Input::Message { received, message });
                    for line in self.stats.pressed(&before, &client.session.hands()) {
                        self.status.print(&line);
                    }
                }
                self.flush();
                return self.admit();
            }
            Event::Gone { id, reason } => {
                self.strangers
                    .retain(|stranger| stranger.connection.id != id);
                if self
                    .client
                    .as_ref()
                    .is_some_and(|client| client.connection.id == id)
                {
                    self.status.print(&format!("the client has gone: {reason}"));
                    self.client = None;
                    return true;
                }
            }
            Event::Stop => {}
        }
        false
    }

    /// A stranger that proved itself takes the place of the client: a headset
    /// that comes back need not wait for its own ghost to time out.
    fn admit(&mut self) -> bool {
        let Some(index) = self.strangers.iter().position(|s| s.session.is_streaming()) else {
            return false;
        };
        let client = self.strangers.remove(index);
        self.status
            .print(&format!("streaming to {}", client.connection.address));
        if let Some(old) = self.client.replace(client) {
            old.connection.send(ToClient::Bye);
            old.connection.close("another client took its place");
        }
        false
    }

    fn flush(&mut self) {
        for client in self.strangers.iter_mut().chain(&mut self.client) {
            while let Some(output) = client.session.poll_output() {
                match output {
                    Output::Send(message) => client.connection.send(message),
                    Output::Close(reason) => client.connection.close(&reason),
                }
            }
        }
    }
}

/// The largest side that is at most an eighth of the atlas's and divides it.
fn superblock_of(atlas_side: u16) -> u16 {
    1 << (atlas_side / 8).ilog2().min(atlas_side.trailing_zeros())
}

/// The sky as the client draws it behind everything.
fn sky_picture(scene: &Scene, exposure: f32) -> Sky {
    /// Enough for a gradient.
    const SIZE: (u16, u16) = (32, 64);
    let sky: scene::SkyModel = scene.sky;
    let mut rgb = Vec::with_capacity(usize::from(SIZE.0) * usize::from(SIZE.1) * 3);
    for row in 0..SIZE.1 {
        let elevation = (0.5 - (f32::from(row) + 0.5) / f32::from(SIZE.1)) * std::f32::consts::PI;
        for column in 0..SIZE.0 {
            let turn =
                ((f32::from(column) + 0.5) / f32::from(SIZE.0) - 0.5) * std::f32::consts::TAU;
            let direction = Vec3::new(
                turn.sin() * elevation.cos(),
                elevation.sin(),
                -turn.cos() * elevation.cos(),
            );
            rgb.extend(tone_map(sky.radiance(direction), exposure));
        }
    }
    Sky {
        width: SIZE.0,
        height: SIZE.1,
        rgb,
    }
}

impl Network {
    fn now(&self) -> ServerTime {
        ServerTime(self.started.elapsed().as_nanos() as u64)
    }
}
