//! The activity's life, and the loop that draws.
//!
//! In a headset little of what Android tells an activity matters: the runtime says
//! when to draw and owns what is drawn into. A phone in a viewer draws into the
//! window, which comes and goes. Either is opened when the activity is first resumed,
//! the server is left while it is paused, and everything ends when it is destroyed or
//! the user leaves.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use android_activity::input::{InputEvent, MotionAction};
use android_activity::{AndroidApp, InputStatus, MainEvent, PollEvent};
use anyhow::{Context, Result};
use ndk::native_window::NativeWindow;
use shadecast_client::openxr::api::AndroidPlatformInfo;
use shadecast_client::openxr::{self, Headset, HeadsetConfig, HeadsetError};
use shadecast_client::render::foreign::HardwareBuffers;
use shadecast_client::viewer::Viewer;
use shadecast_client::worn::{Display, HeadsetClient, IDLE, OnDevice, Turn, log};
use shadecast_client::{PlatformDecoder, settings};

use crate::codec::Codec;
use crate::images::Images;
use crate::{java, phone};

/// Largest atlas that decoders of headsets are known to take, texels a side.
const MAX_ATLAS_SIDE: u16 = 4096;

/// Runs until the user leaves or the activity is destroyed.
///
/// # Errors
/// When there is nothing to draw for, or nothing any more.
pub(crate) fn run(app: &AndroidApp) -> Result<()> {
    let mut activity = Activity::default();
    while !activity.was_resumed {
        activity.hear(app, None, &mut |_| Ok(()))?;
        if activity.is_destroyed {
            return Ok(());
        }
    }
    // Whether decoded pictures go through memory, because the GPU cannot reach them.
    let in_memory = Arc::<AtomicBool>::default();
    let absence = match open_headset(app, &in_memory) {
        Ok(client) => {
            if let Some(headset) = client.display().description() {
                tracing::info!("headset: {headset}");
            }
            return drive(app, activity, client, &in_memory, |_, _| Ok(()));
        }
        Err(error) if error.is_absence() => error,
        Err(error) => return Err(error).context("there is no headset to draw for"),
    };
    tracing::warn!("drawing for a phone in a viewer, since {absence}");
    let client = HeadsetClient::open(|frames| phone::open(app, on_device(&in_memory), frames))
        .context("there is no viewer to draw for either")?;
    let on_screen = |viewer: &mut Viewer, event| match event {
        ScreenEvent::Window(window) => phone::show(viewer, window),
        // A viewer's one button touches the screen.
        ScreenEvent::Touch => {
            viewer.recentre();
            Ok(())
        }
    };
    drive(app, activity, client, &in_memory, on_screen)
}

/// What becomes of the screen, which a headset's client does not need.
enum ScreenEvent {
    /// There is a window to draw into; without one, it goes away now.
    Window(Option<NativeWindow>),
    /// Somebody touched it.
    Touch,
}

/// Draws, and looks for a server where there is none.
fn drive<D: Display>(
    app: &AndroidApp,
    mut activity: Activity,
    mut client: HeadsetClient<D>,
    in_memory: &Arc<AtomicBool>,
    mut on_screen: impl FnMut(&mut D, ScreenEvent) -> Result<()>,
) -> Result<()> {
    let mut pause = Duration::ZERO;
    loop {
        let display = client.display_mut();
        activity.hear(app, Some(pause), &mut |event| on_screen(display, event))?;
        if activity.is_destroyed {
            return Ok(());
        }
        let [shared, own] = [app.external_data_path(), app.internal_data_path()];
        let in_memory = Arc::clone(in_memory);
        client.seek(
            || settings::find(java::server_of_intent(app), shared, own),
            || PlatformDecoder::new(move |size| Codec::open(size, in_memory.load(Relaxed))),
            MAX_ATLAS_SIDE,
        )?;
        client.set_paused(activity.is_paused);
        pause = match client.turn(&mut log)? {
            Turn::Frame(_) => Duration::ZERO,
            Turn::Idle | Turn::Lost => IDLE,
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
    fn hear(
        &mut self,
        app: &AndroidApp,
        timeout: Option<Duration>,
        on_screen: &mut dyn FnMut(ScreenEvent) -> Result<()>,
    ) -> Result<()> {
        let mut outcome = Ok(());
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
                MainEvent::InitWindow { .. } | MainEvent::WindowResized { .. } => {
                    tracing::info!("a window is there");
                    outcome = on_screen(ScreenEvent::Window(app.native_window()));
                }
                MainEvent::TerminateWindow { .. } => {
                    tracing::info!("the window is gone");
                    outcome = on_screen(ScreenEvent::Window(None));
                }
                MainEvent::LowMemory => tracing::warn!("the device is short of memory"),
                MainEvent::Destroy => {
                    tracing::info!("destroyed");
                    self.is_destroyed = true;
                }
                _ => {}
            }
        });
        outcome?;
        // What is not taken stays with Android, which leaves by its own button.
        let Ok(mut events) = app.input_events_iter() else {
            return Ok(());
        };
        let mut touched = false;
        while events.next(|event| match event {
            InputEvent::MotionEvent(motion) if motion.action() == MotionAction::Down => {
                touched = true;
                InputStatus::Handled
            }
            _ => InputStatus::Unhandled,
        }) {}
        if touched {
            on_screen(ScreenEvent::Touch)
        } else {
            Ok(())
        }
    }
}

fn open_headset(
    app: &AndroidApp,
    in_memory: &Arc<AtomicBool>,
) -> Result<HeadsetClient<Headset<AndroidPlatformInfo>>, HeadsetError> {
    // SAFETY: machine and activity are valid as long as `app`, which outlives the
    // headset.
    let platform = unsafe { AndroidPlatformInfo::new(app.vm_as_ptr(), app.activity_as_ptr()) };
    let loader = openxr::load_for(&platform)?;
    let config = HeadsetConfig {
        extras: HardwareBuffers::extras(),
        on_device: Some(on_device(in_memory)),
        ..HeadsetConfig::default()
    };
    HeadsetClient::open(|frames| Headset::open(loader, platform, config, frames))
}

/// Lets renderers take pictures of the decoder, or has them go through memory.
fn on_device(in_memory: &Arc<AtomicBool>) -> OnDevice {
    let in_memory = Arc::clone(in_memory);
    Box::new(move |vulkan, renderer| {
        let images = HardwareBuffers::new(vulkan).map(Images);
        let reached = images.and_then(|images| renderer.set_image_source(Box::new(images)));
        in_memory.store(reached.is_err(), Relaxed);
        if let Err(error) = reached {
            tracing::warn!("decoded pictures go through memory: {error}");
        }
    })
}
