//! A codec that behaves as MediaCodec does, by script: it has room for few
//! units, gives pictures late and several at once, lets callbacks change places,
//! drops buffers, breaks, and says nothing of garbage. Inside is a real decoder,
//! so that its pictures are those of its units.

use std::collections::VecDeque;

use shadecast_protocol::FrameId;

use crate::DecodedPicture;
use crate::decode::{AccessUnit, DecodeError, Decoder, OpenH264Decoder, PlatformCodec, Ticket};

/// How a codec behaves. Lists start over at their end.
#[derive(Clone, Debug)]
pub(super) struct Script {
    /// Units that it holds at once.
    pub(super) room: usize,
    /// How many times it is asked before each picture is ready.
    pub(super) delays: VecDeque<u32>,
    /// Which pictures change places with the next one that is ready with them.
    pub(super) swaps: VecDeque<bool>,
    /// Units since it was opened that it takes and gives no picture for.
    pub(super) drops: Vec<u64>,
    /// The unit that breaks it.
    pub(super) breaks_at: Option<u64>,
    /// It gives neither picture nor error for what it cannot decode.
    pub(super) swallows_garbage: bool,
}

impl Default for Script {
    fn default() -> Self {
        Self {
            room: 4,
            delays: VecDeque::from([0]),
            swaps: VecDeque::from([false]),
            drops: vec![],
            breaks_at: None,
            swallows_garbage: false,
        }
    }
}

#[derive(Debug)]
pub(super) struct ScriptedCodec {
    script: Script,
    decoder: OpenH264Decoder,
    /// Of the stream, as far as it is known.
    size: [u16; 2],
    /// Units taken since it was opened.
    taken: u64,
    inside: VecDeque<Inside>,
}

#[derive(Debug)]
struct Inside {
    stamp: u64,
    /// Times that it is asked before this is ready.
    delay: u32,
    /// None for what it drops.
    picture: Option<DecodedPicture>,
    /// The one after it has come out.
    is_overtaken: bool,
}

impl ScriptedCodec {
    pub(super) fn open(script: Script) -> Self {
        Self {
            script,
            decoder: OpenH264Decoder::new(),
            size: [0; 2],
            taken: 0,
            inside: VecDeque::new(),
        }
    }

    /// Gives pictures of whatever size the stream has.
    fn decode(&mut self, bytes: &[u8]) -> Result<DecodedPicture, DecodeError> {
        match self.decode_sized(bytes) {
            Err(DecodeError::Size { found, .. }) => {
                self.size = found.map(|side| side as u16);
                self.decode_sized(bytes)
            }
            other => other,
        }
    }

    fn decode_sized(&mut self, bytes: &[u8]) -> Result<DecodedPicture, DecodeError> {
        self.decoder.send(AccessUnit {
            ticket: Ticket {
                connection: 0,
                frame: FrameId(0),
            },
            restart: false,
            size: self.size,
            bytes: bytes.to_vec(),
        });
        self.decoder.poll().ok_or(DecodeError::NoPicture)?.picture
    }
}

impl PlatformCodec for ScriptedCodec {
    fn queue(&mut self, unit: &[u8], stamp: u64, _starts: bool) -> Result<bool, DecodeError> {
        if self.inside.len() >= self.script.room {
            return Ok(false);
        }
        let number = self.taken;
        self.taken += 1;
        if self.script.breaks_at == Some(number) {
            return Err(DecodeError::Refused("the codec broke".into()));
        }
        let picture = match self.decode(unit) {
            Ok(picture) => (!self.script.drops.contains(&number)).then_some(picture),
            Err(_) if self.script.swallows_garbage => None,
            Err(error) => return Err(error),
        };
        let delay = self.script.delays.front().copied().unwrap_or_default();
        self.script.delays.rotate_left(1);
        self.inside.push_back(Inside {
            stamp,
            delay,
            picture,
            is_overtaken: false,
        });
        Ok(true)
    }

    fn take(&mut self) -> Result<Option<(u64, DecodedPicture)>, DecodeError> {
        for one in &mut self.inside {
            one.delay = one.delay.saturating_sub(1);
        }
        let is_ready = |one: &mut Inside| one.delay == 0;
        while let Some(first) = self.inside.pop_front_if(is_ready) {
            let Some(picture) = first.picture else {
                continue;
            };
            self.script.swaps.rotate_left(1);
            if self.script.swaps.back() == Some(&true)
                && let Some(second) = self.inside.front_mut()
                && second.delay == 0
                && !first.is_overtaken
                && let Some(other) = &mut second.picture
            {
                second.is_overtaken = true;
                let overtaking = std::mem::replace(other, picture);
                let stamp = std::mem::replace(&mut second.stamp, first.stamp);
                return Ok(Some((stamp, overtaking)));
            }
            return Ok(Some((first.stamp, picture)));
        }
        Ok(None)
    }

    /// What lies in the surface already comes out all the same.
    fn flush(&mut self) -> Result<(), DecodeError> {
        self.inside.truncate(1);
        self.decoder.flush();
        Ok(())
    }
}
