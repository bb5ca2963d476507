//! A headset across as many sessions with its runtime as it takes.

use std::time::Duration;

use ::openxr as xr;
use shadecast_protocol::{ClientTime, Pose, Welcome};

use super::held::Held;
use super::session::{RuntimeSession, SessionTurn};
use super::{Ending, HeadsetError, LifeCycle, Offers};
use crate::render::vulkan::{Extras, VulkanGpu};
use crate::render::{FrameReceiver, Renderer, Stereo};
use crate::{Input, Status};

/// How long whoever runs a headset sleeps after a turn that drew nothing.
pub const IDLE: Duration = Duration::from_millis(10);

/// Between two attempts to reach a runtime that was lost.
const RETRY: Duration = Duration::from_secs(1);

/// Called with every device that is made, and with the renderer on it, before
/// anything is drawn.
pub type OnDevice = Box<dyn FnMut(&VulkanGpu, &mut Renderer)>;

/// What a headset is opened with.
pub struct HeadsetConfig {
    /// Draw four samples a pixel and show their mean.
    pub antialias: bool,
    /// Pictures a second to ask for, where the display has a choice.
    pub display_rate: Option<f32>,
    /// How both eyes are drawn; without, in what the device does rightly.
    pub stereo: Option<Stereo>,
    /// What the device should be able to do besides drawing.
    pub extras: Extras,
    /// For what else is done on the device.
    pub on_device: Option<OnDevice>,
}

impl Default for HeadsetConfig {
    fn default() -> Self {
        Self {
            antialias: true,
            display_rate: None,
            stereo: None,
            extras: Extras::default(),
            on_device: None,
        }
    }
}

/// What became of a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turn {
    /// The runtime wants no frames now: sleep for [`IDLE`] and ask again.
    Idle,
    /// A display frame has passed.
    Frame(Frame),
    /// The session was lost. It is opened anew in a later turn.
    Lost,
    /// The user left: the headset is done with.
    Exit,
}

/// A display frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// When the runtime said that it is time for it.
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

/// A headset, and the world that is shown in it.
pub struct Headset<P = ()> {
    // Before the entry that it came from.
    session: Option<RuntimeSession>,
    held: Held,
    config: HeadsetConfig,
    platform: P,
    entry: xr::Entry,
    retry_at: ClientTime,
}

impl<P: xr::PlatformInfo> Headset<P> {
    /// Opens the headset of the active runtime; what it shows comes from `frames`.
    ///
    /// # Errors
    /// When there is no runtime, no headset, or none that this client can draw for.
    pub fn open(
        entry: xr::Entry,
        platform: P,
        mut config: HeadsetConfig,
        frames: FrameReceiver,
    ) -> Result<Self, HeadsetError> {
        Ok(Self {
            session: Some(RuntimeSession::open(&entry, &platform, &mut config)?),
            held: Held::new(frames),
            config,
            platform,
            entry,
            retry_at: ClientTime(0),
        })
    }

    /// Passes a display frame, or none while the runtime wants none. `now` reads
    /// the client's clock; what the server is to hear goes to `tell` at once.
    ///
    /// # Errors
    /// When the headset can no longer be used; a session that is merely lost is
    /// no error.
    pub fn turn(
        &mut self,
        now: &dyn Fn() -> ClientTime,
        tell: &mut dyn FnMut(Input),
    ) -> Result<Turn, HeadsetError> {
        let Some(session) = &mut self.session else {
            return self.reopen(now());
        };
        let turn = match session.turn(&mut self.held, now, tell) {
            Err(error) if error.is_loss() => {
                tracing::warn!("{error}");
                SessionTurn::Ended(Ending::Lost)
            }
            turn => turn?,
        };
        Ok(match turn {
            SessionTurn::Idle => Turn::Idle,
            SessionTurn::Frame(frame) => Turn::Frame(frame),
            SessionTurn::Ended(ending) => {
                self.session = None;
                match ending {
                    Ending::Exit => Turn::Exit,
                    Ending::Lost => {
                        self.retry_at = later(now(), RETRY);
                        Turn::Lost
                    }
                }
            }
        })
    }

    fn reopen(&mut self, now: ClientTime) -> Result<Turn, HeadsetError> {
        if now < self.retry_at {
            return Ok(Turn::Idle);
        }
        match RuntimeSession::open(&self.entry, &self.platform, &mut self.config) {
            Ok(session) => self.session = Some(session),
            Err(error) if error.is_loss() => {
                tracing::info!("the headset is not back yet: {error}");
                self.retry_at = later(now, RETRY);
            }
            Err(error) => return Err(error),
        }
        Ok(Turn::Idle)
    }

    /// A session with the server begins.
    pub fn welcome(&mut self, welcome: &Welcome) {
        self.held.welcome(welcome);
    }

    /// What the session with the server is doing, for the user in the headset,
    /// who is told when pictures stop coming.
    pub fn take_status(&mut self, status: &Status) {
        self.held.take_status(status);
    }

    /// Shows a sentence in the world, until it is taken back.
    pub fn say(&mut self, sentence: Option<String>) {
        self.held.say(sentence);
    }

    /// Asks the runtime to let the user leave; a later turn is [`Turn::Exit`].
    ///
    /// # Errors
    /// When the runtime refuses.
    pub fn request_exit(&self) -> Result<(), HeadsetError> {
        self.session
            .as_ref()
            .map_or(Ok(()), RuntimeSession::request_exit)
    }

    /// The device that is drawn with; none while the session is lost.
    #[must_use]
    pub fn vulkan(&self) -> Option<&VulkanGpu> {
        self.session.as_ref().map(RuntimeSession::vulkan)
    }

    /// What the runtime offers and what is left out; none while the session is lost.
    #[must_use]
    pub fn offers(&self) -> Option<Offers> {
        self.session.as_ref().map(RuntimeSession::offers)
    }

    /// What was opened, in a line for people; none while the session is lost.
    #[must_use]
    pub fn description(&self) -> Option<String> {
        self.session.as_ref().map(RuntimeSession::description)
    }

    /// Pixels of one eye's picture; none while the session is lost.
    #[must_use]
    pub fn eye_size(&self) -> Option<[u32; 2]> {
        self.session.as_ref().map(RuntimeSession::eye_size)
    }

    /// Where the session is in its life; none while it is lost.
    #[must_use]
    pub fn life(&self) -> Option<&LifeCycle> {
        self.session.as_ref().map(RuntimeSession::life)
    }

    /// Where the play space stands in the world by now.
    #[must_use]
    pub fn world_from_play(&self) -> Pose {
        self.held.world_from_play
    }

    /// What the user is told at this time, if anything.
    #[must_use]
    pub fn notice(&self, now: ClientTime) -> Option<&str> {
        self.held.notice(now)
    }
}

fn later(now: ClientTime, by: Duration) -> ClientTime {
    ClientTime(now.0.saturating_add(by.as_nanos() as u64))
}
