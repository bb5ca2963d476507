//! Messages on a stream that carries several: a length, u32 little-endian,
//! and as many bytes.

use quinn::{ReadExactError, RecvStream};

use crate::TransportError;

const BROKEN_OFF: TransportError =
    TransportError::Misbehaved("broke off in the middle of a message");
const TOO_LONG: TransportError = TransportError::Misbehaved("sent a message that is too long");

/// A message behind its length.
pub(crate) fn framed(message: &[u8]) -> Vec<u8> {
    let length = u32::try_from(message.len()).expect("the protocol bounds messages below 4 GiB");
    [&length.to_le_bytes(), message].concat()
}

/// The next message, or `None` where the stream ends. Memory grows with what
/// has really arrived, not with the length that the peer claims.
pub(crate) async fn read_frame(
    stream: &mut RecvStream,
    limit: usize,
) -> Result<Option<Vec<u8>>, TransportError> {
    let mut length = [0; 4];
    match stream.read_exact(&mut length).await {
        Ok(()) => {}
        Err(ReadExactError::FinishedEarly(0)) => return Ok(None),
        Err(ReadExactError::FinishedEarly(_)) => return Err(BROKEN_OFF),
        Err(ReadExactError::ReadError(error)) => return Err(error.into()),
    }
    let length = u32::from_le_bytes(length) as usize;
    if length > limit {
        return Err(TOO_LONG);
    }
    let mut message = Vec::new();
    while message.len() < length {
        let chunk = stream.read_chunk(length - message.len(), true).await?;
        message.extend_from_slice(&chunk.ok_or(BROKEN_OFF)?.bytes);
    }
    Ok(Some(message))
}

/// All that is left of a stream.
pub(crate) async fn read_rest(
    stream: &mut RecvStream,
    limit: usize,
) -> Result<Vec<u8>, TransportError> {
    let mut message = Vec::new();
    while let Some(chunk) = stream.read_chunk(usize::MAX, true).await? {
        if message.len() + chunk.bytes.len() > limit {
            return Err(TOO_LONG);
        }
        message.extend_from_slice(&chunk.bytes);
    }
    Ok(message)
}
