//! What a server is recognised by, kept in a file so that a restarted server
//! keeps its line.

use std::{
    fs::{self, OpenOptions},
    io::{ErrorKind, Write},
    path::Path,
};

use quinn::ServerConfig;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, PrivatePkcs8KeyDer};
use shadecast_protocol::Secret;

use crate::{TransportError, tls};

/// First line of the file.
const TITLE: &str = "shadecast identity 1";

/// A certificate with its key, and the secret that a client must know.
pub struct Identity {
    certificate: CertificateDer<'static>,
    key: PrivatePkcs8KeyDer<'static>,
    secret: Secret,
}

impl Identity {
    /// A new identity that nothing outlives.
    ///
    /// # Errors
    /// When the machine has no randomness.
    pub fn ephemeral() -> Result<Self, TransportError> {
        let made = rcgen::generate_simple_self_signed([tls::SERVER_NAME.to_owned()])
            .map_err(|error| TransportError::Cryptography(error.to_string()))?;
        let mut secret = [0; 16];
        getrandom::fill(&mut secret)
            .map_err(|error| TransportError::Cryptography(error.to_string()))?;
        Ok(Self {
            certificate: made.cert.der().clone(),
            key: made.signing_key.serialize_der().into(),
            secret: Secret(secret),
        })
    }

    /// The identity in the file at `path`, or a new one written there, for
    /// its owner's eyes only.
    ///
    /// # Errors
    /// When the file cannot be read or written, or holds something else.
    pub fn load_or_create(path: &Path) -> Result<Self, TransportError> {
        match fs::read_to_string(path) {
            Ok(text) => Self::parse(&text).ok_or_else(|| {
                file_error(
                    path,
                    "it is damaged or something else; delete it for a new one",
                )
            }),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let identity = Self::ephemeral()?;
                identity
                    .write(path)
                    .map_err(|error| file_error(path, error))?;
                Ok(identity)
            }
            Err(error) => Err(file_error(path, error)),
        }
    }

    /// SHA-256 of the certificate.
    pub(crate) fn fingerprint(&self) -> [u8; 32] {
        tls::fingerprint(&self.certificate)
    }

    pub(crate) fn secret(&self) -> Secret {
        self.secret
    }

    pub(crate) fn server_config(&self) -> Result<ServerConfig, rustls::Error> {
        let key = PrivateKeyDer::Pkcs8(self.key.clone_key());
        tls::server_config(self.certificate.clone(), key)
    }

    fn write(&self, path: &Path) -> std::io::Result<()> {
        let mut options = OpenOptions::new();
        options.write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let text = format!(
            "{TITLE}\ncertificate {}\nkey {}\nsecret {}\n",
            hex::encode(&self.certificate),
            hex::encode(self.key.secret_pkcs8_der()),
            hex::encode(self.secret.0),
        );
        options.open(path)?.write_all(text.as_bytes())
    }

    fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        if lines.next()? != TITLE {
            return None;
        }
        let mut field = |name| hex::decode(lines.next()?.strip_prefix(name)?).ok();
        let identity = Self {
            certificate: field("certificate ")?.into(),
            key: field("key ")?.into(),
            secret: Secret(field("secret ")?.try_into().ok()?),
        };
        // A key that does not belong to the certificate would fail every client.
        identity.server_config().ok()?;
        lines.next().is_none().then_some(identity)
    }
}

fn file_error(path: &Path, reason: impl ToString) -> TransportError {
    TransportError::IdentityFile {
        path: path.to_owned(),
        reason: reason.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    /// A path of our own, removed again at the end.
    struct Scratch(PathBuf);

    impl Scratch {
        fn new(name: &str) -> Self {
            let name = format!("shadecast-identity-{name}-{}", std::process::id());
            Self(std::env::temp_dir().join(name))
        }
    }

    impl Drop for Scratch {
        fn drop(&mut self) {
            let _ = fs::remove_file(&self.0);
        }
    }

    #[test]
    fn survives_a_restart() {
        let file = Scratch::new("restart");
        let before = Identity::load_or_create(&file.0).unwrap();
        let after = Identity::load_or_create(&file.0).unwrap();
        assert_eq!(before.fingerprint(), after.fingerprint());
        assert_eq!(before.secret(), after.secret());
    }

    #[cfg(unix)]
    #[test]
    fn is_for_its_owner_only() {
        use std::os::unix::fs::PermissionsExt;
        let file = Scratch::new("mode");
        Identity::load_or_create(&file.0).unwrap();
        let mode = fs::metadata(&file.0).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
    }

    #[test]
    fn refuses_a_damaged_file() {
        let file = Scratch::new("damaged");
        Identity::load_or_create(&file.0).unwrap();
        let whole = fs::read_to_string(&file.0).unwrap();
        let other_key = {
            let other = Identity::ephemeral().unwrap();
            let key = hex::encode(other.key.secret_pkcs8_der());
            let lines: Vec<_> = whole.lines().collect();
            [lines[0], lines[1], &format!("key {key}"), lines[3]].join("\n")
        };
        let damaged = [
            "",
            "a shopping list\n",
            &whole[..whole.len() / 2],
            &whole[..whole.len() - 3],
            &whole.replace("key ", "key zz"),
            &format!("{whole}more\n"),
            &other_key,
        ];
        for text in damaged {
            fs::write(&file.0, text).unwrap();
            let error = Identity::load_or_create(&file.0).err().unwrap();
            assert!(error.to_string().contains("delete it"), "{error}");
            assert_eq!(fs::read_to_string(&file.0).unwrap(), text, "left as it was");
        }
    }

    #[test]
    fn names_a_folder_that_is_not_there() {
        let path = Scratch::new("folder").0.join("deeper/identity");
        let error = Identity::load_or_create(&path).err().unwrap();
        assert!(error.to_string().contains("deeper"), "{error}");
    }
}
