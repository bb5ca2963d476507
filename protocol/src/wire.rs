//! Bytes and messages.
//!
//! Every message is one kind byte and its body. The first message of either
//! direction (a hello, a welcome or a refusal) stands behind a preamble, a
//! magic and the version, that no future version changes, so that two ends
//! that do not understand each other can always say so. Bodies are postcard,
//! except a [`Picture`], whose bytes follow its fields as they are, and an
//! [`Update`](crate::Update), which is laid out in columns (see `columns`).
//!
//! `encode` refuses what `decode` would refuse, so that a mistake shows at the
//! end that made it.

use serde::{Deserialize, Serialize};

use crate::{Picture, ToClient, ToServer, WireError, check, columns};

/// Version of this protocol; both ends must agree.
pub const PROTOCOL_VERSION: u16 = 4;
/// Longest message other than an update, bytes.
pub const MAX_MESSAGE_BYTES: usize = 8 << 20;
/// Longest update, both as it is sent and after decompression, bytes.
pub const MAX_UPDATE_BYTES: usize = 64 << 20;
/// Most patches that a session may know.
pub const MAX_PATCHES: u32 = 4 << 20;
/// Most vertices that a session may know.
pub const MAX_VERTICES: u32 = 8 << 20;

/// Begins the preamble; its first byte is no kind.
const MAGIC: &[u8] = b"shadecast";

/// Kinds of both directions; a number is never given to another message.
mod kind {
    pub(super) const HELLO: u8 = 1;
    pub(super) const VIEW: u8 = 2;
    pub(super) const ACKNOWLEDGE: u8 = 3;
    pub(super) const REQUEST_RESET: u8 = 4;
    pub(super) const BYE: u8 = 5;
    pub(super) const WELCOME: u8 = 16;
    pub(super) const REFUSED: u8 = 17;
    pub(super) const CLOCK: u8 = 18;
    pub(super) const UPDATE: u8 = 19;
    pub(super) const PICTURE: u8 = 20;
}

impl ToServer {
    /// The message as bytes.
    ///
    /// # Errors
    /// When the message breaks a rule that [`decode`](Self::decode) holds a peer to.
    pub fn encode(&self) -> Result<Vec<u8>, WireError> {
        match self {
            Self::Hello(hello) => {
                check::hello(hello)?;
                bounded("hello", body(opening(kind::HELLO), hello))
            }
            Self::View(view) => {
                check::view(view)?;
                bounded("view report", body(vec![kind::VIEW], view))
            }
            Self::Acknowledge(it) => bounded("acknowledgement", body(vec![kind::ACKNOWLEDGE], it)),
            Self::RequestReset(reason) => {
                bounded("reset request", body(vec![kind::REQUEST_RESET], reason))
            }
            Self::Bye => Ok(vec![kind::BYE]),
        }
    }

    /// The message that `bytes` are, checked so that nothing behind it needs to.
    ///
    /// # Errors
    /// When the bytes are not exactly one message, or one with an impossible value.
    pub fn decode(bytes: &[u8]) -> Result<Self, WireError> {
        Ok(match split(bytes)? {
            (true, kind::HELLO, body) => {
                let hello = parse("hello", body)?;
                check::hello(&hello)?;
                Self::Hello(hello)
            }
            (false, kind::VIEW, body) => {
                let view = parse("view report", body)?;
                check::view(&view)?;
                Self::View(view)
            }
            (false, kind::ACKNOWLEDGE, body) => Self::Acknowledge(parse("acknowledgement", body)?),
            (false, kind::REQUEST_RESET, body) => Self::RequestReset(parse("reset request", body)?),
            (false, kind::BYE, body) => {
                parse::<()>("bye", body)?;
                Self::Bye
            }
            _ => return Err(WireError::NotShadecast),
        })
    }
}

