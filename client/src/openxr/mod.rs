//! The client in a headset: the frame loop of any OpenXR runtime.
//!
//! ```text
//!  Headset::open ── loader, runtime, device, swapchain, actions
//!     │
//!  Headset::turn ── events ─ wait ─ begin ─ newest world ─ acquire ─ locate eyes
//!     │                       ─ draw ─ release ─ view report ─ end
//!     └── the session was lost: opened anew within seconds, with the same world
//! ```
//!
//! What draws is the renderer of the mock headset, without the lens pass, which
//! the runtime's compositor does. Nothing here waits for the network or the
//! decoder: worlds come through a triple buffer and reports leave through a
//! callback. The client's clock is an argument, so that a test runs a headset in
//! virtual time.
//!
//! ```no_run
//! use shadecast_client::openxr::{self, Headset, HeadsetConfig};
//! use shadecast_client::worn::{Display, IDLE, Turn};
//! use shadecast_client::{Clock, render::frame_channel};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let (_to_be_given_to_the_network, frames) = frame_channel();
//! let clock = Clock::start();
//! let mut headset = Headset::open(openxr::load()?, (), HeadsetConfig::default(), frames)?;
//! loop {
//!     let mut tell = |input| { /* to the network's thread */ };
//!     match headset.turn(&|| clock.now(), &mut tell)? {
//!         Turn::Frame(_) => {}
//!         Turn::Idle | Turn::Lost => std::thread::sleep(IDLE),
//!         Turn::Exit => return Ok(()),
//!     }
//! }
//! # }
//! ```

mod error;
mod hands;
mod headset;
mod host;
mod lifecycle;
mod moment;
mod offers;
mod session;
mod space;
mod swapchain;
mod walk;

use ::openxr as xr;

pub use error::HeadsetError;
pub use headset::{Headset, HeadsetConfig};
pub use lifecycle::{Ending, LifeCycle, Step};
pub use offers::Offers;

/// The OpenXR library that this client is written with, for its entry and its
/// platforms.
pub use ::openxr as api;

/// The loader of the system.
///
/// # Errors
/// When there is none.
pub fn load() -> Result<xr::Entry, HeadsetError> {
    load_for(&())
}

/// The loader of a platform that has to tell it something.
///
/// # Errors
/// When there is none, or it refuses.
pub fn load_for(platform: &impl xr::PlatformInfo) -> Result<xr::Entry, HeadsetError> {
    // SAFETY: the loader of the system is what it says.
    unsafe { xr::Entry::load(platform) }.map_err(|error| no_loader(&error))
}

fn no_loader(error: &xr::EntryError) -> HeadsetError {
    // The last cause is what the system says.
    let mut cause: &dyn std::error::Error = error;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    HeadsetError::NoLoader(cause.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_loader_is_named_and_how_to_get_one() {
        let nowhere = std::path::Path::new("/nowhere/libopenxr_loader.so.1");
        // SAFETY: there is no such library.
        let error = unsafe { xr::Entry::load_from(nowhere, &()) }.err();
        let said = no_loader(&error.expect("there is no such library")).to_string();
        assert!(said.contains("install libopenxr-loader1"), "{said}");
        assert!(said.contains("/nowhere"), "{said}");
    }
}
