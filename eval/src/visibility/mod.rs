//! `shadecast-eval visibility`: what is found to be visible, against what is seen.
//!
//! Heads walk through a scene and look around (`trace`); the server's predictors and
//! its very passes find what they may see. Measured are how far predicted heads are
//! off (`predict`), coverage and overestimation of visible sets (`coverage`), and
//! pixels that a client would miss (`client`), by time and by choices of the server.

mod charts;
mod client;
mod coverage;
mod page;
mod policy;
mod predict;
mod seer;
mod trace;

use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::Args;
use shadecast_server::scene::{self, Scene};

use self::{
    client::Truth,
    policy::{CHOICES, PREDICTORS, Policy, SERVED, WITHOUT_RECALL},
    seer::Seer,
    trace::{GAITS, Gait, Head, RATE, WALK},
};
use crate::{
    progress::Progress,
    report::{Folder, Header},
    scenes,
};

/// Latencies of clients, in pictures of 11 ms: 33, 100 and 200 ms.
const LATENCIES: [u32; 3] = [3, 9, 18];
/// Those at which the server's choices are compared.
const CHOSEN_AT: [u32; 2] = [3, 9];
/// Triangles of the courtyard whose triangles are mostly smaller than pixels.
const FINE: usize = 250_000;

/// Measures what is found to be visible against what is seen.
#[derive(Args, Debug)]
pub struct Options {
    /// `courtyard`, `courtyard-fine` (250k triangles), or glTF files [default: both courtyards, quick: the first].
    #[arg(value_name = "SCENE")]
    pub scenes: Vec<String>,
    /// Folder for figures.
    #[arg(long, value_name = "DIR", default_value = crate::OUT)]
    pub out: PathBuf,
    /// A rough run of less than three minutes: one scene, fewer moments, smaller pictures.
    #[arg(long)]
    pub quick: bool,
    /// Pixels of an eye's picture, each way [default: 512, quick: 256].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(64..=2048))]
    pub side: Option<u16>,
    /// Seed of the heads' paths.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
}

/// How much is measured.
struct Extent {
    /// Pixels of an eye's picture, each way.
    side: u16,
    /// Of a trace whose heads are only predicted, and of one that is drawn.
    predicted_seconds: f64,
    drawn_seconds: f64,
    /// At which sets are compared.
    moments: u32,
    /// At which every predictor is compared.
    latencies: &'static [u32],
    gaits: &'static [Gait],
}

impl Extent {
    fn of(options: &Options) -> Self {
        if options.quick {
            Self {
                side: options.side.unwrap_or(256),
                predicted_seconds: 20.0,
                drawn_seconds: 4.0,
                moments: 12,
                latencies: &CHOSEN_AT,
                gaits: &[WALK],
            }
        } else {
            Self {
                side: options.side.unwrap_or(512),
                predicted_seconds: 60.0,
                drawn_seconds: 4.0,
                moments: 16,
                latencies: &LATENCIES,
                gaits: &GAITS,
            }
        }
    }
}

/// All that was found.
#[derive(Default)]
struct Found {
    predictions: Vec<predict::Row>,
    coverages: Vec<coverage::Row>,
    missing: Vec<client::Row>,
}

/// Runs the measurement; the result is the page's tables.
///
/// # Errors
/// When a scene or a folder cannot be used, or the GPU fails.
pub fn run(options: &Options) -> Result<String> {
    let names = match (&options.scenes[..], options.quick) {
        ([], true) => vec!["courtyard".to_owned()],
        ([], false) => ["courtyard", "courtyard-fine"].map(String::from).into(),
        (given, _) => given.to_vec(),
    };
    let extent = Extent::of(options);
    let steps = (extent.gaits.len() + names.len() - 1) * 3;
    let progress = Progress::new(steps as u64);
    let mut found = Found::default();
    let mut driver = String::new();
    for (index, name) in names.iter().enumerate() {
        let scene = match name.as_str() {
            "courtyard-fine" => scene::courtyard(FINE),
            name => scenes::named(name)?,
        };
        ensure!(!scene.triangles.is_empty(), "{name} has no triangles");
        let side = f32::from(extent.side);
        let mut seer = Seer::new(&scene, side / std::f32::consts::FRAC_PI_2)?;
        seer.gpu.adapter.clone_into(&mut driver);
        // Further scenes need not be walked through in every way.
        let extent = if index == 0 {
            &extent
        } else {
            &Extent {
                moments: extent.moments / 4,
                latencies: &CHOSEN_AT,
                gaits: &[WALK],
                ..extent
            }
        };
        for gait in extent.gaits {
            let case = (name.as_str(), &scene, *gait, options.seed.into());
            measure(&mut seer, case, extent, index == 0, &mut found, &progress)?;
        }
    }
    progress.finish();
    let folder = |stem| {
        let header = Header::new(stem, &driver, names.clone(), options.seed);
        Folder::new(&options.out, header)
    };
    folder("visibility-prediction")?.csv(&found.predictions)?;
    folder("visibility-missing")?.csv(&found.missing)?;
    let folder = folder("visibility")?;
    folder.csv(&found.coverages)?;
    page::write(&folder, &found)
}

fn measure(
    seer: &mut Seer,
    (name, scene, gait, seed): (&str, &Scene, Gait, u64),
    extent: &Extent,
    is_first: bool,
    found: &mut Found,
    progress: &Progress,
) -> Result<()> {
    let within = |share| progress.within(share);
    progress.step(&format!("{name}, {}: coverage", gait.name));
    let seconds = extent.predicted_seconds;
    let head = Head::new(scene, gait, seed, seconds.max(extent.drawn_seconds) + 2.0);
    if found.predictions.iter().all(|row| row.gait != gait.name) {
        let rows = predict::measure(&head, gait, seconds, &coverage::horizons());
        found.predictions.extend(rows);
    }
    let (side, moments) = (extent.side, extent.moments);
    let rows = coverage::measure(seer, name, (&head, gait), side, moments, within)?;
    found.coverages.extend(rows);

    progress.step(&format!("{name}, {}: what is displayed", gait.name));
    let ticks = (extent.drawn_seconds * f64::from(RATE)) as u32;
    let truth = Truth::of(seer, &head, side, ticks, within)?;

    progress.step(&format!("{name}, {}: what is missing", gait.name));
    // The server's choices one by one where it is walked as in the targets, and where
    // most is asked of them.
    let last = GAITS[GAITS.len() - 1].name;
    let choices = is_first && [WALK.name, last].contains(&gait.name);
    let predictors = PREDICTORS
        .iter()
        .filter(|_| is_first)
        .chain([&SERVED, &WITHOUT_RECALL]);
    let latencies = if gait.name == WALK.name {
        extent.latencies
    } else {
        &CHOSEN_AT
    };
    let compared = predictors.map(|policy| (policy, latencies));
    let chosen = CHOICES.iter().filter(|_| choices);
    let cases: Vec<(&Policy, u32)> = compared
        .chain(chosen.map(|policy| (policy, &CHOSEN_AT[..])))
        .flat_map(|(policy, latencies)| latencies.iter().map(move |latency| (policy, *latency)))
        .collect();
    for (done, (policy, latency)) in cases.iter().enumerate() {
        within(done as f32 / cases.len() as f32);
        let walk = (&head, gait);
        let row = client::measure(seer, name, walk, &truth, side, **policy, *latency)?;
        found.missing.push(row);
    }
    Ok(())
}
