//! The page for whoever first runs the APK on a device names log lines to look for:
//! each of them is one that the client can write.

use std::path::{Path, PathBuf};
use std::time::Duration;

use shadecast_client::Status;
use shadecast_client::render::Optics;
use shadecast_protocol::ResetReason;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// All Rust below a folder.
fn sources(folder: &Path) -> String {
    let mut all = String::new();
    for entry in std::fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            all += &sources(&path);
        } else if path.extension().is_some_and(|kind| kind == "rs") {
            all += &read(&path);
        }
    }
    all
}

/// What is between the marks, as often as there is something.
fn between(text: &str, mark: char) -> impl Iterator<Item = &str> {
    text.split(mark).skip(1).step_by(2)
}

/// Formats of all that is logged.
fn formats(source: &str) -> Vec<String> {
    let mut formats: Vec<String> = ["info", "warn", "error"]
        .into_iter()
        .flat_map(|level| {
            source
                .split(&format!("tracing::{level}!("))
                .skip(1)
                .collect::<Vec<_>>()
        })
        .filter_map(|call| {
            between(call.split(");").next()?, '"')
                .next()
                .map(Into::into)
        })
        .collect();
    // One that is nothing but a value.
    formats.retain(|format| !format.starts_with('{') || format.contains(": "));
    let statuses = [
        Status::Connecting,
        Status::Filling,
        Status::Streaming,
        Status::Recovering(ResetReason::Gap),
        Status::Resting,
        Status::Reconnecting {
            reason: "why".into(),
            after: Duration::from_secs(1),
        },
    ];
    assert!(source.contains(r#"tracing::info!("{status:?}")"#));
    formats.extend(statuses.map(|status| {
        let text = format!("{status:?}");
        text.split(' ').next().unwrap_or_default().to_owned()
    }));
    formats
}

/// Whether a line of this format can read so. Each `{…}` of the format stands for
/// anything, and each … of what is written for whatever was left out.
fn can_read(format: &str, written: &str) -> bool {
    let Some(first) = format.chars().next() else {
        return written.is_empty();
    };
    if let Some(rest) = written.strip_prefix('…') {
        return (0..=format.len())
            .filter(|at| format.is_char_boundary(*at))
            .any(|at| can_read(&format[at..], rest));
    }
    if first == '{' {
        let rest = format.split_once('}').map_or("", |(_, rest)| rest);
        return (0..=written.len())
            .filter(|at| written.is_char_boundary(*at))
            .any(|at| can_read(rest, &written[at..]));
    }
    match written.strip_prefix(first) {
        Some(written) => can_read(&format[first.len_utf8()..], written),
        None => false,
    }
}

/// Without the fields that a line ends with, and what is inside of a value.
fn sentence(written: &str) -> &str {
    let end = written.find('=').and_then(|at| written[..at].rfind(' '));
    let written = end.map_or(written, |end| &written[..end]);
    written.split(" {").next().unwrap_or(written).trim_end()
}

#[test]
fn formats_and_what_is_written_are_held_against_each_other() {
    assert!(can_read("a {b} c {d:?}", "a 1 c Some(2)"));
    assert!(can_read("cannot {what}: {why}", "cannot do it: …"));
    assert!(!can_read("a {b} c", "a 1 d"));
    assert!(!can_read("paused", "pause"));
    assert_eq!(
        sentence("a frame is lost missing=Decoded(…)"),
        "a frame is lost"
    );
    assert_eq!(sentence("Reconnecting { … }"), "Reconnecting");
}

#[test]
fn every_log_line_that_is_to_be_looked_for_is_one_of_the_client() {
    let page = read(&root().join("docs/headset.md"));
    let (_, steps) = page
        .split_once("## The first ten minutes")
        .expect("the steps");
    let source = ["android-client/src", "client/src"]
        .map(|folder| sources(&root().join(folder)))
        .concat();
    let formats = formats(&source);
    assert!(formats.len() > 20, "{formats:?}");

    let rows: Vec<&str> = steps
        .lines()
        .filter(|line| line.starts_with("| "))
        .collect();
    let steps_of_rows = rows.iter().filter(|row| {
        let number = row.split('|').nth(1).unwrap_or_default().trim();
        number.parse::<u32>().is_ok()
    });
    assert_eq!(steps_of_rows.clone().count(), 10);
    let expected = steps_of_rows.map(|row| row.rsplit(" | ").next().unwrap_or_default());
    // What goes wrong begins with a line of the log, if it names one at its beginning.
    let troubles = steps.lines().filter(|line| line.starts_with("- `"));
    let troubles = troubles.map(|line| line.split("`:").next().unwrap_or(line));
    let troubles = troubles.map(|line| line.split("`,").next().unwrap_or(line));
    let mut looked_for = 0;
    for part in expected.chain(troubles) {
        let part = if part.starts_with("- `") && part.matches('`').count() == 1 {
            format!("{part}`")
        } else {
            part.to_owned()
        };
        for written in between(&part, '`') {
            if written.starts_with("adb ") {
                continue;
            }
            looked_for += 1;
            let found = formats
                .iter()
                .any(|format| can_read(format, sentence(written)) || can_read(format, written));
            assert!(found, "nothing logs {written:?}");
        }
    }
    assert!(looked_for >= 18, "{looked_for}");
    for panel in between(steps, '*').filter(|text| text.len() > 3) {
        assert!(source.contains(panel), "no panel says {panel:?}");
    }
}

#[test]
fn names_on_the_page_are_those_of_the_sources() {
    let page = read(&root().join("docs/headset.md"));
    let versions = read(&root().join("gradle/gradle/libs.versions.toml"));
    let application = versions
        .lines()
        .find_map(|line| line.strip_prefix("applicationId = "))
        .expect("the catalogue names it")
        .trim_matches('"');
    assert!(page.contains(&format!("{application}/android.app.NativeActivity")));
    assert!(page.contains(&format!(
        "/sdcard/Android/data/{application}/files/server.txt"
    )));
    let settings = read(&root().join("client/src/settings.rs"));
    assert!(settings.contains(r#"FILE: &str = "server.txt""#));
    let java = read(&root().join("android-client/src/java.rs"));
    assert!(java.contains(r#"new_string("server")"#) && page.contains("--es server"));
    let phone = read(&root().join("android-client/src/phone.rs"));
    assert!(phone.contains(&format!(r#"PACKAGE: &str = "{application}""#)));
    assert!(phone.contains(r#"FILE: &str = "viewer.json""#) && page.contains("`viewer.json`"));
    let viewer = page
        .lines()
        .find(|line| line.starts_with("{\"between_lenses\""));
    let viewer: Optics = serde_json::from_str(viewer.expect("a viewer")).expect("of these names");
    assert_eq!(viewer, Optics::CARDBOARD);
    let library = read(&root().join("android-client/src/lib.rs"));
    assert!(library.contains("shadecast {} begins") && page.contains("shadecast 0.1.0 begins"));
    assert!(page.contains(&format!("shadecast {} begins", env!("CARGO_PKG_VERSION"))));
    for path in [
        "client/src/render/foreign/sampler.rs",
        "client/src/render/foreign/hardware_buffer.rs",
        "android-client/src/codec.rs",
    ] {
        let name = path.rsplit('/').next().expect("a file");
        assert!(page.contains(name) && root().join(path).exists(), "{path}");
    }
}
