//! The binary in a headset: through the system's own OpenXR loader, which finds
//! the simulated runtime as a shared library.

mod wall_server;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use wall_server::{Mishap, WallServer};

/// The runtime's library, which cargo builds beside this test.
fn library() -> PathBuf {
    let test = std::env::current_exe().expect("this test has a path");
    let folder = test.parent().expect("it is in a folder");
    let library = folder.join(format!(
        "{}shadecast_simulated_runtime{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    ));
    assert!(library.exists(), "{} is missing", library.display());
    library
}

/// What a runtime's installer writes.
fn manifest(folder: &Path) -> PathBuf {
    let path = folder.join("runtime.json");
    let text = serde_json::json!({
        "file_format_version": "1.0.0",
        "runtime": { "library_path": library() },
    });
    std::fs::write(&path, text.to_string()).expect("the folder is writable");
    path
}

/// An empty folder of this test.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("the target folder is writable");
    folder
}

/// Runs until the simulated user leaves, after so many frames.
fn wear(line: &str, manifest: &Path, frames: u32, log: &Path, rest: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_shadecast-desktop"))
        .args([line, "--openxr"])
        .args(rest)
        .env("XR_RUNTIME_JSON", manifest)
        .env("SHADECAST_SIM_FRAMES", frames.to_string())
        .env("SHADECAST_SIM_LOG", log)
        .output()
        .expect("the binary was built")
}

fn said(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    assert!(!said.contains("panicked"), "{said}");
    said
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_headset_by_the_systems_loader_shows_the_server_and_survives_its_restart() {
    let server = WallServer::start(Mishap::HangsUp);
    let folder = folder("openxr");
    let log = folder.join("log.txt");
    let output = wear(
        &server.line,
        &manifest(&folder),
        300,
        &log,
        &["--display-rate", "72"],
    );
    let said = said(&output);
    assert!(output.status.success(), "{said}");
    assert!(server.connections() >= 2, "it came back: {said}");
    assert!(said.contains("headset: 2x256x256"), "{said}");
    assert!(said.contains("streaming"), "{said}");
    assert!(
        said.contains("display frames") && said.contains("p99"),
        "{said}"
    );

    let log = std::fs::read_to_string(&log).expect("the runtime wrote its log");
    assert!(
        log.contains("rates: [\n        72.0,"),
        "the rate was asked for"
    );
    let layers = log.matches("views: [").count();
    assert!(layers > 200, "{layers} frames had something to see");
    let misuse = log
        .split("misuse: [")
        .nth(1)
        .and_then(|rest| rest.split(']').next());
    let misuse = misuse.expect("the log tells of misuse");
    assert_eq!(
        misuse.matches("ERROR").count(),
        misuse.matches("ERROR_PATH_UNSUPPORTED").count()
    );
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_secret_that_is_wrong_is_told_in_the_headset_and_at_the_end() {
    let server = WallServer::start(Mishap::Stalls);
    let folder = folder("openxr-secret");
    let (start, secret) = server.line.split_once("secret=").expect("a server's line");
    let line = format!("{start}secret={}", "0".repeat(secret.len()));
    let log = folder.join("log.txt");
    let output = wear(&line, &manifest(&folder), 120, &log, &[]);
    assert!(!output.status.success());
    let said = said(&output);
    assert!(said.contains("the secret is wrong"), "{said}");
    let log = std::fs::read_to_string(&log).expect("the runtime wrote its log");
    assert!(
        log.matches("views: [").count() > 50,
        "something was shown meanwhile"
    );
}

#[test]
fn without_a_runtime_the_user_is_told_what_to_start() {
    let folder = folder("openxr-none");
    let line = format!(
        "shadecast://127.0.0.1:9/?fingerprint={}&secret={}",
        "0".repeat(64),
        "0".repeat(32)
    );
    let nowhere = folder.join("nowhere.json");
    let output = wear(&line, &nowhere, 1, &folder.join("log.txt"), &[]);
    assert!(!output.status.success());
    let told = said(&output);
    // Without the loader, that is told first.
    assert!(
        told.contains("no OpenXR runtime is active") || told.contains("no OpenXR loader"),
        "{told}"
    );

    let output = wear(
        "shadecast://nowhere",
        &nowhere,
        1,
        &folder.join("log.txt"),
        &[],
    );
    assert!(!output.status.success());
    assert!(
        said(&output).contains("shadecast://"),
        "a line that is malformed"
    );
}
