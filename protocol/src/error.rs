//! Why bytes are not a message.

use thiserror::Error;

/// What was wrong with the bytes or the message of a peer. The connection can
/// be closed with it; nothing was applied.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum WireError {
    /// The peer is not shadecast at all.
    #[error("the peer does not speak shadecast")]
    NotShadecast,
    /// The peer speaks another version.
    #[error(
        "the peer speaks protocol version {peer}, this end speaks {}",
        crate::PROTOCOL_VERSION
    )]
    Version {
        /// What the peer speaks.
        peer: u16,
    },
    /// A message or a list in it is longer than the protocol allows.
    #[error("{what} of {size} exceeds the limit of {limit}")]
    TooLarge {
        /// The message or list.
        what: &'static str,
        /// Its size.
        size: usize,
        /// The largest allowed.
        limit: usize,
    },
    /// The bytes do not parse.
    #[error("malformed {what}")]
    Malformed {
        /// The message.
        what: &'static str,
    },
    /// A number in the message is impossible.
    #[error("invalid {what} in {message}")]
    Invalid {
        /// The message.
        message: &'static str,
        /// The field.
        what: &'static str,
    },
}
