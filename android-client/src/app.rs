//! The activity's life, and the loop that draws.
//!
//! Of what Android tells an activity little matters here: the headset's runtime
//! says when to draw and owns what is drawn into, and the window is not ours. So the
//! headset is opened when the activity is first resumed, the server is left while it
//! is paused, and everything ends when it is destroyed or the user leaves.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use android_activity::{AndroidApp, MainEvent, PollEvent};
use anyhow::{Context, Result, ensure};
use shadecast_client::PlatformDecoder;
use shadecast_client::network::Event;
use shadecast_client::openxr::api::AndroidPlatformInfo;
use shadecast_client::openxr::{self, HeadsetClient, HeadsetConfig, Turn};
use shadecast_client::render::Renderer;
use shadecast_client::render::vulkan::{Extras, VulkanGpu};
use shadecast_protocol::ClientTime;

use crate::codec::Codec;
use crate::images::{EXTENSIONS, Images};
use crate::settings;

/// Largest atlas that decoders of headsets are known to take, texels a side.
const MAX_ATLAS_SIDE: u16 = 4096;

/// How often the server's line is looked for while there is none: whoever pushes
/// the file sees the scene at once.
const LOOK_AGAIN: Duration = Duration::from_secs(1);

type AndroidClient = HeadsetClient<AndroidPlatformInfo>;

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
    // Whether decoded pictures go through memory, because the GPU cannot reach them.
    let in_memory = Arc::<AtomicBool>::default();
    let mut client = open_headset(app, Arc::clone(&in_memory))?;
    if let Some(headset) = client.headset().description() {
        tracing::info!("headset: {headset}");
    }
    let mut look_at = client.clock().now();
    let mut pause = Duration::ZERO;
    loop {
        activity.hear(app, Some(pause));
        if activity.is_destroyed {
            return Ok(());
        }
        let now = client.clock().now();
        if client.network().is_none() && now >= look_at {
            look_at = ClientTime(now.0 + LOOK_AGAIN.as_nanos() as u64);
            reach_server(app, &mut client, &in_memory)?;
        }
        client.set_paused(activity.is_paused);
        pause = match client.turn(&mut hear)? {
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
    is_paused: bool,
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
                    self.is_paused = false;
                }
                MainEvent::Pause => {
                    tracing::info!("paused");
                    self.is_paused = true;
                }
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

fn open_headset(app: &AndroidApp, in_memory: Arc<AtomicBool>) -> Result<AndroidClient> {
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
            let reached = reach_pictures(vulkan, renderer);
            in_memory.store(reached.is_err(), Relaxed);
            if let Err(error) = reached {
                tracing::warn!("decoded pictures go through memory: {error:#}");
            }
        })),
        ..HeadsetConfig::default()
    };
    HeadsetClient::open(loader, platform, config).context("there is no headset to draw for")
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

/// Starts the session with the server when there is a line to start it with.
fn reach_server(
    app: &AndroidApp,
    client: &mut AndroidClient,
    in_memory: &Arc<AtomicBool>,
) -> Result<()> {
    let line = match settings::find(app) {
        Ok(line) => line,
        Err(error) => {
            client.say(Some(error.to_string()));
            return Ok(());
        }
    };
    tracing::info!("server {}", line.address);
    client.say(None);
    let in_memory = Arc::clone(in_memory);
    let decoder = PlatformDecoder::new(move |size| Codec::open(size, in_memory.load(Relaxed)));
    Ok(client.connect(line, decoder, MAX_ATLAS_SIDE)?)
}

/// Leaves a trace of what the session has to say.
fn hear(event: &Event) {
    match event {
        Event::Welcomed(welcome) => {
            let [width, height] = welcome.atlas_size;
            tracing::info!("welcomed: an atlas of {width}x{height} texels");
        }
        Event::Status(status) => tracing::info!("{status:?}"),
        Event::Failed(failure) => tracing::error!("the session is over: {failure}"),
    }
}
