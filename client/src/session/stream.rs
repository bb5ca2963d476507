//! Pairs pictures with updates and sees to it that each frame takes effect
//! whole, in order, or not at all.
//!
//! Frames of a connection are numbered without gaps. Pictures go to the decoder
//! in that order, from an IDR picture on; a frame is shown once its picture is
//! decoded and its update is here. Where a frame is lost, the chain of pictures
//! is broken: the next one to show is the IDR picture of a newer epoch. Updates
//! of the frames between are not shown, but what they told of geometry and
//! motions is learnt, because the server may not say it again.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use shadecast_protocol::{
    ClientTime, Epoch, FrameId, Method, Picture, ResetReason, ToServer, Update, UpdateTiming,
};

use super::inbox::Inbox;
use super::{Output, Status, elapsed};
use crate::{
    AccessUnit, ClientTiming, ClockEstimate, DecodeError, Decoded, DecodedPicture, Ticket, World,
    WorldError,
};

/// Pictures with the decoder or decoded, waiting for their updates: enough for
/// hardware that gives its first picture when it has been sent several, and few,
/// because each may hold a whole picture.
const MAX_IN_FLIGHT: usize = 8;

/// A picture that is missing this long while later ones arrive was lost. Streams
/// of their own arrive a few round trips apart at most.
const PICTURE_PATIENCE: Duration = Duration::from_millis(250);

/// An update that is missing this long after its picture was decoded will not
/// be sent. Updates are not lost, only slow: a first one holds the geometry of a
/// whole view.
const UPDATE_PATIENCE: Duration = Duration::from_secs(2);

/// A decoder that has answered nothing for this long is stuck. Hardware takes a
/// few tenths of a second to open.
const DECODER_PATIENCE: Duration = Duration::from_secs(1);

/// Decoders that could not be had, one for each restart, after which there is none:
/// with the time between restarts five seconds, in which another application may
/// have given one back.
const MOST_OPENINGS: u32 = 5;

/// Least time between two requests for a reset; doubles up to three times
/// while none is answered, for a server that takes long to make a picture.
const RESET_INTERVAL: Duration = Duration::from_millis(300);

/// The frames of one connection.
#[derive(Debug)]
pub(super) struct Stream {
    connection: u32,
    atlas_size: [u16; 2],
    world: World,
    pictures: Inbox<Picture>,
    updates: Inbox<Update>,
    /// In frame order.
    in_flight: VecDeque<InFlight>,
    phase: Phase,
    /// The last frame that took effect.
    presented: Option<FrameId>,
    /// What the next frame waits for, and since when.
    stuck: Option<(Missing, ClientTime)>,
    asked_at: Option<ClientTime>,
    /// Units in a row for which there was no decoder.
    without_decoder: u32,
}

#[derive(Debug)]
enum Phase {
    /// For an IDR picture of a newer epoch.
    WaitingForIdr {
        /// None at the start of a connection, which begins with one unasked.
        lost: Option<ResetReason>,
        /// Requests sent in this phase.
        asked: u32,
    },
    /// The chain of pictures is whole.
    Flowing {
        /// The next picture for the decoder.
        next: FrameId,
    },
}

/// A picture on its way from the decoder to the display.
#[derive(Debug)]
struct InFlight {
    frame: FrameId,
    epoch: Epoch,
    idr: bool,
    received: ClientTime,
    decoded: Option<DecodedPicture>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Missing {
    Picture(FrameId),
    Decoded(FrameId),
    Update(FrameId),
}

impl Stream {
    pub(super) fn new(connection: u32, atlas_size: [u16; 2], method: Method) -> Self {
        Self {
            connection,
            atlas_size,
            world: World::new(atlas_size, method),
            pictures: Inbox::new(),
            updates: Inbox::new(),
            in_flight: VecDeque::new(),
            phase: Phase::WaitingForIdr {
                lost: None,
                asked: 0,
            },
            presented: None,
            stuck: None,
            asked_at: None,
            without_decoder: 0,
        }
    }

    pub(super) fn presented(&self) -> Option<FrameId> {
        self.presented
    }

    pub(super) fn take_update(&mut self, now: ClientTime, update: Update) {
        if Some(update.frame) <= self.presented {
            return;
        }
        self.updates.insert(now, update);
        while self.updates.overflows() {
            // Those of given-up frames are only kept to be learnt in order.
            let is_dead = |next| self.updates.first_frame() < Some(next);
            if !self.next_to_show().is_none_or(is_dead) {
                self.lose(ResetReason::Gap);
            }
            if let Some(oldest) = self.updates.take_first() {
                self.learn(&oldest.message);
            }
        }
    }

