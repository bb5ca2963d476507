//! The one line that a server prints and a client is started with.

use std::{fmt, net::SocketAddr, str::FromStr};

use shadecast_protocol::Secret;
use thiserror::Error;

const SCHEME: &str = "shadecast://";

/// Where a server is, how to recognise it, and the proof that one was invited.
///
/// Reads and writes as `shadecast://ADDRESS:PORT/?fingerprint=HEX&secret=HEX`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServerLine {
    /// Where it listens.
    pub address: SocketAddr,
    /// SHA-256 of its certificate.
    pub fingerprint: [u8; 32],
    /// What it asks of a client.
    pub secret: Secret,
}

impl fmt::Display for ServerLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{SCHEME}{}/?fingerprint={}&secret={}",
            self.address,
            hex::encode(self.fingerprint),
            hex::encode(self.secret.0)
        )
    }
}

/// What is wrong with a server's line.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum LineError {
    /// It begins otherwise.
    #[error("a server's line begins with {SCHEME}")]
    Scheme,
    /// No address and port can be read.
    #[error("the server's line has no valid ADDRESS:PORT, but {0:?}")]
    Address(String),
    /// A part is missing.
    #[error("the server's line has no {0}: was it copied whole?")]
    Missing(&'static str),
    /// A part is not as many hexadecimal digits as it should be.
    #[error("the {name} in the server's line is not {digits} hexadecimal digits")]
    Hex {
        /// The part.
        name: &'static str,
        /// How many it should have.
        digits: usize,
    },
    /// A part that no line has.
    #[error("the server's line has a part that is not understood: {0:?}")]
    Unknown(String),
}

impl FromStr for ServerLine {
    type Err = LineError;

    fn from_str(line: &str) -> Result<Self, LineError> {
        let line = line.trim();
        let rest = line.strip_prefix(SCHEME).ok_or(LineError::Scheme)?;
        let (address, query) = rest.split_once("/?").unwrap_or((rest, ""));
        let address = address
            .parse()
            .ok()
            .filter(|address: &SocketAddr| address.port() != 0)
            .ok_or_else(|| LineError::Address(address.to_owned()))?;

        let (mut fingerprint, mut secret) = (None, None);
        for part in query.split('&').filter(|part| !part.is_empty()) {
            match part.split_once('=') {
                Some(("fingerprint", digits)) => fingerprint = Some(bytes("fingerprint", digits)?),
                Some(("secret", digits)) => secret = Some(bytes("secret", digits)?),
                _ => return Err(LineError::Unknown(part.to_owned())),
            }
        }
        Ok(Self {
            address,
            fingerprint: fingerprint.ok_or(LineError::Missing("fingerprint"))?,
            secret: Secret(secret.ok_or(LineError::Missing("secret"))?),
        })
    }
}

fn bytes<const N: usize>(name: &'static str, digits: &str) -> Result<[u8; N], LineError> {
    let mut bytes = [0; N];
    hex::decode_to_slice(digits, &mut bytes).map_err(|_| LineError::Hex {
        name,
        digits: 2 * N,
    })?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> ServerLine {
        ServerLine {
            address: SocketAddr::from(([192, 168, 1, 20], 4433)),
            fingerprint: [0xab; 32],
            secret: Secret([0xcd; 16]),
        }
    }

    #[test]
    fn survives_being_printed() {
        assert_eq!(line().to_string().parse(), Ok(line()));
        let address = "[::1]:4433".parse().unwrap();
        let line = ServerLine { address, ..line() };
        assert_eq!(format!(" {line}\n").parse(), Ok(line));
    }

    #[test]
    fn keeps_the_secret_out_of_logs() {
        let digits = hex::encode(line().secret.0);
        assert!(!format!("{:?}", line()).contains(&digits));
    }

    #[test]
    fn names_what_is_wrong() {
        let whole = line().to_string();
        let refused = |line: &str| line.parse::<ServerLine>().unwrap_err();
        assert_eq!(refused("https://example.org"), LineError::Scheme);
        assert_eq!(refused(""), LineError::Scheme);
        assert_eq!(
            refused(&whole.replace("4433", "99999")),
            LineError::Address("192.168.1.20:99999".into())
        );
        assert_eq!(
            refused(&whole.replace("4433", "0")),
            LineError::Address("192.168.1.20:0".into())
        );
        let (without_secret, _) = whole.split_once("&secret").unwrap();
        assert_eq!(refused(without_secret), LineError::Missing("secret"));
        assert_eq!(
            refused("shadecast://1.2.3.4:5"),
            LineError::Missing("fingerprint")
        );
        let cut = &whole[..whole.len() - 1];
        let name = "secret";
        assert_eq!(refused(cut), LineError::Hex { name, digits: 32 });
        assert_eq!(
            refused(&format!("{whole}&colour=red")),
            LineError::Unknown("colour=red".into())
        );
    }
}
