//! The whole path once: two processes over loopback, then the figures.

mod errors;
mod processes;
mod recorded;
mod references;
mod report;
mod summary;
mod targets;
mod window;

use std::{
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};
use indicatif::{ProgressBar, ProgressStyle};
use shadecast_protocol::Method;
use shadecast_server::scene::{self, Scene};

use processes::{Client, Server};
use recorded::{ClientRecord, ServerRecord};
use summary::Summary;
use window::Window;

/// What to stream, for how long, and where to leave the figures.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  shadecast-eval demo --out demo-out
  shadecast-eval demo --out garden --scene garden.glb --seconds 60 --eye-size 512")]
pub struct Options {
    /// Folder for pictures and figures; what an earlier run left there is replaced.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// `courtyard`, or a glTF or GLB file.
    #[arg(long, value_name = "SCENE", default_value = COURTYARD)]
    pub scene: PathBuf,
    /// How the server places light in the atlas: sas, snake or tss.
    #[arg(long, default_value_t)]
    pub method: Method,
    /// Size of the courtyard, about.
    #[arg(long, value_name = "N", default_value_t = 15_000)]
    pub triangles: usize,
    /// Seconds that the client runs.
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(8..=3600))]
    pub seconds: u32,
    /// Side of the atlas, texels.
    #[arg(long, value_name = "TEXELS", default_value_t = 512)]
    pub atlas: u32,
    /// Side of one eye's picture, pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 256)]
    pub eye_size: u32,
    /// Frames a second of the client's display.
    #[arg(long, value_name = "HZ", default_value_t = 30)]
    pub display_rate: u32,
    /// Target of the video encoder, Mbit/s.
    #[arg(long, value_name = "MBIT", default_value_t = 20.0)]
    pub bitrate: f64,
    /// Seed of the head motion and of the references.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
    /// Seconds that everything but the streaming may take: starting, and then the
    /// references, which get better with time.
    #[arg(long, value_name = "N", default_value_t = 62)]
    pub reference_seconds: u32,
    /// Compares whole pictures instead of a window of each, however long that takes.
    #[arg(long, conflicts_with = "reference_seconds")]
    pub whole: bool,
}

const COURTYARD: &str = "courtyard";

/// Runs the demo and gives the table of targets beside the measured figures.
///
/// # Errors
/// When a program is missing, ends badly or not at all, or a file that it
/// should have written is not as it should be.
pub fn run(options: &Options) -> Result<String> {
    let began = Instant::now();
    prepare(&options.out)?;

    eprintln!("starting the server with {}", options.scene.display());
    let mut server = Server::start(options)?;
    let line = server.line()?;
    eprintln!("streaming for {} s", options.seconds);
    Client::start(options, &line)?.finish(&mut server)?;
    server.finish()?;

    let client = ClientRecord::read(&options.out.join("client.json"))?;
    let server = ServerRecord::read(&options.out.join("server.json"))?;
    ensure!(
        !client.samples.is_empty(),
        "the client drew no picture to compare: the first picture came too late for a run of {} s",
        options.seconds
    );

    eprintln!("rendering {} references", client.samples.len());
    let seconds = options.seconds.saturating_add(options.reference_seconds);
    let deadline = began + Duration::from_secs(seconds.into());
    let windows = windows(options, &client);
    let bar = reference_bar();
    let (references, reference_samples) = references::render(
        &load(options)?,
        server.exposure,
        options.seed,
        &errors::views(&client.samples, &windows)?,
        (!options.whole).then_some(deadline),
        |share| bar.set_position((share * 100.0) as u64),
    )?;
    bar.finish_and_clear();
    let errors = errors::measure(&options.out, &client.samples, &windows, &references)?;
    errors::write_csv(&options.out.join("error.csv"), &errors)?;

    let summary = Summary::new(
        options,
        &client,
        &server,
        &errors,
        reference_samples,
        began.elapsed(),
    );
    let targets = targets::of(&summary);
    write(&options.out.join("summary.json"), &summary.to_json()?)?;
    let report = report::markdown(&options.out, &summary, &targets, &errors)?;
    write(&options.out.join("report.md"), &report)?;
    Ok(format!(
        "{}\nreport: {}\n",
        targets::text(&targets),
        options.out.join("report.md").display()
    ))
}

fn reference_bar() -> ProgressBar {
    let style = ProgressStyle::with_template("references {wide_bar} {percent} % {eta}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(100).with_style(style)
}

/// What of each sample is compared.
fn windows(options: &Options, client: &ClientRecord) -> Vec<Window> {
    let count = client.samples.len();
    let cameras = client.samples.iter().map(recorded::Sample::camera);
    cameras
        .enumerate()
        .map(|(index, camera)| match options.whole {
            true => Window::whole(&camera),
            false => Window::of_sample(index, count, &camera),
        })
        .collect()
}

/// The same scene as the server's.
fn load(options: &Options) -> Result<Scene> {
    if options.scene == Path::new(COURTYARD) {
        return Ok(scene::courtyard(options.triangles));
    }
    scene::load(&options.scene).with_context(|| format!("cannot load {}", options.scene.display()))
}

/// Makes the folder, and removes the figures of an earlier run so that none is
/// taken for one of this run.
fn prepare(out: &Path) -> Result<()> {
    fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
    for path in pictures(out, "")? {
        remove(&path)?;
    }
    for name in [
        "client.json",
        "server.json",
        "summary.json",
        "report.md",
        "error.csv",
    ] {
        remove(&out.join(name))?;
    }
    Ok(())
}

fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(error).with_context(|| format!("cannot remove {}", path.display()))
        }
        _ => Ok(()),
    }
}

/// The numbered pictures of the demo in `out`, such as `eyes_00.png`, whose
/// names begin with `prefix`, in order.
fn pictures(out: &Path, prefix: &str) -> Result<Vec<PathBuf>> {
    const KINDS: [&str; 3] = ["eyes_", "atlas_", "compare_"];
    let entries = fs::read_dir(out).with_context(|| format!("cannot list {}", out.display()))?;
    let mut found: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            path.extension().is_some_and(|extension| extension == "png")
                && path
                    .file_name()
                    .and_then(|name| name.to_str())
                    .is_some_and(|name| {
                        name.starts_with(prefix) && KINDS.iter().any(|kind| name.starts_with(kind))
                    })
        })
        .collect();
    found.sort();
    Ok(found)
}

fn write(path: &Path, content: &str) -> Result<()> {
    fs::write(path, content).with_context(|| format!("cannot write {}", path.display()))
}
