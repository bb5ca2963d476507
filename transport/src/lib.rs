//! QUIC between the two ends, always under TLS 1.3: which message rides where.
//!
//! | message | rides on | because |
//! |---|---|---|
//! | hello, welcome, refusal, acknowledgement, reset request, bye | the one bidirectional stream | rare, small, in order |
//! | view report, clock reply | datagrams | a newer one makes an older one worthless |
//! | update | one long-lived stream, above pictures in priority | each builds on the one before; a picture without its update cannot be shown |
//! | picture | a stream each, an older one above a newer one | one lost packet holds up only the picture that it belongs to |
//!
//! Updates therefore arrive in order, and pictures each whole but in any
//! order; the frame ids of the updates say in which order to decode them.
//!
//! The crate knows the variants of a message and nothing of their meaning. A
//! peer that breaks a rule is disconnected with the rule's name, and whatever
//! it sends, the memory that it can claim is bounded by the constants in
//! `settings`.

mod client_end;
mod error;
mod frame;
mod identity;
mod line;
mod link;
mod listener;
mod pictures;
mod server_end;
mod settings;
#[cfg(test)]
mod tests;
mod tls;

pub use client_end::{ClientEnd, ReceivedBytes};
pub use error::TransportError;
pub use identity::Identity;
pub use line::{LineError, ServerLine};
pub use listener::Listener;
pub use server_end::{SentBytes, ServerEnd};
