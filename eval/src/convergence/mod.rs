//! `shadecast-eval convergence`: error against run time of a still view.
//!
//! Each method draws the same view with more and more samples. Path tracing is
//! measured whole and with one part of the integrator switched off; the atlas is
//! measured as it accumulates, with and without smoothing. Few samples are drawn
//! several times and their errors averaged, so that each error comes from about
//! as many samples: rare bright ones would else be missed by the first and spoil
//! the last.

mod methods;
mod page;

use std::{path::PathBuf, time::Duration};

use anyhow::{Context, Result, ensure};
use clap::Args;
use image::RgbImage;
use serde::Serialize;
use shadecast_protocol::Fov;
use shadecast_server::{
    Integrator,
    still::{Camera, DEFAULT_BOUNCES, Still},
};

use self::methods::{METHODS, Sample};
use crate::{
    flip,
    progress::Progress,
    reference::{self, Reference, Subject},
    relmse,
    report::{Folder, Header},
    rmse, scenes,
};

/// Pixels a radian of the view: the demo's.
const PIXELS_PER_RADIAN: f32 = 170.0;
/// An error is reported where the reference's own is at most this share of it.
const REFERENCE_SHARE: f64 = 0.1;

/// Measures error against run time of a still view.
#[derive(Args, Debug)]
pub struct Options {
    /// `courtyard`, `lamps`, `plates`, or glTF files.
    #[arg(value_name = "SCENE", default_values_t = ["courtyard", "lamps", "plates"].map(String::from))]
    pub scenes: Vec<String>,
    /// Folder for figures; references are kept in it from run to run.
    #[arg(long, value_name = "DIR", default_value = crate::OUT)]
    pub out: PathBuf,
    /// A rough run of about two minutes: smaller pictures, fewer samples.
    #[arg(long)]
    pub quick: bool,
    /// Most samples a pixel of a method [default: 64, quick: 8].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=65_536))]
    pub spp: Option<u32>,
    /// Most seconds for each scene's reference [default: 600, quick: 30].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=86_400))]
    pub reference_seconds: Option<u32>,
    /// Seed of everything but the references.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
}

/// A line of `convergence.csv`.
#[derive(Clone, Debug, Serialize)]
struct Row {
    scene: String,
    method: &'static str,
    seconds: f64,
    cpu_seconds: f64,
    spp: f64,
    rmse: f64,
    relmse: f64,
    flip: f64,
}

/// What was found of a scene.
struct Measured {
    scene: String,
    rows: Vec<Row>,
    /// The reference, and the last picture of each method.
    strip: RgbImage,
    reference: Reference,
    /// Samples that the reference is too noisy for.
    left_out: usize,
}

/// Runs the measurement; the result is the page's tables.
///
/// # Errors
/// When a scene or a folder cannot be used, or the GPU fails.
pub fn run(options: &Options) -> Result<String> {
    ensure!(!options.scenes.is_empty(), "name at least one scene");
    let progress = Progress::new((options.scenes.len() * (METHODS.len() + 1)) as u64);
    let mut driver = String::new();
    let measured = (options.scenes.iter())
        .map(|name| measure(name, options, &progress, &mut driver))
        .collect::<Result<Vec<_>>>()?;
    progress.finish();
    let header = Header::new("convergence", &driver, options.scenes.clone(), options.seed);
    let folder = Folder::new(&options.out, header)?;
    let rows: Vec<&Row> = measured.iter().flat_map(|scene| &scene.rows).collect();
    folder.csv(&rows)?;
    page::write(&folder, &measured)
}

