//! A headset together with the thread that talks to its server: what desktop
//! and Android run, each with its own loader, decoder and user.

use std::time::Duration;

use ::openxr as xr;
use shadecast_protocol::ClientTime;
use shadecast_transport::ServerLine;
use thiserror::Error;

use super::{Headset, HeadsetConfig, HeadsetError, Turn};
use crate::network::{Event, Network};
use crate::render::frame_channel;
use crate::{Clock, Decoder, Failure};

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
    network: Network,
    clock: Clock,
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
        let clock = Clock::start();
        let (sender, frames) = frame_channel();
        let headset = Headset::open(entry, platform, config, frames)?;
        let device_limit = headset.vulkan().map_or(0, |vulkan| {
            vulkan.gpu.device.limits().max_texture_dimension_2d
        });
        let largest = device_limit.min(largest_atlas.into()) as u16;
        let network = Network::start(line, largest, clock, decoder, sender)?;
        Ok(Self {
            headset,
            network,
            clock,
            failed: None,
            leaving: None,
        })
    }

    /// A turn of the headset ([`Headset::turn`]); `hear` is told what the
    /// network's thread says.
    ///
    /// # Errors
    /// When the headset can no longer be used. When the session with the server
    /// failed for good: the user has had time to read why, and has left.
    pub fn turn(&mut self, hear: &mut dyn FnMut(&Event)) -> Result<Turn, ClientError> {
        while let Ok(event) = self.network.events.try_recv() {
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
        let is_over = |since: ClientTime, time: Duration| {
            u128::from(now.0.saturating_sub(since.0)) >= time.as_nanos()
        };
        if let Some((since, _)) = &self.failed
            && is_over(*since, READING)
        {
            self.leave()?;
        }
        let clock = self.clock;
        let network = &self.network;
        let mut turn = self
            .headset
            .turn(&|| clock.now(), &mut |input| network.tell(input))?;
        if let Some(since) = self.leaving {
            let is_shown = self.headset.life().is_some_and(|life| life.is_running());
            if is_over(since, LEAVING) || !is_shown && turn == Turn::Idle {
                turn = Turn::Exit;
            }
        }
        if turn == Turn::Exit
            && let Some((_, failure)) = self.failed.take()
        {
            return Err(failure.into());
        }
        Ok(turn)
    }

    /// Asks the runtime to let the user leave; a later turn is [`Turn::Exit`].
    ///
    /// # Errors
    /// When the runtime refuses.
    pub fn leave(&mut self) -> Result<(), HeadsetError> {
        if self.leaving.is_none() {
            self.leaving = Some(self.clock.now());
            if self.headset.life().is_some_and(|life| life.is_running()) {
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

    /// What talks to the server.
    #[must_use]
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// What both tell the time by.
    #[must_use]
    pub fn clock(&self) -> Clock {
        self.clock
    }
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
