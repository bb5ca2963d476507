//! Everything a shadecast client does on every platform: the sans-IO session
//! that pairs pictures with updates, and behind features the decoder, the
//! renderer, the thread that talks to the server and the frame loops of a headset
//! and of a phone in a viewer.

mod clock;
mod decode;
mod frame;
mod latency;
#[cfg(feature = "network")]
pub mod network;
#[cfg(all(feature = "openxr", not(target_vendor = "apple")))]
pub mod openxr;
#[cfg(feature = "render")]
pub mod render;
mod session;
#[cfg(feature = "network")]
pub mod settings;
mod steady;
#[cfg(all(feature = "viewer", not(target_vendor = "apple")))]
pub mod viewer;
mod world;
#[cfg(all(feature = "worn", not(target_vendor = "apple")))]
pub mod worn;

pub use clock::ClockEstimate;
#[cfg(feature = "openh264")]
pub use decode::OpenH264Decoder;
pub use decode::{
    AccessUnit, DecodeError, Decoded, Decoder, DecoderGone, DecoderThread, PlatformCodec,
    PlatformDecoder, StridedPlane, Ticket,
};
pub use frame::{
    ClientFrame, ClientTiming, DecodedPicture, DrawVertex, ForeignPicture, MaskAtlas, YuvPicture,
};
pub use latency::{Drawn, Latency, LatencySummary};
pub use session::{
    Disconnection, Failure, HeadView, Input, Output, Session, SessionConfig, Status,
};
pub use steady::Clock;
pub use world::{World, WorldError};
