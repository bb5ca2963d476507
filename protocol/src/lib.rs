//! What the two ends of shadecast say to each other.
//!
//! Ids, poses, blocks and messages, and the one function each that turns a
//! message into bytes and bytes into a message. Whatever has been parsed here
//! is bounded, finite and consistent, so that nothing behind this crate checks
//! a peer's word again. The crate does no IO, reads no clock and knows no GPU.

mod block;
mod check;
mod columns;
mod delta;
mod error;
mod ids;
mod message;
mod pose;
mod slot;
mod update;
mod wire;

pub use block::{Block, Level, MIN_LOG2_SIDE};
pub use error::WireError;
pub use ids::{ClientTime, Epoch, FrameId, ObjectId, PatchId, ServerTime, VertexId, ViewSeq};
pub use message::{
    Acknowledgement, ClockReply, Codec, Hand, Hello, Picture, Refusal, ResetReason, Secret, Sky,
    ToClient, ToServer, ViewReport, Welcome,
};
pub use pose::{EyeView, Fov, Motion, Pose};
pub use slot::{Method, SLOT_UNITS, Slot, TexelRectangle, TriangleSlot, UnknownMethod};
pub use update::{PatchGeometry, PatchShape, Placement, SlotMask, Update, UpdateTiming, Vertex};
pub use wire::{MAX_MESSAGE_BYTES, MAX_PATCHES, MAX_UPDATE_BYTES, MAX_VERTICES, PROTOCOL_VERSION};
