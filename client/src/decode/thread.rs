//! A decoder on a thread of its own, so that neither network nor drawing waits
//! for it.

use std::sync::mpsc::{
    Receiver, RecvTimeoutError, Sender, SyncSender, TrySendError, channel, sync_channel,
};
use std::thread::JoinHandle;
use std::time::Duration;

use thiserror::Error;

use super::{AccessUnit, Decoded, Decoder};

/// Units that wait for the decoder; the session has fewer on their way.
const QUEUED_UNITS: usize = 16;

/// How often a decoder that owes a picture is asked for it. Decoders that
/// answer at once never wait this long.
const POLL_INTERVAL: Duration = Duration::from_millis(1);

/// The decoder's thread has ended, or takes nothing any more. The session is
/// told with [`DecodeError::Unavailable`](crate::DecodeError::Unavailable) for
/// the unit; it asks for a few new starts, for which a thread that merely hung may
/// be back, and then it is over.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the video decoder has stopped working")]
pub struct DecoderGone;

/// How long a thread is waited for that should end. One that hangs in a codec of the
/// platform is left behind: whoever leaves shall not hang with it.
const FAREWELL: Duration = Duration::from_secs(1);

/// Runs a [`Decoder`]. Dropping it ends the thread after the unit at hand.
#[derive(Debug)]
pub struct DecoderThread {
    /// None only while dropping.
    units: Option<SyncSender<AccessUnit>>,
    thread: Option<JoinHandle<()>>,
    /// Its other end goes when the thread ends.
    ended: Receiver<()>,
}

impl DecoderThread {
    /// Starts the thread. It calls `on_decoded` for every unit, in order, as far
    /// as the decoder answers; units that a restart overtakes are left out.
    /// `on_decoded` usually sends into the channel from which the session is fed.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn spawn<D: Decoder + Send + 'static>(
        decoder: D,
        on_decoded: impl FnMut(Decoded) + Send + 'static,
    ) -> std::io::Result<Self> {
        let (units, waiting) = sync_channel(QUEUED_UNITS);
        let (alive, ended) = channel();
        let thread = std::thread::Builder::new()
            .name("decoder".into())
            .spawn(move || {
                let _alive: Sender<()> = alive;
                run(decoder, &waiting, on_decoded);
            })?;
        Ok(Self {
            units: Some(units),
            thread: Some(thread),
            ended,
        })
    }

    /// Hands over a unit; never waits.
    ///
    /// # Errors
    /// The decoder is gone, or so far behind that it must be given up.
    pub fn send(&self, unit: AccessUnit) -> Result<(), DecoderGone> {
        let units = self.units.as_ref().ok_or(DecoderGone)?;
        units.try_send(unit).map_err(|error| match error {
            TrySendError::Full(_) | TrySendError::Disconnected(_) => DecoderGone,
        })
    }
}

impl Drop for DecoderThread {
    fn drop(&mut self) {
        self.units = None;
        let Some(thread) = self.thread.take() else {
            return;
        };
        if self.ended.recv_timeout(FAREWELL) == Err(RecvTimeoutError::Timeout) {
            tracing::error!("the decoder hangs and is left behind");
        } else if thread.join().is_err() {
            tracing::error!("the decoder's thread panicked");
        }
    }
}

fn run(
    mut decoder: impl Decoder,
    units: &Receiver<AccessUnit>,
    mut on_decoded: impl FnMut(Decoded),
) {
    // Units that have not come back.
    let mut owed = 0_usize;
    loop {
        let next = if owed == 0 {
            units.recv().map_err(|_| RecvTimeoutError::Disconnected)
        } else {
            units.recv_timeout(POLL_INTERVAL)
        };
        match next {
            Ok(unit) => {
                if unit.restart {
                    decoder.flush();
                    owed = 0;
                }
                decoder.send(unit);
                owed += 1;
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        while let Some(decoded) = decoder.poll() {
            owed = owed.saturating_sub(1);
            on_decoded(decoded);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;
    use std::time::Instant;

    use shadecast_protocol::FrameId;

    use super::*;
    use crate::decode::Ticket;
    use crate::{DecodedPicture, YuvPicture};

    /// Gives a result only at the third time of asking, as hardware does.
    #[derive(Default)]
    struct SlowDecoder {
        inside: VecDeque<Ticket>,
        asked: u32,
    }

    impl Decoder for SlowDecoder {
        fn send(&mut self, unit: AccessUnit) {
            self.inside.push_back(unit.ticket);
        }

        fn poll(&mut self) -> Option<Decoded> {
            self.asked += 1;
            if !self.asked.is_multiple_of(3) {
                return None;
            }
            let ticket = self.inside.pop_front()?;
            let picture = Ok(DecodedPicture::from(YuvPicture {
                width: 0,
                height: 0,
                y: vec![],
                u: vec![],
                v: vec![],
            }));
            Some(Decoded { ticket, picture })
        }

        fn flush(&mut self) {
            self.inside.clear();
        }
    }

    fn unit(frame: u32, bytes: &[u8]) -> AccessUnit {
        AccessUnit {
            ticket: Ticket {
                connection: 0,
                frame: FrameId(frame),
            },
            restart: false,
            size: [0, 0],
            bytes: bytes.to_vec(),
        }
    }

    #[test]
    fn every_unit_comes_back_once_and_in_order() {
        let (results, received) = channel();
        let thread = DecoderThread::spawn(SlowDecoder::default(), move |decoded| {
            results.send(decoded.ticket.frame).unwrap();
        })
        .unwrap();
        for frame in 0..QUEUED_UNITS as u32 {
            thread.send(unit(frame, &[1])).unwrap();
        }
        for frame in 0..QUEUED_UNITS as u32 {
            let wait = Duration::from_secs(10);
            assert_eq!(received.recv_timeout(wait), Ok(FrameId(frame)));
        }
        drop(thread);
        assert!(received.recv().is_err(), "the thread has ended");
    }

    #[test]
    fn a_decoder_that_hangs_does_not_hang_its_caller_nor_whoever_leaves() {
        let (release, held) = channel::<()>();
        let thread = DecoderThread::spawn(SlowDecoder::default(), move |_| {
            // Ends when the test drops `release`.
            let _ = held.recv();
        })
        .unwrap();
        let sent = (0..100).find(|&frame| thread.send(unit(frame, &[])) == Err(DecoderGone));
        assert!(sent.is_some_and(|frame| frame >= QUEUED_UNITS as u32));
        let began = Instant::now();
        drop(thread);
        assert!(began.elapsed() < 10 * FAREWELL);
        drop(release);
    }
}
