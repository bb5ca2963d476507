//! Why a connection does not begin or go on.

use std::{net::SocketAddr, path::PathBuf};

use quinn::ConnectionError;
use shadecast_protocol::WireError;
use thiserror::Error;

use crate::settings::{HANDSHAKE_TIMEOUT, IDLE_TIMEOUT};

/// What a caller can tell its user, or act upon.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum TransportError {
    /// Another program listens there: choose another port or end that program.
    #[error("the address {0} is in use by another program")]
    AddressInUse(SocketAddr),
    /// The address cannot be listened on or reached from.
    #[error("cannot use the address {address}: {reason}")]
    Address {
        /// The address.
        address: SocketAddr,
        /// What the system says.
        reason: String,
    },
    /// A file that holds an identity cannot be used.
    #[error("the identity file {}: {reason}", path.display())]
    IdentityFile {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and what to do.
        reason: String,
    },
    /// TLS or the random generator of this machine does not work.
    #[error("cryptography is not available: {0}")]
    Cryptography(String),
    /// Nobody answers at the address.
    #[error("no server answers at {0} within {s} s", s = HANDSHAKE_TIMEOUT.as_secs())]
    NoAnswer(SocketAddr),
    /// Whoever answers does not hold the certificate that the line names.
    #[error("the server at {0} has another fingerprint than its line says: use its newest line")]
    WrongFingerprint(SocketAddr),
    /// The peer sent what is no message.
    #[error(transparent)]
    Wire(#[from] WireError),
    /// The peer broke a rule of the transport.
    #[error("the peer {0}")]
    Misbehaved(&'static str),
    /// The peer ended the connection.
    #[error("the peer closed the connection: {0}")]
    ClosedByPeer(String),
    /// This end ended the connection.
    #[error("the connection was closed here")]
    ClosedHere,
    /// The peer fell silent.
    #[error("the peer vanished: nothing heard from it for {s} s", s = IDLE_TIMEOUT.as_secs())]
    Vanished,
    /// QUIC failed.
    #[error("the connection failed: {0}")]
    Failed(String),
}

impl From<ConnectionError> for TransportError {
    fn from(error: ConnectionError) -> Self {
        match error {
            ConnectionError::ApplicationClosed(close) => {
                Self::ClosedByPeer(String::from_utf8_lossy(&close.reason).into_owned())
            }
            ConnectionError::ConnectionClosed(close) => Self::ClosedByPeer(close.to_string()),
            ConnectionError::LocallyClosed => Self::ClosedHere,
            ConnectionError::TimedOut => Self::Vanished,
            ConnectionError::Reset => {
                Self::ClosedByPeer("it no longer knows the connection".into())
            }
            other => Self::Failed(other.to_string()),
        }
    }
}
