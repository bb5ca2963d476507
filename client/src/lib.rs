//! Everything a shadecast client does on every platform: the sans-IO session
//! that pairs pictures with updates, and behind features the decoder and the
//! renderer.

mod clock;
mod decode;
mod frame;
mod latency;
#[cfg(feature = "render")]
pub mod render;
mod session;
mod world;

pub use clock::ClockEstimate;
#[cfg(feature = "openh264")]
pub use decode::OpenH264Decoder;
pub use decode::{
    AccessUnit, DecodeError, Decoded, Decoder, DecoderGone, DecoderThread, PlatformCodec,
    PlatformDecoder, Ticket,
};
pub use frame::{
    ClientFrame, ClientTiming, DecodedPicture, DrawVertex, ForeignPicture, MaskAtlas, YuvPicture,
};
pub use latency::{Drawn, Latency, LatencySummary};
pub use session::{
    Disconnection, Failure, HeadView, Input, Output, Session, SessionConfig, Status,
};
pub use world::{World, WorldError};
