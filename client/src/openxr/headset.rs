//! A headset across as many sessions with its runtime as it takes.

use std::time::Duration;

use ::openxr as xr;
use shadecast_protocol::{ClientTime, Pose};

use super::session::{RuntimeSession, SessionTurn};
use super::{Ending, HeadsetError, LifeCycle, Offers};
use crate::Input;
use crate::render::vulkan::{Extras, VulkanGpu};
use crate::render::{FrameReceiver, Stereo};
use crate::worn::{Display, Held, OnDevice, Turn};

/// Between two attempts to reach a runtime that was lost.
const RETRY: Duration = Duration::from_secs(1);

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
}

impl<P: xr::PlatformInfo> Display for Headset<P> {
    type Error = HeadsetError;

    fn held(&self) -> &Held {
        &self.held
    }

    fn held_mut(&mut self) -> &mut Held {
        &mut self.held
    }

    fn turn(
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

    fn is_shown(&self) -> bool {
        self.life().is_some_and(LifeCycle::is_running)
    }

    fn request_exit(&mut self) -> Result<(), HeadsetError> {
        self.session
            .as_ref()
            .map_or(Ok(()), RuntimeSession::request_exit)
    }

    fn largest_texture(&self) -> Option<u32> {
        let vulkan = self.vulkan()?;
        Some(vulkan.gpu.device.limits().max_texture_dimension_2d)
    }
}

fn later(now: ClientTime, by: Duration) -> ClientTime {
    ClientTime(now.0.saturating_add(by.as_nanos() as u64))
}
