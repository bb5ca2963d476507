//! Which server a client without a command line goes to.
//!
//! It looks in several places, and the first one that says something counts,
//! even where that is wrong: whoever wrote it there wants to know, and not to
//! end up at another server.

use std::path::PathBuf;

use shadecast_transport::{LineError, ServerLine};
use thiserror::Error;

/// Somewhere that may hold a server's line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// How its user knows it.
    pub name: String,
    /// What it holds; none where there is nothing.
    pub text: Option<String>,
}

/// Why there is no server to go to.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum NoServer {
    /// No place says anything.
    #[error("No server is named: {}", .0.join(", or "))]
    Unnamed(Vec<String>),
    /// The place that counts holds something else.
    #[error("In {place}: {error}")]
    Malformed {
        /// The place.
        place: String,
        /// What is wrong with it.
        error: LineError,
    },
}

/// Its name in either folder of an app.
const FILE: &str = "server.txt";

/// Finds the line of an app: what started it may say one, its user may have left a
/// file in the folder that others see, and it remembers the last one in its own.
///
/// # Errors
/// When there is none, or it is no server's line.
pub fn find(
    extra: Option<String>,
    shared: Option<PathBuf>,
    own: Option<PathBuf>,
) -> Result<ServerLine, NoServer> {
    let [file, memory] = [shared, own].map(|folder| folder.map(|folder| folder.join(FILE)));
    let read = |path: &Option<PathBuf>| std::fs::read_to_string(path.as_ref()?).ok();
    let line = server_line(&[
        Place {
            name: "the extra \"server\" of the intent".into(),
            text: extra,
        },
        Place {
            name: file.as_ref().map_or_else(
                || FILE.into(),
                |path| format!("the file {}", path.display()),
            ),
            text: read(&file),
        },
        Place {
            name: "what was remembered".into(),
            text: read(&memory),
        },
    ])?;
    if let Some(memory) = memory
        && let Err(error) = std::fs::write(&memory, line.to_string())
    {
        tracing::warn!("the server will not be remembered: {error}");
    }
    Ok(line)
}

/// The line in the first of the places that says something. Lines that begin
/// with # are comments, and quotes around the line come from a shell.
///
/// # Errors
/// When there is none, or it is no server's line.
pub fn server_line(places: &[Place]) -> Result<ServerLine, NoServer> {
    let said = places.iter().find_map(|place| {
        let line = place.text.as_deref()?.lines().map(str::trim);
        let line = line.filter(|line| !line.is_empty() && !line.starts_with('#'));
        Some((
            place,
            line.map(|line| line.trim_matches(['"', '\''])).next()?,
        ))
    });
    match said {
        None => Err(NoServer::Unnamed(
            places.iter().map(|place| place.name.clone()).collect(),
        )),
        Some((place, line)) => line.parse().map_err(|error| NoServer::Malformed {
            place: place.name.clone(),
            error,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(port: u16) -> String {
        let (fingerprint, secret) = ("ab".repeat(32), "cd".repeat(16));
        format!("shadecast://192.168.1.2:{port}/?fingerprint={fingerprint}&secret={secret}")
    }

    fn places(texts: [Option<&str>; 3]) -> [Place; 3] {
        let mut names = ["the intent", "the file", "memory"].into_iter();
        texts.map(|text| Place {
            name: names.next().unwrap_or_default().into(),
            text: text.map(Into::into),
        })
    }

    fn port(texts: [Option<&str>; 3]) -> Option<u16> {
        let line = server_line(&places(texts)).ok()?;
        Some(line.address.port())
    }

    #[test]
    fn the_first_place_that_says_something_counts() {
        let [one, two] = [line(1), line(2)];
        assert_eq!(port([Some(&one), Some(&two), None]), Some(1));
        assert_eq!(port([None, Some(&two), Some(&one)]), Some(2));
        assert_eq!(port([Some(" \n\n"), Some("# none"), Some(&one)]), Some(1));
    }

    #[test]
    fn an_app_remembers_the_line_that_it_was_started_with() {
        let folder = std::env::temp_dir().join(format!("shadecast-{}", std::process::id()));
        let [shared, own] = ["shared", "own"].map(|name| folder.join(name));
        for folder in [&shared, &own] {
            std::fs::create_dir_all(folder).unwrap();
        }
        let find = |extra: Option<&str>| {
            super::find(
                extra.map(Into::into),
                Some(shared.clone()),
                Some(own.clone()),
            )
        };
        let said = find(None).unwrap_err().to_string();
        assert!(said.contains("shared/server.txt, or what was"), "{said}");
        assert_eq!(find(Some(&line(1))).unwrap().address.port(), 1);
        assert_eq!(find(None).unwrap().address.port(), 1, "remembered");
        std::fs::write(shared.join(FILE), line(2)).unwrap();
        assert_eq!(find(None).unwrap().address.port(), 2, "left by its user");
        std::fs::write(shared.join(FILE), "nonsense").unwrap();
        assert!(find(None).is_err(), "what is wrong is said");
        std::fs::remove_dir_all(&folder).unwrap();
        // Without folders there is nothing to remember by, and no harm.
        let line = super::find(Some(line(3)), None, None).unwrap();
        assert_eq!(line.address.port(), 3);
    }

    #[test]
    fn comments_quotes_and_line_ends_do_not_matter() {
        let text = format!("\u{20}# the one upstairs\r\n\r\n '{}' \r\nmore\n", line(7));
        assert_eq!(port([None, Some(&text), None]), Some(7));
    }

    #[test]
    fn what_is_wrong_is_said_and_not_passed_over() {
        let good = line(1);
        let cut = &good[..good.len() - 1];
        let error = server_line(&places([None, Some(cut), Some(&good)])).unwrap_err();
        let message = error.to_string();
        assert!(message.starts_with("In the file: "), "{message}");
        assert!(message.contains("32 hexadecimal digits"), "{message}");
        let none = server_line(&places([None; 3])).unwrap_err();
        let message = none.to_string();
        assert_eq!(
            message,
            "No server is named: the intent, or the file, or memory"
        );
    }
}