fn measure(
    name: &str,
    options: &Options,
    progress: &Progress,
    driver: &mut String,
) -> Result<Measured> {
    let choose =
        |given: Option<u32>, quick, full| given.unwrap_or(if options.quick { quick } else { full });
    let spp = choose(options.spp, 8, 64);
    let side = choose(None, 64, 96);
    let budget = Duration::from_secs(choose(options.reference_seconds, 30, 600).into());
    let scene = scenes::named(name)?;
    let camera = Camera {
        world_from_eye: scene.first_eye(),
        fov: Fov::symmetric(side as f32 / PIXELS_PER_RADIAN),
        width: side,
        height: side,
    };
    let mut samples: Vec<Sample> = Vec::new();
    for method in METHODS {
        progress.step(&format!("{name}: {}", method.name));
        samples.extend(method.measure(&scene, &camera, spp, options.seed, driver)?);
    }
    progress.step(&format!("{name}: reference"));
    let subject = Subject {
        scene: &scene,
        camera,
        scene_time: Duration::ZERO,
        integrator: Integrator::with_bounces(DEFAULT_BOUNCES),
    };
    let serves =
        |reference: &Reference, error: f64| reference.standard_error <= REFERENCE_SHARE * error;
    let is_enough = |reference: &Reference| {
        samples
            .iter()
            .all(|sample| serves(reference, error_of(sample, reference)))
    };
    let references = options.out.join("references");
    let found = reference::render(&subject, &references, budget, is_enough, |share| {
        progress.within(share);
    });
    let reference = found.with_context(|| format!("cannot make a reference of {name}"))?;
    if reference.kept {
        let folder = references.display();
        progress.say(&format!("{name}: the reference is one kept in {folder}"));
    }
    let all = samples
        .iter()
        .map(|sample| row(name, sample, &reference))
        .collect::<Result<Vec<Row>>>()?;
    let count = all.len();
    let rows: Vec<Row> = all
        .into_iter()
        .filter(|row| serves(&reference, row.rmse))
        .collect();
    Ok(Measured {
        scene: name.to_owned(),
        strip: strip(&samples, &reference),
        left_out: count - rows.len(),
        rows,
        reference,
    })
}

fn row(scene: &str, sample: &Sample, reference: &Reference) -> Result<Row> {
    let truth = &reference.still;
    let exposure = truth.automatic_exposure();
    let displayed = truth.displayed(exposure);
    let flip = |still: &Still| Ok(flip(&displayed, &still.displayed(exposure))?.mean());
    Ok(Row {
        scene: scene.to_owned(),
        method: sample.method,
        seconds: sample.spent.wall.as_secs_f64(),
        cpu_seconds: sample.spent.cpu.as_secs_f64(),
        spp: sample.spp,
        rmse: error_of(sample, reference),
        relmse: mean_of(sample, |still| Ok(relmse(&still.radiance, &truth.radiance)))?,
        flip: mean_of(sample, flip)?,
    })
}

/// Mean over the pictures of a sample.
fn mean_of(sample: &Sample, error: impl Fn(&Still) -> Result<f64>) -> Result<f64> {
    let sum = sample.stills.iter().map(error).sum::<Result<f64>>()?;
    Ok(sum / sample.stills.len() as f64)
}

/// Root of the mean of its pictures' squared errors.
fn error_of(sample: &Sample, reference: &Reference) -> f64 {
    let squares = (sample.stills.iter())
        .map(|still| rmse(&still.radiance, &reference.still.radiance).powi(2));
    (squares.sum::<f64>() / sample.stills.len() as f64).sqrt()
}

fn strip(samples: &[Sample], reference: &Reference) -> RgbImage {
    let exposure = reference.still.automatic_exposure();
    let of_methods = METHODS.iter().filter_map(|method| {
        let mut of_method = samples.iter().filter(|sample| sample.method == method.name);
        of_method.next_back()?.stills.first()
    });
    let stills: Vec<&Still> = std::iter::once(&reference.still)
        .chain(of_methods)
        .collect();
    let Still { width, height, .. } = reference.still;
    let mut strip = RgbImage::new(width * stills.len() as u32, height);
    for (place, still) in (0..).zip(stills) {
        let picture = still.displayed(exposure);
        image::imageops::replace(&mut strip, &picture, place * i64::from(width), 0);
    }
    strip
}
