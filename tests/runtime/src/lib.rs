//! An OpenXR runtime for tests. No display, no compositor, and no mercy.
//!
//! It makes real images on the application's own Vulkan device, moves a head
//! along a script, keeps a virtual clock or the system's, logs every frame with
//! its poses and reads chosen pictures back. Whatever the specification calls an
//! error earns its error code here and an entry in [`Log::misuse`], and faults
//! happen in the frames that the [`Script`] names.
//!
//! Used in two ways: inside of a test's process ([`Runtime::entry`]), and as a
//! shared library through the loader of the system, where the environment names
//! a script (see [`Script::from_environment`]).
//!
//! Source: OpenXR 1.0 with XR_KHR_vulkan_enable2, XR_KHR_composition_layer_depth,
//! XR_FB_display_refresh_rate, XR_KHR_convert_timespec_time, XR_EXT_local_floor.
//! It is made for one session at a time on one thread.

mod api;
mod clock;
mod images;
mod log;
mod pose;
mod script;
mod world;

use std::sync::{Arc, Mutex, MutexGuard};

pub use api::negotiate::xrNegotiateLoaderRuntimeInterface;
pub use log::{DepthPart, Image, Layer, Log, Submitted, ViewPart};
pub use openxr_sys as sys;
pub use script::{ClockKind, Controller, Eyes, Fault, Headset, Script};

use world::World;

/// A runtime in this process: the active one of the thread that made it.
#[derive(Clone)]
pub struct Runtime(Arc<Mutex<World>>);

impl Runtime {
    /// From now on instances that this thread creates are of this runtime.
    #[must_use]
    pub fn new(script: Script) -> Self {
        Self(world::install(script))
    }

    /// What a loader's library would export.
    #[must_use]
    pub fn entry(&self) -> sys::pfn::GetInstanceProcAddr {
        api::table::get_instance_proc_addr
    }

    /// What has happened so far.
    #[must_use]
    pub fn log(&self) -> Log {
        self.world().log.clone()
    }

    /// Frames that were waited for so far.
    #[must_use]
    pub fn waited(&self) -> u64 {
        self.world().log.waited
    }

    /// The time on the runtime's clock, nanoseconds.
    #[must_use]
    pub fn now(&self) -> i64 {
        self.world().clock.now()
    }

    /// Lets virtual time pass, for an application that sleeps.
    pub fn pass(&self, time: std::time::Duration) {
        self.world().clock.pass(time.as_nanos() as i64);
    }

    /// Changes what is still to come.
    pub fn rewrite(&self, change: impl FnOnce(&mut Script)) {
        change(&mut self.world().script);
    }

    fn world(&self) -> MutexGuard<'_, World> {
        world::lock(&self.0)
    }
}

/// Calls `hook` with true whenever a thread enters the runtime, and with false
/// when it leaves: what happens between is not the application's doing.
pub fn on_crossing(hook: fn(bool)) {
    world::set_hook(hook);
}
