//! From access units to pictures.
//!
//! A decoder is asked for one picture per access unit, in order: the stream has
//! no B frames and no delay. Whatever goes wrong with a unit comes back as the
//! result of that unit, so that the session can ask for a new start. Decoders of
//! the platform (MediaCodec) answer later than they are asked, hence the split
//! into [`Decoder::send`] and [`Decoder::poll`]; what else they do to the order
//! of things, [`PlatformDecoder`] undoes. All pass the tests in `conformance`.

#[cfg(all(test, feature = "openh264"))]
mod conformance;
#[cfg(feature = "openh264")]
mod openh264;
mod planes;
mod platform;
mod thread;

use shadecast_protocol::FrameId;
use thiserror::Error;

use crate::DecodedPicture;

#[cfg(feature = "openh264")]
pub use self::openh264::OpenH264Decoder;
pub use planes::StridedPlane;
pub use platform::{PlatformCodec, PlatformDecoder};
pub use thread::{DecoderGone, DecoderThread};

/// Names an access unit on its way through a decoder.
///
/// Frames count from the start again when a server restarts, so the connection
/// belongs to the name: a late picture of an old one is not mistaken for a new.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Ticket {
    /// Counts the connections of the session.
    pub connection: u32,
    /// The frame that the picture belongs to.
    pub frame: FrameId,
}

/// What a decoder is given for one picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AccessUnit {
    /// Comes back with the picture.
    pub ticket: Ticket,
    /// True for an IDR picture before which everything is to be forgotten: the
    /// first of a connection, and the first after a reset.
    pub restart: bool,
    /// Width and height that the picture must have, texels.
    pub size: [u16; 2],
    /// H.264, annex B byte stream.
    pub bytes: Vec<u8>,
}

/// What became of an access unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded {
    /// The unit.
    pub ticket: Ticket,
    /// Its picture.
    pub picture: Result<DecodedPicture, DecodeError>,
}

/// Why an access unit gave no picture. The stream can go on at the next
/// restart.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum DecodeError {
    /// The bytes are not what they should be, or refer to pictures that are
    /// missing.
    #[error("the video decoder refused the picture: {0}")]
    Refused(String),
    /// The decoder took the bytes but gave no picture for them.
    #[error("the video decoder gave no picture")]
    NoPicture,
    /// The stream is not of the atlas that was announced.
    #[error("the picture is {}x{} texels instead of {}x{}", found[0], found[1], expected[0], expected[1])]
    Size {
        /// Width and height that were announced.
        expected: [u32; 2],
        /// Width and height that were decoded.
        found: [u32; 2],
    },
    /// The decoder cannot be made to work.
    #[error("no video decoder: {0}")]
    Unavailable(String),
}

/// A video decoder.
///
/// Every unit that was sent comes back at most once from `poll`, in the order of
/// sending, and not after a [`flush`](Self::flush) that came between. One that
/// never comes back was the last: a later one takes it with it, or the session
/// loses patience. It may be dropped with units inside.
pub trait Decoder {
    /// Takes the next access unit.
    fn send(&mut self, unit: AccessUnit);

    /// The next result that is ready; does not wait for one.
    fn poll(&mut self) -> Option<Decoded>;

    /// Forgets the units that have not come back and all reference pictures;
    /// the next unit is an IDR picture.
    fn flush(&mut self);
}
