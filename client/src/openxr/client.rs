//! A headset together with the thread that talks to its server: what desktop
//! and Android run, each with its own loader, decoder and user.

use std::time::Duration;

use ::openxr as xr;
use shadecast_protocol::ClientTime;
use shadecast_transport::ServerLine;
use thiserror::Error;

use super::{Headset, HeadsetConfig, HeadsetError, Turn};
use crate::network::{Event, Network};
use crate::render::{FrameSender, frame_channel};
use crate::{Clock, Decoder, Failure, Input};

/// A headset that wants no pictures for this long is not worn, and the server is
/// left: it has nothing to compute then. A glance at one's watch is shorter.
const REST_AFTER: Duration = Duration::from_secs(10);
/// How long a final sentence stays before the eyes.
const READING: Duration = Duration::from_secs(8);
/// How long a runtime is given to let the user leave.
const LEAVING: Duration = Duration::from_secs(3);

/// Why a client ends.
#[derive(Debug, Error)]
pub enum ClientError {
    /// The headset.
    #[error(transparent)]
    Headset(#[from] HeadsetError),
    /// The session with the server.
    #[error(transparent)]
    Session(#[from] Failure),
    /// The system.
    #[error("cannot start the threads of network and decoder: {0}")]
    Threads(#[from] std::io::Error),
}

/// A running client.
pub struct HeadsetClient<P = ()> {
    headset: Headset<P>,
    /// None until the server is known.
    network: Option<Network>,
    /// The network's end of the hand-over, until it has it.
    frames: Option<FrameSender>,
    clock: Clock,
    /// By whoever runs the client.
    is_paused: bool,
    /// Since when the headset wants no pictures.
    idle_since: Option<ClientTime>,
    /// Whether the session with the server rests.
    rests: bool,
    /// Since when a failure is shown.
    failed: Option<(ClientTime, Failure)>,
    /// Since when the runtime is asked to let the user leave.
    leaving: Option<ClientTime>,
}

impl<P: xr::PlatformInfo> HeadsetClient<P> {
    /// Opens the headset and begins to reach for the server, whose pictures are
    /// at most `largest_atlas` texels wide and high.
    ///
    /// # Errors
    /// When there is no headset that can be drawn for, or the system has no threads.
    pub fn start(
        entry: xr::Entry,
        platform: P,
        config: HeadsetConfig,
        line: ServerLine,
        decoder: impl Decoder + Send + 'static,
        largest_atlas: u16,
    ) -> Result<Self, ClientError> {
        let mut this = Self::open(entry, platform, config)?;
        this.connect(line, decoder, largest_atlas)?;
        Ok(this)
    }

    /// Opens the headset; its user waits for [`connect`](Self::connect).
    ///
    /// # Errors
    /// When there is no headset that can be drawn for.
    pub fn open(
        entry: xr::Entry,
        platform: P,
        config: HeadsetConfig,
    ) -> Result<Self, HeadsetError> {
        let (sender, frames) = frame_channel();
        Ok(Self {
            headset: Headset::open(entry, platform, config, frames)?,
            network: None,
            frames: Some(sender),
            clock: Clock::start(),
            is_paused: false,
            idle_since: None,
            rests: false,
            failed: None,
            leaving: None,
        })
    }

    /// Begins to reach for the server, as in [`start`](Self::start). A second
    /// server is not reached for.
    ///
    /// # Errors
    /// The system has no threads.
    pub fn connect(
        &mut self,
        line: ServerLine,
        decoder: impl Decoder + Send + 'static,
        largest_atlas: u16,
    ) -> Result<(), ClientError> {
        let Some(frames) = self.frames.take() else {
            return Ok(());
        };
        let device_limit = self.headset.vulkan().map_or(u32::MAX, |vulkan| {
            vulkan.gpu.device.limits().max_texture_dimension_2d
        });
        let largest = device_limit.min(largest_atlas.into()) as u16;
        let network = Network::start(line, largest, self.clock, decoder, frames)?;
        self.network = Some(network);
        Ok(())
    }

    /// Shows a sentence in the world, until it is taken back.
    pub fn say(&mut self, sentence: Option<String>) {
        self.headset
            .say(sentence.map(|sentence| capitalised(&sentence)));
    }

    /// While it is paused, the client has left its server, and keeps the world. It
    /// does so by itself while the headset is not worn.
    pub fn set_paused(&mut self, is_paused: bool) {
        self.is_paused = is_paused;
    }

    /// A turn of the headset ([`Headset::turn`]); `hear` is told what the
    /// network's thread says.
    ///
    /// # Errors
    /// When the headset can no longer be used. When the session with the server
    /// failed for good: the user has had time to read why, and has left.
    pub fn turn(&mut self, hear: &mut dyn FnMut(&Event)) -> Result<Turn, ClientError> {
        let events = self.network.iter().flat_map(|one| one.events.try_iter());
        for event in events {
            hear(&event);
            match event {
                Event::Welcomed(welcome) => self.headset.welcome(&welcome),
                Event::Status(status) => self.headset.take_status(&status),
                Event::Failed(failure) => {
                    self.headset.say(Some(capitalised(&failure.to_string())));
                    self.failed = Some((self.clock.now(), failure));
                }
            }
        }
        let now = self.clock.now();
        self.rest_or_wake(now);
        if let Some((since, _)) = &self.failed
            && is_over(*since, now, READING)
        {
            self.leave()?;
        }
        let clock = self.clock;
        let network = &self.network;
        let mut turn = self.headset.turn(&|| clock.now(), &mut |input| {
            if let Some(network) = network {
                network.tell(input);
            }
        })?;
        if let Some(since) = self.leaving
            && (is_over(since, now, LEAVING) || !self.is_shown() && turn == Turn::Idle)
        {
            turn = Turn::Exit;
        }
        if turn == Turn::Exit
            && let Some((_, failure)) = self.failed.take()
        {
            return Err(failure.into());
        }
        Ok(turn)
    }

    /// Lets the session with the server rest while nobody looks.
    fn rest_or_wake(&mut self, now: ClientTime) {
        self.idle_since = match self.idle_since {
            _ if self.is_shown() => None,
            since => since.or(Some(now)),
        };
        let is_off = |since| is_over(since, now, REST_AFTER);
        let rests = self.is_paused || self.idle_since.is_some_and(is_off);
        if let Some(network) = &self.network
            && rests != self.rests
        {
            network.tell(if rests { Input::Rest } else { Input::Wake });
            self.rests = rests;
        }
    }

    /// Whether the runtime wants pictures.
    fn is_shown(&self) -> bool {
        self.headset.life().is_some_and(|life| life.is_running())
    }

    /// Asks the runtime to let the user leave; a later turn is [`Turn::Exit`].
    ///
    /// # Errors
    /// When the runtime refuses.
    pub fn leave(&mut self) -> Result<(), HeadsetError> {
        if self.leaving.is_none() {
            self.leaving = Some(self.clock.now());
            if self.is_shown() {
                self.headset.request_exit()?;
            }
        }
        Ok(())
    }

    /// What is worn.
    #[must_use]
    pub fn headset(&self) -> &Headset<P> {
        &self.headset
    }

    /// What talks to the server; none before it is known.
    #[must_use]
    pub fn network(&self) -> Option<&Network> {
        self.network.as_ref()
    }

    /// What both tell the time by.
    #[must_use]
    pub fn clock(&self) -> Clock {
        self.clock
    }
}

fn is_over(since: ClientTime, now: ClientTime, time: Duration) -> bool {
    u128::from(now.0.saturating_sub(since.0)) >= time.as_nanos()
}

/// As a sentence begins.
fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map(|first| first.to_uppercase().chain(letters).collect())
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_begin_with_a_capital() {
        assert_eq!(capitalised("the server refuses"), "The server refuses");
        assert_eq!(capitalised("éa"), "Éa");
        assert_eq!(capitalised(""), "");
    }
}
