//! A display together with the thread that talks to its server: what desktop
//! and Android run, each with its own display, decoder and user.

use std::time::Duration;

use shadecast_protocol::ClientTime;
use shadecast_transport::ServerLine;
use thiserror::Error;

use super::{Display, Turn};
use crate::network::{Event, Network};
use crate::render::{FrameReceiver, FrameSender, frame_channel};
use crate::settings::NoServer;
use crate::{Clock, Decoder, Failure, Input};

/// A display that wants no pictures for this long is not worn, and the server is
/// left: it has nothing to compute then. A glance at one's watch is shorter.
const REST_AFTER: Duration = Duration::from_secs(10);
/// How often a server is looked for while there is none: whoever names one sees the
/// scene at once.
const LOOK_AGAIN: Duration = Duration::from_secs(1);
/// How long a final sentence stays before the eyes.
const READING: Duration = Duration::from_secs(8);
/// How long a display is given to let the user leave.
const LEAVING: Duration = Duration::from_secs(3);

/// Why a client ends.
#[derive(Debug, Error)]
pub enum ClientError<E: std::error::Error + 'static> {
    /// The display.
    #[error(transparent)]
    Display(E),
    /// The session with the server.
    #[error(transparent)]
    Session(#[from] Failure),
    /// The system.
    #[error("cannot start the threads of network and decoder: {0}")]
    Threads(#[from] std::io::Error),
}

/// A running client.
pub struct HeadsetClient<D> {
    display: D,
    /// None until the server is known.
    network: Option<Network>,
    /// The network's end of the hand-over, until it has it.
    frames: Option<FrameSender>,
    /// When a server was last looked for.
    sought_at: Option<ClientTime>,
    clock: Clock,
    /// By whoever runs the client.
    is_paused: bool,
    /// Since when the display wants no pictures.
    idle_since: Option<ClientTime>,
    /// Whether the session with the server rests.
    rests: bool,
    /// Since when a failure is shown.
    failed: Option<(ClientTime, Failure)>,
    /// Since when the display is asked to let the user leave.
    leaving: Option<ClientTime>,
}

impl<D: Display> HeadsetClient<D> {
    /// Opens the display, which shows what comes from the end that it is given; its
    /// user waits for [`connect`](Self::connect).
    ///
    /// # Errors
    /// When there is none that can be drawn for.
    pub fn open<E>(display: impl FnOnce(FrameReceiver) -> Result<D, E>) -> Result<Self, E> {
        let (sender, frames) = frame_channel();
        Ok(Self {
            display: display(frames)?,
            network: None,
            frames: Some(sender),
            sought_at: None,
            clock: Clock::start(),
            is_paused: false,
            idle_since: None,
            rests: false,
            failed: None,
            leaving: None,
        })
    }

    /// Begins to reach for the server, whose pictures are at most `largest_atlas`
    /// texels wide and high. A second server is not reached for.
    ///
    /// # Errors
    /// The system has no threads.
    pub fn connect(
        &mut self,
        line: ServerLine,
        decoder: impl Decoder + Send + 'static,
        largest_atlas: u16,
    ) -> Result<(), ClientError<D::Error>> {
        let Some(frames) = self.frames.take() else {
            return Ok(());
        };
        let limit = self.display.largest_texture().unwrap_or(u32::MAX);
        let largest = limit.min(largest_atlas.into()) as u16;
        let network = Network::start(line, largest, self.clock, decoder, frames)?;
        self.network = Some(network);
        Ok(())
    }

    /// Looks for a server every second while there is none, and begins to reach for
    /// the first that is found, as in [`connect`](Self::connect). Its user is told
    /// why there is none.
    ///
    /// # Errors
    /// The system has no threads.
    pub fn seek<C: Decoder + Send + 'static>(
        &mut self,
        find: impl FnOnce() -> Result<ServerLine, NoServer>,
        decoder: impl FnOnce() -> C,
        largest_atlas: u16,
    ) -> Result<(), ClientError<D::Error>> {
        let now = self.clock.now();
        let soon = |before| !is_over(before, now, LOOK_AGAIN);
        if self.network.is_some() || self.sought_at.is_some_and(soon) {
            return Ok(());
        }
        self.sought_at = Some(now);
        match find() {
            Ok(line) => {
                tracing::info!("server {}", line.address);
                self.say(None);
                self.connect(line, decoder(), largest_atlas)
            }
            Err(error) => {
                self.say(Some(error.to_string()));
                Ok(())
            }
        }
    }

    /// Shows a sentence in the world, until it is taken back.
    pub fn say(&mut self, sentence: Option<String>) {
        self.display
            .say(sentence.map(|sentence| capitalised(&sentence)));
    }

    /// While it is paused, the client has left its server, and keeps the world. It
    /// does so by itself while nobody looks.
    pub fn set_paused(&mut self, is_paused: bool) {
        self.is_paused = is_paused;
    }

    /// A turn of the display ([`Display::turn`]); `hear` is told what the network's
    /// thread says.
    ///
    /// # Errors
    /// When the display can no longer be used. When the session with the server
    /// failed for good: the user has had time to read why, and has left.
    pub fn turn(&mut self, hear: &mut dyn FnMut(&Event)) -> Result<Turn, ClientError<D::Error>> {
        let events = self.network.iter().flat_map(|one| one.events.try_iter());
        for event in events {
            hear(&event);
            match event {
                Event::Welcomed(welcome) => self.display.welcome(&welcome),
                Event::Status(status) => self.display.take_status(&status),
                Event::Failed(failure) => {
                    self.display.say(Some(capitalised(&failure.to_string())));
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
        let mut tell = |input| {
            if let Some(network) = network {
                network.tell(input);
            }
        };
        let mut turn = self
            .display
            .turn(&|| clock.now(), &mut tell)
            .map_err(ClientError::Display)?;
        if let Some(since) = self.leaving
            && (is_over(since, now, LEAVING) || !self.display.is_shown() && turn == Turn::Idle)
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
            _ if self.display.is_shown() => None,
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

    /// Asks the display to let the user leave; a later turn is [`Turn::Exit`].
    ///
    /// # Errors
    /// When it refuses.
    pub fn leave(&mut self) -> Result<(), ClientError<D::Error>> {
        if self.leaving.is_none() {
            self.leaving = Some(self.clock.now());
            if self.display.is_shown() {
                self.display.request_exit().map_err(ClientError::Display)?;
            }
        }
        Ok(())
    }

    /// What is worn.
    #[must_use]
    pub fn display(&self) -> &D {
        &self.display
    }

    /// As [`display`](Self::display), to tell it something.
    pub fn display_mut(&mut self) -> &mut D {
        &mut self.display
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

/// Leaves a trace of what the network's thread says.
pub fn log(event: &Event) {
    match event {
        Event::Welcomed(welcome) => {
            let [width, height] = welcome.atlas_size;
            tracing::info!("welcomed: an atlas of {width}x{height} texels");
        }
        Event::Status(status) => tracing::info!("{status:?}"),
        Event::Failed(failure) => tracing::error!("the session is over: {failure}"),
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
