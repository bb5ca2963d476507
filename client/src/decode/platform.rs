//! Makes a [`Decoder`] of a codec of the platform.
//!
//! Codecs such as MediaCodec take a unit when they have room and give a picture
//! when they please: late, several at once, in an order that their callbacks got
//! mixed up, or not at all. All they keep is the stamp that a unit was sent
//! under. [`PlatformDecoder`] gives every unit a stamp of its own, which no later
//! unit ever has again, and puts the pictures back in the order of the units.
//! It knows no platform and reads no clock: a unit is given up when later ones
//! have come out before it, and a codec that gives nothing at all is left to the
//! patience of the session, whose next IDR picture finds it silent and opens
//! another.

use std::collections::VecDeque;

use super::{AccessUnit, DecodeError, Decoded, Decoder, Ticket};
use crate::DecodedPicture;

/// A unit whose picture has not come when this many later ones have will never
/// have one: the stream has no B pictures, so that only callbacks that ran at the
/// same moment can change places.
const OVERTAKEN: u32 = 2;

/// Units that wait for the codec to have room; the session has fewer on their
/// way.
pub(super) const MOST_WAITING: usize = 16;

/// A running codec, call by call as platforms have it. None of them waits.
///
/// An error means that the codec is of no more use; it is dropped.
pub trait PlatformCodec {
    /// Takes a unit under its stamp; false while there is no room. `starts` is
    /// true for an IDR picture after which nothing before is referred to.
    ///
    /// # Errors
    /// The codec is broken, or the unit is too large for it.
    fn queue(&mut self, unit: &[u8], stamp: u64, starts: bool) -> Result<bool, DecodeError>;

    /// A picture that is ready, and the stamp of its unit.
    ///
    /// # Errors
    /// The codec is broken.
    fn take(&mut self) -> Result<Option<(u64, DecodedPicture)>, DecodeError>;

    /// Forgets everything inside. Pictures of before may still come out.
    ///
    /// # Errors
    /// The codec is broken.
    fn flush(&mut self) -> Result<(), DecodeError>;
}

/// Opens codecs of type `C` and keeps one while it serves.
#[derive(Debug)]
pub struct PlatformDecoder<C, F> {
    open: F,
    running: Option<Running<C>>,
    /// Units that the codec has no room for yet; the last of `owed`.
    pub(super) waiting: VecDeque<(u64, AccessUnit)>,
    /// In the order of sending.
    owed: VecDeque<Owed>,
    next_stamp: u64,
}

#[derive(Debug)]
struct Running<C> {
    codec: C,
    size: [u16; 2],
    /// Has given a picture since it was opened or flushed.
    answers: bool,
}

/// A unit that has not come back.
#[derive(Debug)]
struct Owed {
    stamp: u64,
    ticket: Ticket,
    size: [u16; 2],
    /// Later pictures that came before.
    overtaken: u32,
    picture: Option<Result<DecodedPicture, DecodeError>>,
}

impl<C, F> PlatformDecoder<C, F>
where
    C: PlatformCodec,
    F: FnMut([u16; 2]) -> Result<C, DecodeError>,
{
    /// A decoder that waits for an IDR picture. `open` starts a codec for
    /// pictures of a width and a height.
    pub fn new(open: F) -> Self {
        Self {
            open,
            running: None,
            waiting: VecDeque::new(),
            owed: VecDeque::new(),
            next_stamp: 0,
        }
    }

    /// A codec that is fit for the unit.
    fn prepare(&mut self, unit: &AccessUnit) -> Result<(), DecodeError> {
        if self
            .running
            .as_ref()
            .is_some_and(|running| running.size == unit.size)
        {
            return Ok(());
        }
        if !unit.restart {
            return Err(DecodeError::Refused("it waits for an IDR picture".into()));
        }
        // Hardware may have room for one: the old codec goes first.
        self.running = None;
        self.running = Some(Running {
            codec: (self.open)(unit.size)?,
            size: unit.size,
            answers: false,
        });
        Ok(())
    }

    /// Gives the codec what it has room for, and takes what it has.
    fn pump(&mut self) {
        let Some(running) = &mut self.running else {
            return;
        };
        if let Err(error) =
            feed(running, &mut self.waiting).and_then(|()| collect(running, &mut self.owed))
        {
            self.running = None;
            self.waiting.clear();
            for unit in &mut self.owed {
                unit.picture.get_or_insert_with(|| Err(error.clone()));
            }
        }
    }
}

fn feed<C: PlatformCodec>(
    running: &mut Running<C>,
    waiting: &mut VecDeque<(u64, AccessUnit)>,
) -> Result<(), DecodeError> {
    while let Some((stamp, unit)) = waiting.front() {
        if !running.codec.queue(&unit.bytes, *stamp, unit.restart)? {
            break;
        }
        waiting.pop_front();
    }
    Ok(())
}

fn collect<C: PlatformCodec>(
    running: &mut Running<C>,
    owed: &mut VecDeque<Owed>,
) -> Result<(), DecodeError> {
    while let Some((stamp, picture)) = running.codec.take()? {
        // One of before a flush, or given up already.
        let Ok(place) = owed.binary_search_by_key(&stamp, |unit| unit.stamp) else {
            continue;
        };
        running.answers = true;
        let unit = &mut owed[place];
        let (expected, found) = (unit.size.map(u32::from), picture.size());
        unit.picture.get_or_insert(if found == expected {
            Ok(picture)
        } else {
            Err(DecodeError::Size { expected, found })
        });
        for earlier in owed.range_mut(..place) {
            earlier.overtaken += 1;
            if earlier.overtaken >= OVERTAKEN {
                earlier.picture.get_or_insert(Err(DecodeError::NoPicture));
            }
        }
    }
    Ok(())
}

impl<C, F> Decoder for PlatformDecoder<C, F>
where
    C: PlatformCodec,
    F: FnMut([u16; 2]) -> Result<C, DecodeError>,
{
    fn send(&mut self, unit: AccessUnit) {
        let refusal = if self.waiting.len() < MOST_WAITING {
            self.prepare(&unit).err()
        } else {
            Some(DecodeError::Refused("it takes nothing any more".into()))
        };
        let stamp = self.next_stamp;
        self.next_stamp += 1;
        self.owed.push_back(Owed {
            stamp,
            ticket: unit.ticket,
            size: unit.size,
            overtaken: 0,
            picture: refusal.clone().map(Err),
        });
        if refusal.is_none() {
            self.waiting.push_back((stamp, unit));
            self.pump();
        }
    }

    fn poll(&mut self) -> Option<Decoded> {
        self.pump();
        let Owed {
            ticket,
            picture: Some(picture),
            ..
        } = self.owed.pop_front_if(|unit| unit.picture.is_some())?
        else {
            return None;
        };
        Some(Decoded { ticket, picture })
    }

    fn flush(&mut self) {
        let was_owed = !self.owed.is_empty();
        self.waiting.clear();
        self.owed.clear();
        let Some(running) = &mut self.running else {
            return;
        };
        let is_stuck = was_owed && !running.answers;
        if is_stuck || running.codec.flush().is_err() {
            self.running = None;
        } else {
            running.answers = false;
        }
    }
}