    /// None while nothing can be shown.
    fn next_to_show(&self) -> Option<FrameId> {
        let Phase::Flowing { next } = self.phase else {
            return None;
        };
        let front = self.in_flight.front();
        Some(front.map_or(next, |front| front.frame))
    }

    pub(super) fn take_picture(&mut self, now: ClientTime, picture: Picture) {
        let is_late = match self.phase {
            Phase::Flowing { next } => picture.frame < next,
            Phase::WaitingForIdr { .. } => {
                Some(picture.frame) <= self.presented || Some(picture.epoch) <= self.world.epoch()
            }
        };
        if is_late {
            return;
        }
        self.pictures.insert(now, picture);
        while self.pictures.overflows() {
            if matches!(self.phase, Phase::Flowing { .. }) {
                self.lose(ResetReason::Gap);
            }
            self.pictures.take_first();
        }
    }

    /// Takes what became of a picture.
    ///
    /// # Errors
    /// There is no decoder, and trying again has not mended it.
    pub(super) fn take_decoded(
        &mut self,
        now: ClientTime,
        decoded: Decoded,
    ) -> Result<(), DecodeError> {
        let Ticket { connection, frame } = decoded.ticket;
        if connection != self.connection {
            return Ok(());
        }
        let Some(waiting) = self.in_flight.iter_mut().find(|one| one.frame == frame) else {
            return Ok(());
        };
        match decoded.picture {
            Ok(picture) => {
                waiting.decoded = Some(picture);
                self.without_decoder = 0;
            }
            Err(error) => {
                tracing::warn!(frame = frame.0, at = now.0, "{error}");
                self.lose(ResetReason::Decoder);
                if let DecodeError::Unavailable(_) = error {
                    self.without_decoder += 1;
                    if self.without_decoder >= MOST_OPENINGS {
                        return Err(error);
                    }
                }
            }
        }
        Ok(())
    }

    /// Feeds the decoder and shows what is complete.
    ///
    /// # Errors
    /// The server contradicts itself; the connection is of no more use.
    pub(super) fn advance(
        &mut self,
        now: ClientTime,
        clock: &ClockEstimate,
        outputs: &mut VecDeque<Output>,
    ) -> Result<(), WorldError> {
        loop {
            self.feed_decoder(outputs);
            if !self.show_next(now, clock, outputs)? {
                return Ok(());
            }
        }
    }

    fn feed_decoder(&mut self, outputs: &mut VecDeque<Output>) {
        while self.in_flight.len() < MAX_IN_FLIGHT {
            let restart = matches!(self.phase, Phase::WaitingForIdr { .. });
            let next = match self.phase {
                Phase::Flowing { next } if self.pictures.contains(next) => next,
                _ => match self.newest_start() {
                    Some(start) => start,
                    None => return,
                },
            };
            while self.pictures.take_before(next).is_some() {}
            let Some(arrived) = self.pictures.take(next) else {
                return;
            };
            let picture = arrived.message;
            self.phase = Phase::Flowing {
                next: FrameId(next.0.saturating_add(1)),
            };
            self.in_flight.push_back(InFlight {
                frame: next,
                epoch: picture.epoch,
                idr: picture.idr,
                received: arrived.at,
                decoded: None,
            });
            outputs.push_back(Output::Decode(AccessUnit {
                ticket: Ticket {
                    connection: self.connection,
                    frame: next,
                },
                restart,
                size: self.atlas_size,
                bytes: picture.bytes,
            }));
        }
    }

    /// The newest picture here that needs neither a picture nor a placement
    /// before it.
    fn newest_start(&self) -> Option<FrameId> {
        let last = self.in_flight.back().map(|picture| picture.epoch);
        let epoch = last.or(self.world.epoch());
        self.pictures
            .newest_first()
            .find(|picture| picture.idr && Some(picture.epoch) > epoch)
            .map(|picture| picture.frame)
    }

