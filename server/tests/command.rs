//! The `shadecast` command, as a user meets it: what goes wrong is said in one
//! sentence that names the culprit.

use std::{
    fs,
    net::UdpSocket,
    path::{Path, PathBuf},
    process::{Command, Output},
};

const GARBAGE: &[u8] = &[0xa5; 4096];
const NO_TRIANGLE: &[u8] = br#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{}]}"#;
const CYCLE: &[u8] = br#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"children":[1]},{"children":[0]}]}"#;

/// A folder of this test's own, gone at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Self {
        let name = format!("shadecast-{test}-{}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        fs::create_dir_all(&folder).expect("a temporary folder");
        Self(folder)
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.join(name);
        fs::write(&path, bytes).expect("a temporary file");
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder that stays behind harms nobody.
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn shadecast(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_shadecast"))
        .args(arguments)
        .output()
        .expect("the command runs")
}

/// What it says as it fails.
fn complaint(arguments: &[&str]) -> String {
    let output = shadecast(arguments);
    let said = String::from_utf8(output.stderr).expect("it speaks UTF-8");
    assert!(!output.status.success(), "{arguments:?}: {said}");
    assert!(output.status.code().is_some(), "{arguments:?}: {said}");
    assert!(!said.contains("panicked"), "{said}");
    said
}

/// The one line about a file that is no scene.
fn complaint_about(path: &Path) -> String {
    let path = path.to_str().expect("a plain path");
    let said = complaint(&["inspect", path]);
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.starts_with("error: "), "{said}");
    assert!(said.contains(path), "{said}");
    said
}

#[test]
fn a_file_that_is_no_scene_is_named() {
    let folder = Folder::new("bad-files");
    let missing = complaint_about(&folder.0.join("missing.glb"));
    assert_eq!(missing.matches("No such file").count(), 1, "{missing}");
    complaint_about(&folder.0);
    complaint_about(&folder.file("empty.glb", b""));
    complaint_about(&folder.file("garbage.glb", GARBAGE));
    complaint_about(&folder.file("garbage.gltf", GARBAGE));
    let empty = complaint_about(&folder.file("no-triangle.gltf", NO_TRIANGLE));
    assert!(empty.contains("no triangles"), "{empty}");
    let cycle = complaint_about(&folder.file("cycle.gltf", CYCLE));
    assert!(cycle.contains("tree"), "{cycle}");
}

#[test]
fn a_written_scene_is_read_again_and_a_truncated_one_is_not() {
    let folder = Folder::new("written");
    let path = folder.0.join("courtyard.glb");
    let name = path.to_str().expect("a plain path");
    let written = shadecast(&["scene", "courtyard", "--triangles", "4000", "--out", name]);
    assert!(written.status.success(), "{written:?}");

    let count = |arguments: &[&str]| -> u64 {
        let output = shadecast(arguments);
        assert!(output.status.success(), "{output:?}");
        let facts: serde_json::Value =
            serde_json::from_slice(&output.stdout).expect("it prints JSON");
        facts["triangles"].as_u64().expect("a count")
    };
    let triangles = count(&["inspect", name, "--json"]);
    let built_in = ["inspect", "courtyard", "--triangles", "4000", "--json"];
    assert_eq!(triangles, count(&built_in));
    let said = String::from_utf8(written.stderr).expect("it speaks UTF-8");
    assert!(said.contains(&format!("({triangles} triangles)")), "{said}");

    let bytes = fs::read(&path).expect("the file was written");
    for length in [0, 4, 11, 12, 19, 20, 300, bytes.len() / 2, bytes.len() - 1] {
        complaint_about(&folder.file("truncated.glb", &bytes[..length]));
    }
}

#[test]
fn a_port_in_use_is_named_before_anything_is_loaded() {
    let other = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    let address = other.local_addr().expect("an address").to_string();
    let said = complaint(&["serve", "courtyard", "--listen", &address]);
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.starts_with("error: "), "{said}");
    assert!(said.contains(&address) && said.contains("in use"), "{said}");
}

#[test]
fn an_impossible_atlas_is_refused_at_once() {
    for (option, value) in [
        ("--atlas", "100"),
        ("--atlas", "72"),
        ("--atlas", "0"),
        ("--atlas", "16384"),
        ("--superblock", "12"),
        ("--superblock", "2"),
    ] {
        let said = complaint(&["serve", "courtyard", option, value]);
        let sentence = said.lines().next().unwrap_or_default();
        assert!(sentence.starts_with("error: "), "{said}");
        assert!(sentence.contains(option), "{said}");
        assert!(sentence.contains("is expected"), "{said}");
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_superblock_that_does_not_divide_the_atlas_is_refused() {
    let said = complaint(&[
        "serve",
        "courtyard",
        "--triangles",
        "1000",
        "--listen",
        "127.0.0.1:0",
        "--atlas",
        "144",
        "--superblock",
        "32",
    ]);
    let sentence = said.lines().last().unwrap_or_default();
    assert!(sentence.starts_with("error: "), "{said}");
    assert!(
        sentence.contains("144") && sentence.contains("32"),
        "{said}"
    );
}

#[test]
fn a_picture_that_cannot_be_written_is_refused_before_it_is_rendered() {
    for out in ["picture.jpg", "picture", "no/such/folder/picture.exr"] {
        let said = complaint(&["render", "courtyard", "--out", out]);
        assert_eq!(said.lines().count(), 1, "{said}");
        assert!(said.starts_with("error: ") && said.contains(out), "{said}");
    }
    let said = complaint(&["render", "courtyard", "--out", "a.png", "--view", "1 2 3"]);
    let sentence = said.lines().next().unwrap_or_default();
    assert!(sentence.contains("--view"), "{said}");
    let said = complaint(&[
        "render",
        "courtyard",
        "--out",
        "a.png",
        "--tangents",
        "1,-1,1,-1",
    ]);
    assert!(said.contains("field of view"), "{said}");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_seed_is_a_picture() {
    let folder = Folder::new("render");
    let render = |name: &str, seed: &str| {
        let out = folder.0.join(name);
        let output = shadecast(&[
            "render",
            "courtyard",
            "--triangles",
            "4000",
            "--width",
            "24",
            "--height",
            "16",
            "--spp",
            "3",
            "--seed",
            seed,
            "--env",
            "const:1,1,1",
            "--sun",
            "0",
            "-1",
            "0",
            "2",
            "2",
            "2",
            "--out",
            out.to_str().expect("a plain path"),
        ]);
        assert!(output.status.success(), "{output:?}");
        let said = String::from_utf8(output.stdout).expect("it speaks UTF-8");
        assert!(
            said.contains("24x16, 3 samples a pixel, 1 bounces"),
            "{said}"
        );
        assert!(said.contains("Mrays/s") && said.contains(name), "{said}");
        let png = image::open(out.with_extension("png")).expect("a PNG beside it");
        let exr = image::open(&out).expect("an EXR").into_rgb32f();
        assert_eq!((png.width(), png.height()), exr.dimensions());
        exr
    };
    let first = render("first.exr", "7");
    assert_eq!(first, render("again.exr", "7"));
    assert_ne!(first, render("other.exr", "8"));
    assert!(
        first
            .iter()
            .all(|channel| channel.is_finite() && *channel >= 0.0)
    );
    assert!(first.iter().any(|channel| *channel > 0.5));
}
