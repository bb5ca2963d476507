//! Pictures of the atlas as video.
//!
//! Limited-range BT.709, signalled in the stream; one reference picture, no
//! B-frames, an IDR picture only on demand. The deblocking filter is off: it
//! would smear one block of the atlas into its neighbours.

mod software;

use thiserror::Error;

pub use software::OpenH264;

/// The planes of a 4:2:0 picture, one after the other, without padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Planes {
    /// In texels, a multiple of 16.
    pub width: u32,
    /// In texels, a multiple of 16.
    pub height: u32,
    /// Y, then U, then V.
    pub bytes: Vec<u8>,
}

impl Planes {
    /// Luma.
    #[must_use]
    pub fn y(&self) -> &[u8] {
        &self.bytes[..self.luma()]
    }

    /// Blue difference.
    #[must_use]
    pub fn u(&self) -> &[u8] {
        &self.bytes[self.luma()..self.luma() * 5 / 4]
    }

    /// Red difference.
    #[must_use]
    pub fn v(&self) -> &[u8] {
        &self.bytes[self.luma() * 5 / 4..]
    }

    fn luma(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// One access unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EncodedPicture {
    /// Annex B byte stream.
    pub bytes: Vec<u8>,
    /// True when it needs no picture before it.
    pub idr: bool,
}

/// Why a picture was not encoded.
#[derive(Debug, Error)]
#[error("the video encoder failed: {0}")]
pub struct EncodeError(pub String);

/// Turns pictures into a stream.
pub trait VideoEncoder: Send {
    /// Encodes the next picture; with `idr` one that needs none before it.
    ///
    /// # Errors
    /// When the encoder fails; the next picture should then be an IDR one.
    fn encode(&mut self, planes: &Planes, idr: bool) -> Result<EncodedPicture, EncodeError>;
}
