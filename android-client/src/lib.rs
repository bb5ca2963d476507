//! The headset client for Android: what calls into Android, and no more.
//!
//! | file | calls |
//! |---|---|
//! | `app.rs` | the native activity's life, and the OpenXR loader |
//! | `phone.rs` | the window of a phone in a viewer, where there is no headset |
//! | `sensors.rs` | how that is turned |
//! | `java.rs` | the intent, and what the screen is like |
//! | `codec.rs` | MediaCodec and ImageReader |
//! | `images.rs` | AHardwareBuffer |
//!
//! Everything else is `shadecast-client` and is tested on the desktop: the
//! session, the frame loop, the order and pairing of pictures, their conversion.
//! For other targets this crate is empty.
#![cfg(target_os = "android")]

mod app;
mod codec;
mod images;
mod java;
mod phone;
mod sensors;

use android_activity::AndroidApp;
use tracing_subscriber::EnvFilter;

/// What android-activity calls on a thread of its own; the activity is finished
/// when it returns. It may be called again in the same process.
// SAFETY: no other library of this process exports the name.
#[unsafe(no_mangle)]
fn android_main(app: AndroidApp) {
    // Standard error goes to the log of the device, which adds times.
    let log = tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::new("info,wgpu_core=warn,wgpu_hal=warn"))
        .with_ansi(false)
        .without_time()
        .with_writer(std::io::stderr);
    // It is there already when this is called again.
    let _ = log.try_init();
    tracing::info!("shadecast {} begins", env!("CARGO_PKG_VERSION"));
    match app::run(&app) {
        Ok(()) => tracing::info!("shadecast ends"),
        Err(error) => tracing::error!("shadecast ends: {error:#}"),
    }
}
