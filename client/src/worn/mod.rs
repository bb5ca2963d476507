//! What is worn before the eyes: a headset with an OpenXR runtime, or a phone in
//! a viewer.
//!
//! Both show what is [`Held`] of the world, pass a display frame a turn, and say
//! where the head is; how differs (`openxr`, `viewer`). `HeadsetClient` runs either
//! together with the thread that talks to the server.

#[cfg(feature = "network")]
mod client;
mod held;

use std::error::Error;
use std::time::Duration;

use shadecast_protocol::{ClientTime, Welcome};

use crate::render::Renderer;
use crate::render::vulkan::VulkanGpu;
use crate::{Input, Status};

#[cfg(feature = "network")]
pub use client::{ClientError, HeadsetClient, log};
pub use held::Held;

/// How long whoever runs a display sleeps after a turn that drew nothing.
pub const IDLE: Duration = Duration::from_millis(10);

/// Called with every device that is made, and with every renderer on it, before
/// anything is drawn.
pub type OnDevice = Box<dyn FnMut(&VulkanGpu, &mut Renderer)>;

/// Shows the world to two eyes that move.
pub trait Display {
    /// Why it can no longer be used.
    type Error: Error + Send + Sync + 'static;

    /// What it holds of the world.
    fn held(&self) -> &Held;

    /// As [`held`](Self::held), to give it more.
    fn held_mut(&mut self) -> &mut Held;

    /// Passes a display frame, or none while there is nobody to show one to. `now`
    /// reads the client's clock; what the server is to hear goes to `tell` at once.
    ///
    /// # Errors
    /// When the display can no longer be used; one that is merely away for a while is
    /// no error.
    fn turn(
        &mut self,
        now: &dyn Fn() -> ClientTime,
        tell: &mut dyn FnMut(Input),
    ) -> Result<Turn, Self::Error>;

    /// Whether somebody looks.
    fn is_shown(&self) -> bool;

    /// The user is to be let go; a later turn is [`Turn::Exit`], if they look now.
    ///
    /// # Errors
    /// When they are not.
    fn request_exit(&mut self) -> Result<(), Self::Error>;

    /// Largest side of a picture that can be drawn from, texels; none while that is
    /// not known.
    fn largest_texture(&self) -> Option<u32>;

    /// A session with the server begins.
    fn welcome(&mut self, welcome: &Welcome) {
        self.held_mut().welcome(welcome);
    }

    /// What the session with the server is doing, for the user, who is told when
    /// pictures stop coming.
    fn take_status(&mut self, status: &Status) {
        self.held_mut().take_status(status);
    }

    /// Shows a sentence in the world, until it is taken back.
    fn say(&mut self, sentence: Option<String>) {
        self.held_mut().say(sentence);
    }

    /// What the user is told at this time, if anything.
    fn notice(&self, now: ClientTime) -> Option<&str> {
        self.held().notice(now)
    }
}

/// What became of a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turn {
    /// Nobody looks now: sleep for [`IDLE`] and ask again.
    Idle,
    /// A display frame has passed.
    Frame(Frame),
    /// The display was lost. It is opened anew in a later turn.
    Lost,
    /// The user left: the display is done with.
    Exit,
}

/// A display frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// When it was time for it.
    pub began: ClientTime,
    /// When its light leaves the display.
    pub display_at: ClientTime,
    /// Between two frames of the display.
    pub period: Duration,
    /// How long it took to hand a new world to the GPU.
    pub uploading: Duration,
    /// How long it took to record and submit what is drawn: the driver's time for
    /// the most part.
    pub drawing: Duration,
    /// Whether something was drawn and submitted.
    pub drawn: bool,
    /// Whether a frame of the server was shown for the first time.
    pub fresh: bool,
}

impl Frame {
    /// One that begins, with nothing done yet.
    pub(crate) fn begin(began: ClientTime, display_at: ClientTime, period: Duration) -> Self {
        Self {
            began,
            display_at,
            period,
            uploading: Duration::ZERO,
            drawing: Duration::ZERO,
            drawn: false,
            fresh: false,
        }
    }
}

/// The time between two moments; none where the clock went back.
pub(crate) fn since(began: ClientTime, now: ClientTime) -> Duration {
    Duration::from_nanos(now.0.saturating_sub(began.0))
}