    /// Lets the next frame take effect if it is complete. True when something
    /// happened that may let more happen.
    fn show_next(
        &mut self,
        now: ClientTime,
        clock: &ClockEstimate,
        outputs: &mut VecDeque<Output>,
    ) -> Result<bool, WorldError> {
        let updates = &self.updates;
        let is_complete =
            |next: &mut InFlight| next.decoded.is_some() && updates.contains(next.frame);
        let Some(InFlight {
            frame,
            epoch,
            idr,
            received,
            decoded: Some(picture),
        }) = self.in_flight.pop_front_if(is_complete)
        else {
            return Ok(false);
        };
        let Some(arrived) = self.updates.take(frame) else {
            return Ok(false);
        };

        let mut is_start = idr && Some(epoch) > self.world.epoch();
        while let Some(skipped) = self.updates.take_before(frame) {
            self.learn(&skipped.message);
            is_start &= skipped.message.epoch < epoch;
        }
        let update = arrived.message;
        let fits = update.epoch == epoch && (is_start || self.world.epoch() == Some(epoch));
        if !fits {
            tracing::warn!(
                frame = frame.0,
                "picture and update are of different epochs"
            );
            self.learn(&update);
            self.lose(ResetReason::Gap);
            return Ok(true);
        }

        self.world.apply(&update)?;
        let timing = ClientTiming {
            received: received.max(arrived.at).0,
            decoded: now.0,
            client_minus_server: clock
                .client_minus_server()
                .unwrap_or_else(|| offset_without_samples(&update.timing)),
        };
        let shown = self.world.frame(&update, picture, timing);
        if self.presented.is_none() || is_start {
            outputs.push_back(Output::Status(Status::Streaming));
        }
        self.presented = Some(frame);
        outputs.push_back(Output::Present(Arc::new(shown)));
        Ok(true)
    }

    /// Notices what does not come, and asks for a reset where one is needed.
    pub(super) fn watch(&mut self, now: ClientTime, outputs: &mut VecDeque<Output>) {
        let missing = self.missing();
        if self.stuck.map(|(missing, _)| missing) != missing {
            self.stuck = missing.map(|missing| (missing, now));
        }
        if let Some((missing, since)) = self.stuck {
            let patience = match missing {
                Missing::Picture(_) => PICTURE_PATIENCE,
                Missing::Decoded(_) => DECODER_PATIENCE,
                Missing::Update(_) => UPDATE_PATIENCE,
            };
            if elapsed(since, now) > patience {
                tracing::warn!(?missing, "a frame is lost");
                self.lose(match missing {
                    Missing::Decoded(_) => ResetReason::Decoder,
                    Missing::Picture(_) | Missing::Update(_) => ResetReason::Gap,
                });
            }
        }
        self.ask_for_reset(now, outputs);
    }

    fn missing(&self) -> Option<Missing> {
        if let Some(front) = self.in_flight.front() {
            return Some(match front.decoded {
                Some(_) => Missing::Update(front.frame),
                None => Missing::Decoded(front.frame),
            });
        }
        let first = self.pictures.first_frame()?;
        match self.phase {
            Phase::Flowing { next } => (first != next).then_some(Missing::Picture(next)),
            Phase::WaitingForIdr { lost: None, .. } => Some(Missing::Picture(first)),
            Phase::WaitingForIdr { lost: Some(_), .. } => None,
        }
    }

    fn ask_for_reset(&mut self, now: ClientTime, outputs: &mut VecDeque<Output>) {
        let Phase::WaitingForIdr {
            lost: Some(reason),
            asked,
        } = &mut self.phase
        else {
            return;
        };
        let interval = RESET_INTERVAL * (1 << (*asked).min(3));
        let asked_lately = |at: ClientTime| elapsed(at, now) < interval;
        if self.asked_at.is_some_and(asked_lately) {
            return;
        }
        if *asked == 0 {
            outputs.push_back(Output::Status(Status::Recovering(*reason)));
        }
        *asked += 1;
        self.asked_at = Some(now);
        outputs.push_back(Output::Send(ToServer::RequestReset(*reason)));
    }

    /// Gives up the chain of pictures.
    fn lose(&mut self, reason: ResetReason) {
        self.in_flight.clear();
        self.pictures.clear();
        self.stuck = None;
        self.phase = Phase::WaitingForIdr {
            lost: Some(reason),
            asked: 0,
        };
    }

    /// An update that cannot even be learnt builds on one that is missing. If
    /// it mattered, the next frame to be shown will not apply.
    fn learn(&mut self, update: &Update) {
        if let Err(error) = self.world.learn(update) {
            tracing::debug!(frame = update.frame.0, "not learnt: {error}");
        }
    }
}

/// The offset that lets the view report of this update have travelled in no
/// time: too small by that time.
fn offset_without_samples(timing: &UpdateTiming) -> i64 {
    timing.view_sampled.0.wrapping_sub(timing.view_received.0) as i64
}
