//! The binary as a user runs it: against a server of one red wall, and with
//! command lines that cannot work.

mod wall_server;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use wall_server::{Mishap, WallServer};

/// An empty folder of this test.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("the target folder is writable");
    folder
}

fn desktop(line: &str, rest: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_shadecast-desktop"))
        .arg(line)
        .args(rest)
        .output()
        .expect("the binary was built")
}

/// What a failed run says, as one line.
#[track_caller]
fn complaint(output: &Output) -> String {
    assert!(!output.status.success());
    let said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    assert!(!said.contains("panicked"), "{said}");
    said
}

fn report(out: &Path) -> Value {
    let text = std::fs::read_to_string(out.join("client.json")).expect("a report was written");
    serde_json::from_str(&text).expect("the report is JSON")
}

fn center(path: &Path) -> [u8; 3] {
    let picture = image::open(path).expect("a picture was written").to_rgb8();
    picture
        .get_pixel(picture.width() / 2, picture.height() / 2)
        .0
}

/// A head that stands still before the wall.
fn still_head(folder: &Path) -> String {
    let path = folder.join("head.txt");
    std::fs::write(&path, "0 0 1.6 0 0 0 0 1\n").expect("the folder is writable");
    path.display().to_string()
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_run_writes_what_it_saw_and_survives_a_restart() {
    let server = WallServer::start(Mishap::HangsUp);
    let folder = folder("restart");
    let out = folder.join("out");
    let output = desktop(
        &server.line,
        &[
            "--seconds",
            "4",
            "--samples",
            "4",
            "--moments",
            "2",
            "--eye-size",
            "64",
            "--trace",
            &still_head(&folder),
            "--out",
            &out.display().to_string(),
        ],
    );
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(server.connections() >= 2, "it came back: {said}");

    let report = report(&out);
    assert!(report["seconds"].as_f64() >= Some(4.0));
    assert!(report["frames"].as_u64() > Some(0));
    assert!(report["updates"].as_u64() > Some(2));
    assert!(report["video_bytes"].as_u64() > Some(0));
    assert!(report["update_bytes"].as_u64() > Some(0));
    assert!(report["frame_ms"]["p99"].as_f64() >= report["frame_ms"]["p50"].as_f64());
    assert!(report["latency_ms"]["total"].as_f64() > Some(0.0));
    let samples = report["samples"].as_array().expect("a list of samples");
    assert_eq!(samples.len(), 4);
    for (sample, eye) in samples.iter().zip(["left", "right", "left", "right"]) {
        assert_eq!(sample["eye"], eye);
        assert_eq!(sample["position"][1].as_f64(), Some(1.6));
        let named = |key: &str| out.join(sample[key].as_str().expect("a file name"));
        let [red, green, blue] = center(&named("picture"));
        assert!(red > 200 && green < 40 && blue < 40, "{red} {green} {blue}");
        // The server looked the other way, where the sky is.
        assert_eq!(center(&named("unwarped")), [0, 128, 255]);
    }
    for picture in ["eyes_00.png", "eyes_01.png", "atlas_00.png", "atlas_01.png"] {
        assert!(out.join(picture).exists(), "{picture}");
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn new_poses_are_drawn_while_the_server_stands_still() {
    let server = WallServer::start(Mishap::Stalls);
    let out = folder("stall").join("out");
    let folder = out.display().to_string();
    let rest = ["--seconds", "4", "--samples", "12", "--out", &folder];
    let output = desktop(&server.line, &rest);
    assert!(output.status.success());
    let report = report(&out);
    let samples = report["samples"].as_array().expect("a list of samples");
    let left_eyes: Vec<&Value> = samples.iter().step_by(2).collect();
    let of_one_frame = left_eyes
        .windows(2)
        .filter(|pair| pair[0]["frame"] == pair[1]["frame"])
        .inspect(|pair| assert_ne!(pair[0]["position"], pair[1]["position"]))
        .count();
    assert!(of_one_frame > 0, "some were drawn while nothing came");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_wrong_secret_or_fingerprint_ends_with_a_sentence() {
    let server = WallServer::start(Mishap::HangsUp);
    let (start, secret) = server.line.split_once("secret=").expect("a server's line");
    let other = "0".repeat(secret.len());
    let said = complaint(&desktop(&format!("{start}secret={other}"), &[]));
    assert!(said.contains("the secret is wrong"), "{said}");

    let (start, rest) = server
        .line
        .split_once("fingerprint=")
        .expect("a server's line");
    let line = format!("{start}fingerprint={}{}", "0".repeat(64), &rest[64..]);
    let said = complaint(&desktop(&line, &[]));
    assert!(said.contains("another fingerprint"), "{said}");
}

#[test]
fn a_command_line_that_cannot_work_ends_with_a_sentence() {
    let line = format!(
        "shadecast://127.0.0.1:9/?fingerprint={}&secret={}",
        "0".repeat(64),
        "0".repeat(32)
    );
    let folder = folder("nonsense");
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("the folder is writable");
        path.display().to_string()
    };
    let backwards = write("backwards.txt", "1 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n");
    let said = complaint(&desktop(&line, &["--trace", &backwards]));
    assert!(
        said.ends_with("line 2: time goes backwards, from 1 to 0"),
        "{said}"
    );

    let nan = write("nan.txt", "0 0 NaN 0 0 0 0 1\n");
    let said = complaint(&desktop(&line, &["--trace", &nan]));
    assert!(said.ends_with("line 1: \"NaN\" is not finite"), "{said}");

    let lens = write(
        "lens.json",
        r#"{"centre": [0, 0], "k": [[9, 0], [0, 0], [0, 0]]}"#,
    );
    let said = complaint(&desktop(&line, &["--lens", &lens]));
    assert!(said.contains("coefficient"), "{said}");

    let said = complaint(&desktop("nonsense", &[]));
    assert!(said.contains("shadecast://"), "{said}");

    let file = write("file", "");
    let rest = ["--seconds", "1", "--out", &file];
    let said = complaint(&desktop(&line, &rest));
    assert!(said.contains("cannot create the folder"), "{said}");
}
