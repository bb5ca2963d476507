//! A phone in a viewer, where there is no headset.

use android_activity::{AndroidApp, WindowManagerFlags};
use anyhow::{Context, Result};
use ndk::native_window::NativeWindow;
use shadecast_client::render::foreign::HardwareBuffers;
use shadecast_client::render::{FrameReceiver, Optics};
use shadecast_client::viewer::{Viewer, ViewerConfig, read_optics};
use shadecast_client::worn::OnDevice;

use crate::java;
use crate::sensors::Sensors;

/// As in the manifest.
const PACKAGE: &str = "org.shadecast.client";

/// The viewer, where it is not Cardboard, in the app's folder.
const FILE: &str = "viewer.json";

/// Opens the viewer for this phone.
pub(crate) fn open(app: &AndroidApp, on_device: OnDevice, frames: FrameReceiver) -> Result<Viewer> {
    let flags = WindowManagerFlags::KEEP_SCREEN_ON;
    app.set_window_flags(flags, WindowManagerFlags::empty());
    let optics = match app.external_data_path() {
        Some(folder) => read_optics(&folder.join(FILE))?,
        None => Optics::CARDBOARD,
    };
    let mut sensors = Sensors::open(PACKAGE)?;
    let config = ViewerConfig {
        optics,
        screen: java::screen(app).context("the screen is not known")?,
        antialias: true,
        extras: HardwareBuffers::extras(),
        on_device: Some(on_device),
        sensors: Box::new(move |tracker, now| sensors.read(tracker, now)),
    };
    let mut viewer = Viewer::open(config, frames)?;
    show(&mut viewer, app.native_window())?;
    Ok(viewer)
}

/// Draws into a window from now on; without one, into none.
pub(crate) fn show(viewer: &mut Viewer, window: Option<NativeWindow>) -> Result<()> {
    let Some(window) = window else {
        viewer.drop_window();
        return Ok(());
    };
    let size = [window.width(), window.height()];
    let size = size.map(|side| u32::try_from(side).unwrap_or_default());
    Ok(viewer.set_window(window, size)?)
}
