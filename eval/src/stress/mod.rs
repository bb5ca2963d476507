//! `shadecast-eval stress`: extreme and stiff cases, and what must hold in each.
//!
//! A case builds a scene or a file that is hard on floats, on sampling or on what
//! is remembered from frame to frame, and measures properties: numbers with a
//! bound. Where light is measured, the bound is on the error against a closed
//! form, an integral in double precision, or the same scene without the hardship.
//! The tests of this crate run the same cases with fewer samples.

mod brdf;
mod denoiser;
mod environment;
mod files;
mod firefly;
mod geometry;
mod integrator;
mod lamps;
mod motion;
mod numbers;
mod page;
mod property;
mod scenes;
mod textures;
mod watched;

use std::{path::PathBuf, sync::mpsc, thread, time::Duration};

use anyhow::{Result, bail, ensure};
use clap::Args;
use shadecast_server::Gpu;

use self::property::Property;
use crate::{
    progress::Progress,
    report::{Folder, Header},
};

/// After this a case is said to hang: a hundred times what the slowest takes.
const LONGEST: Duration = Duration::from_secs(600);

/// By subject.
const SUBJECTS: &[(&str, &[Case])] = &[
    ("Light transport", integrator::CASES),
    ("Lamps", lamps::CASES),
    ("Geometry", geometry::CASES),
    ("Textures", textures::CASES),
    ("Pictures of all directions", environment::CASES),
    ("Numbers", numbers::CASES),
    ("Files", files::CASES),
    ("Accumulation and smoothing", denoiser::CASES),
    ("Fireflies", firefly::CASES),
    ("Time and motion", motion::CASES),
];

/// Measures what must hold in extreme and stiff cases.
#[derive(Args, Debug)]
pub struct Options {
    /// Folder for stress.csv and stress.md.
    #[arg(long, value_name = "DIR", default_value = crate::OUT)]
    pub out: PathBuf,
    /// Fewer samples: less than two minutes on two cores.
    #[arg(long)]
    pub quick: bool,
    /// Only the case of this name.
    #[arg(long, value_name = "NAME")]
    pub case: Option<String>,
    /// Seed of the pictures' samples.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
}

/// Something hard, and how what must hold in it is measured.
#[derive(Debug)]
struct Case {
    name: &'static str,
    /// What is hard about it.
    what: &'static str,
    measure: fn(Effort) -> Result<Vec<Property>>,
}

/// How much is done to measure a property.
#[derive(Clone, Copy, Debug)]
struct Effort {
    quick: bool,
    seed: u32,
}

impl Effort {
    /// A pixel, of pictures that would take `full` of them without `--quick`.
    fn samples(self, full: u32) -> u32 {
        if self.quick { (full / 4).max(1) } else { full }
    }
}

impl Case {
    /// What holds; that it ends at all is a property, too.
    fn properties(&self, effort: Effort) -> Vec<Property> {
        let (sender, receiver) = mpsc::channel();
        let measure = self.measure;
        // It is left behind where it hangs.
        thread::spawn(move || sender.send(measure(effort)));
        match receiver.recv_timeout(LONGEST) {
            Ok(Ok(properties)) => properties,
            Ok(Err(error)) => vec![Property::failed(&format!("{error:#}"))],
            Err(mpsc::RecvTimeoutError::Timeout) => vec![Property::failed("it hangs")],
            Err(mpsc::RecvTimeoutError::Disconnected) => vec![Property::failed("it panicked")],
        }
    }
}

fn cases() -> impl Iterator<Item = &'static Case> {
    SUBJECTS.iter().flat_map(|(_, cases)| *cases)
}

/// The names of all cases.
pub fn names() -> impl Iterator<Item = &'static str> {
    cases().map(|case| case.name)
}

/// Measures one case with few samples.
///
/// # Errors
/// When there is no such case, and when something does not hold: all that is so.
pub fn check(name: &str) -> Result<()> {
    let Some(case) = cases().find(|case| case.name == name) else {
        bail!("there is no case {name}");
    };
    let effort = Effort {
        quick: true,
        seed: 1,
    };
    let broken: Vec<String> = (case.properties(effort).iter())
        .filter(|property| !property.holds())
        .map(ToString::to_string)
        .collect();
    ensure!(broken.is_empty(), "{name}:\n{}", broken.join("\n"));
    Ok(())
}

/// Runs the measurement; the result is the page's tables.
///
/// # Errors
/// When there is no such case, the folder cannot be written, or, with everything
/// written, when something does not hold.
pub fn run(options: &Options) -> Result<String> {
    let chosen: Vec<&Case> = cases()
        .filter(|case| (options.case.as_ref()).is_none_or(|name| name == case.name))
        .collect();
    let known: Vec<&str> = names().collect();
    ensure!(
        !chosen.is_empty(),
        "no case has this name; there are {}",
        known.join(", ")
    );
    let effort = Effort {
        quick: options.quick,
        seed: options.seed,
    };
    let progress = Progress::new(chosen.len() as u64);
    let mut measured = Vec::new();
    for case in chosen {
        progress.step(case.name);
        let properties = case.properties(effort);
        for broken in properties.iter().filter(|property| !property.holds()) {
            progress.say(&format!("{} does not hold: {broken}", case.name));
        }
        measured.push((case, properties));
    }
    progress.finish();
    let driver = Gpu::open().map_or_else(|error| error.to_string(), |gpu| gpu.adapter);
    let scenes = vec!["built for each case".to_owned()];
    let header = Header::new("stress", &driver, scenes, options.seed);
    let folder = Folder::new(&options.out, header)?;
    page::write(&folder, &measured)
}
