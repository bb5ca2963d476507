//! The activity's life, and the loop that draws.
//!
//! Of what Android tells an activity little matters here: the headset's runtime
//! says when to draw and owns what is drawn into, the session with the server
//! finds its way back by itself after a sleep, and the window is not ours. So the
//! headset is opened when the activity is first resumed, and everything ends when
//! it is destroyed or the user leaves.

use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

use android_activity::{AndroidApp, MainEvent, PollEvent};
use anyhow::{Context, Result, ensure};
use shadecast_client::network::{Event, Network};
use shadecast_client::openxr::api::AndroidPlatformInfo;
use shadecast_client::openxr::{self, Headset, HeadsetConfig, Turn};
use shadecast_client::render::vulkan::{Extras, VulkanGpu};
use shadecast_client::render::{FrameReceiver, FrameSender, Renderer, frame_channel};
use shadecast_client::{Clock, PlatformDecoder};
use shadecast_protocol::ClientTime;

use crate::codec::Codec;
use crate::images::{EXTENSIONS, Images};
use crate::settings;

/// Largest atlas that decoders of headsets are known to take, texels a side.
const MAX_ATLAS_SIDE: u16 = 4096;

/// How often the server's line is looked for while there is none: whoever pushes
/// the file sees the scene at once.
const LOOK_AGAIN: Duration = Duration::from_secs(1);

type AndroidHeadset = Headset<AndroidPlatformInfo>;

/// Runs until the user leaves or the activity is destroyed.
///
/// # Errors
/// When there is no headset to draw for, or none any more.
pub(crate) fn run(app: &AndroidApp) -> Result<()> {
    let mut activity = Activity::default();
    while !activity.was_resumed {
        activity.hear(app, None);
        if activity.is_destroyed {
            return Ok(());
        }
    }
    let clock = Clock::start();
    let (sender, frames) = frame_channel();
    // What the user in the headset is to be told of decoder and GPU.
    let (complain, complaints) = channel();
    let mut headset = open_headset(app, frames, complain.clone())?;
    if let (Some([width, height]), Some(offers)) = (headset.eye_size(), headset.offers()) {
        tracing::info!("headset: {width}x{height} pixels an eye, {offers:?}");
    }
    let mut server = Server {
        frames: Some(sender),
        network: None,
        look_at: ClientTime(0),
        complain,
    };
    let mut pause = Duration::ZERO;
    loop {
        activity.hear(app, Some(pause));
        if activity.is_destroyed {
            return Ok(());
        }
        server.reach(app, clock, &mut headset);
        server.hear(&mut headset);
        for complaint in complaints.try_iter() {
            tracing::error!("{complaint}");
            headset.say(Some(complaint));
        }
        let network = server.network.as_ref();
        let turn = headset.turn(&|| clock.now(), &mut |input| {
            if let Some(network) = network {
                network.tell(input);
            }
        });
        pause = match turn.context("the headset cannot be used")? {
            Turn::Frame(_) => Duration::ZERO,
            Turn::Idle | Turn::Lost => openxr::IDLE,
            Turn::Exit => return Ok(()),
        };
    }
}

/// What Android has told.
#[derive(Debug, Default)]
struct Activity {
    was_resumed: bool,
    is_destroyed: bool,
}

impl Activity {
    /// Takes what there is, and waits for something until `timeout`.
    fn hear(&mut self, app: &AndroidApp, timeout: Option<Duration>) {
        app.poll_events(timeout, |event| {
            let PollEvent::Main(event) = event else {
                return;
            };
            match event {
                MainEvent::Resume { .. } => {
                    tracing::info!("resumed");
                    self.was_resumed = true;
                }
                MainEvent::Pause => tracing::info!("paused"),
                MainEvent::InitWindow { .. } => tracing::info!("a window is there"),
                MainEvent::TerminateWindow { .. } => tracing::info!("the window is gone"),
                MainEvent::LowMemory => tracing::warn!("the device is short of memory"),
                MainEvent::Destroy => {
                    tracing::info!("destroyed");
                    self.is_destroyed = true;
                }
                _ => {}
            }
        });
    }
}