impl ToClient {
    /// The message as bytes.
    ///
    /// # Errors
    /// When the message breaks a rule that [`decode`](Self::decode) holds a peer to.
    pub fn encode(&self) -> Result<Vec<u8>, WireError> {
        match self {
            Self::Welcome(welcome) => {
                check::welcome(welcome)?;
                bounded("welcome", body(opening(kind::WELCOME), welcome))
            }
            Self::Refused(refusal) => bounded("refusal", body(opening(kind::REFUSED), refusal)),
            Self::Clock(reply) => {
                check::clock(reply)?;
                bounded("clock reply", body(vec![kind::CLOCK], reply))
            }
            Self::Update(update) => columns::encode(update, vec![kind::UPDATE]),
            Self::Picture(picture) => {
                check::picture(picture)?;
                let fields = (picture.frame, picture.epoch, picture.idr);
                let mut bytes = body(vec![kind::PICTURE], &fields);
                bytes.extend_from_slice(&picture.bytes);
                bounded("picture", bytes)
            }
            Self::Bye => Ok(vec![kind::BYE]),
        }
    }

    /// The message that `bytes` are, checked so that nothing behind it needs to.
    ///
    /// # Errors
    /// When the bytes are not exactly one message, or one with an impossible value.
    pub fn decode(bytes: &[u8]) -> Result<Self, WireError> {
        Ok(match split(bytes)? {
            (true, kind::WELCOME, body) => {
                let welcome = parse("welcome", body)?;
                check::welcome(&welcome)?;
                Self::Welcome(welcome)
            }
            (true, kind::REFUSED, body) => Self::Refused(parse("refusal", body)?),
            (false, kind::CLOCK, body) => {
                let reply = parse("clock reply", body)?;
                check::clock(&reply)?;
                Self::Clock(reply)
            }
            (false, kind::UPDATE, body) => Self::Update(columns::decode(body)?),
            (false, kind::PICTURE, body) => Self::Picture(picture(body)?),
            (false, kind::BYE, body) => {
                parse::<()>("bye", body)?;
                Self::Bye
            }
            _ => return Err(WireError::NotShadecast),
        })
    }
}

/// The preamble and the kind that follows it.
fn opening(kind: u8) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend_from_slice(&PROTOCOL_VERSION.to_le_bytes());
    bytes.push(kind);
    bytes
}

/// Whether the message has a preamble, its kind and its body.
fn split(bytes: &[u8]) -> Result<(bool, u8, &[u8]), WireError> {
    let (opens, rest) = match bytes.strip_prefix(MAGIC) {
        None => (false, bytes),
        Some(rest) => {
            let (version, rest) = rest.split_first_chunk().ok_or(WireError::NotShadecast)?;
            let peer = u16::from_le_bytes(*version);
            if peer != PROTOCOL_VERSION {
                return Err(WireError::Version { peer });
            }
            (true, rest)
        }
    };
    let (&kind, body) = rest.split_first().ok_or(WireError::NotShadecast)?;
    if kind != kind::UPDATE {
        within("message", bytes.len(), MAX_MESSAGE_BYTES)?;
    }
    Ok((opens, kind, body))
}

/// `head` with `value` appended.
fn body<T: Serialize>(head: Vec<u8>, value: &T) -> Vec<u8> {
    postcard::to_extend(value, head).expect("writing plain data to memory does not fail")
}

/// The one value that `bytes` are.
pub(crate) fn parse<'a, T: Deserialize<'a>>(
    what: &'static str,
    bytes: &'a [u8],
) -> Result<T, WireError> {
    match postcard::take_from_bytes(bytes) {
        Ok((value, [])) => Ok(value),
        _ => Err(WireError::Malformed { what }),
    }
}

fn picture(body: &[u8]) -> Result<Picture, WireError> {
    let ((frame, epoch, idr), bytes) =
        postcard::take_from_bytes(body).map_err(|_| WireError::Malformed { what: "picture" })?;
    let picture = Picture {
        frame,
        epoch,
        idr,
        bytes: bytes.to_vec(),
    };
    check::picture(&picture)?;
    Ok(picture)
}

fn bounded(what: &'static str, bytes: Vec<u8>) -> Result<Vec<u8>, WireError> {
    within(what, bytes.len(), MAX_MESSAGE_BYTES)?;
    Ok(bytes)
}

/// Refuses a `size` above `limit`.
pub(crate) fn within(what: &'static str, size: usize, limit: usize) -> Result<(), WireError> {
    if size > limit {
        return Err(WireError::TooLarge { what, size, limit });
    }
    Ok(())
}