fn open_headset(
    app: &AndroidApp,
    frames: FrameReceiver,
    complain: Sender<String>,
) -> Result<AndroidHeadset> {
    // SAFETY: machine and activity are valid as long as `app`, which outlives the
    // headset.
    let platform = unsafe { AndroidPlatformInfo::new(app.vm_as_ptr(), app.activity_as_ptr()) };
    let loader = openxr::load_for(&platform).context(
        "libopenxr_loader.so is missing or does not work: docs/headset.md says how an APK gets it",
    )?;
    let config = HeadsetConfig {
        extras: Extras {
            extensions: EXTENSIONS.into(),
            ycbcr: true,
        },
        on_device: Some(Box::new(move |vulkan, renderer| {
            if let Err(error) = reach_pictures(vulkan, renderer) {
                // The receiver lives as long as the headset.
                let _ = complain.send(format!("No picture can be shown: {error:#}"));
            }
        })),
        ..HeadsetConfig::default()
    };
    Headset::open(loader, platform, config, frames).context("there is no headset to draw for")
}

/// Lets the renderer take pictures of the decoder.
fn reach_pictures(vulkan: &VulkanGpu, renderer: &mut Renderer) -> Result<()> {
    for name in EXTENSIONS {
        let (has, name) = (vulkan.extensions.contains(&name), name.to_string_lossy());
        ensure!(has, "the GPU driver lacks {name}");
    }
    ensure!(vulkan.ycbcr, "the GPU driver does not sample YCbCr");
    let images = Images::new(&vulkan.gpu.device)?;
    Ok(renderer.set_image_source(Box::new(images))?)
}

/// The session with the server, as soon as it is known which.
struct Server {
    /// None once the session has it.
    frames: Option<FrameSender>,
    network: Option<Network>,
    /// When the line is looked for again.
    look_at: ClientTime,
    complain: Sender<String>,
}

impl Server {
    /// Starts the session when there is a line to start it with.
    fn reach(&mut self, app: &AndroidApp, clock: Clock, headset: &mut AndroidHeadset) {
        let now = clock.now();
        if self.frames.is_none() || now < self.look_at {
            return;
        }
        self.look_at = ClientTime(now.0 + LOOK_AGAIN.as_nanos() as u64);
        let line = match settings::find(app) {
            Ok(line) => line,
            Err(error) => return headset.say(Some(error.to_string())),
        };
        let Some(frames) = self.frames.take() else {
            return;
        };
        tracing::info!("server {}", line.address);
        headset.say(None);
        let complain = self.complain.clone();
        let decoder = PlatformDecoder::new(move |size| {
            Codec::open(size).inspect_err(|error| {
                // Nobody listens only while everything ends.
                let _ = complain.send(error.to_string());
            })
        });
        self.network = Network::start(line, MAX_ATLAS_SIDE, clock, decoder, frames)
            .inspect_err(|error| headset.say(Some(format!("No network: {error}"))))
            .ok();
    }

    /// Passes on what the session has to say.
    fn hear(&mut self, headset: &mut AndroidHeadset) {
        for event in self.network.iter().flat_map(|one| one.events.try_iter()) {
            match event {
                Event::Welcomed(welcome) => {
                    let [width, height] = welcome.atlas_size;
                    tracing::info!("welcomed: an atlas of {width}x{height} texels");
                    headset.welcome(&welcome);
                }
                Event::Status(status) => {
                    tracing::info!("{status:?}");
                    headset.take_status(&status);
                }
                Event::Failed(failure) => {
                    tracing::error!("the session is over: {failure}");
                    headset.say(Some(failure.to_string()));
                }
            }
        }
    }
}
