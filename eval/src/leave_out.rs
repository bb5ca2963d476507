//! `shadecast-eval leave-out`: what specialisation to a scene is worth.
//!
//! Each scene is drawn by kernels from which what it does not use is compiled
//! away, and by kernels with everything in. The pictures must be the same but for
//! rounding; the times are medians of runs in turn.

use std::{fmt::Write as _, path::PathBuf, time::Duration};

use anyhow::{Result, bail, ensure};
use clap::Args;
use serde::Serialize;
use shadecast_protocol::Fov;
use shadecast_server::{
    Integrator,
    scene::{Inspection, Scene},
    still::{Camera, DEFAULT_BOUNCES, Still, StillRenderer},
};

use crate::{
    progress::Progress,
    report::{Folder, Header, Spent, table, timed},
    rmse, scenes,
};

/// Relative error of a pixel that counts as rounding.
const ROUNDING: f32 = 1e-3;
/// Share of pixels that may differ by more: where rounding turns a path away from
/// an edge or a choice, all that follows differs.
const MOST_DIFFERING: f64 = 0.005;
/// Bounces of the paths: more than one, so that all of a path's code is met.
const BOUNCES: u32 = DEFAULT_BOUNCES + 1;

/// Measures what specialisation to a scene is worth.
#[derive(Args, Debug)]
pub struct Options {
    /// `courtyard`, `lamps`, `plates`, or glTF files.
    #[arg(value_name = "SCENE", default_values_t = ["courtyard", "lamps", "plates"].map(String::from))]
    pub scenes: Vec<String>,
    /// Folder for figures.
    #[arg(long, value_name = "DIR", default_value = crate::OUT)]
    pub out: PathBuf,
    /// Fewer runs of smaller pictures.
    #[arg(long)]
    pub quick: bool,
    /// Seed of all random choices.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
}

/// A line of `leave-out.csv`.
#[derive(Clone, Debug, Serialize)]
struct Row {
    scene: String,
    seconds: f64,
    seconds_with_all: f64,
    cpu_seconds: f64,
    cpu_seconds_with_all: f64,
    /// Time with everything in over time without what the scene does not use.
    gain: f64,
    relative_rmse: f64,
    differing_pixels: f64,
    same: bool,
    left_out: usize,
}

/// Runs the measurement; the result is the page's tables.
///
/// # Errors
/// When a scene or a folder cannot be used, the GPU fails, or pictures differ.
pub fn run(options: &Options) -> Result<String> {
    ensure!(!options.scenes.is_empty(), "name at least one scene");
    let progress = Progress::new(options.scenes.len() as u64);
    let mut rows = Vec::new();
    let mut lists = String::new();
    let mut driver = String::new();
    for name in &options.scenes {
        progress.step(name);
        let scene = scenes::named(name)?;
        let left_out = Inspection::of(&scene).left_out;
        // Writing to a String cannot fail.
        let _ = writeln!(lists, "## {name}\n");
        for sentence in &left_out {
            let _ = writeln!(lists, "- {sentence}");
        }
        lists.push('\n');
        let row = measure(
            name,
            &scene,
            left_out.len(),
            options,
            &progress,
            &mut driver,
        )?;
        rows.push(row);
    }
    progress.finish();
    let header = Header::new("leave-out", &driver, options.scenes.clone(), options.seed);
    let folder = Folder::new(&options.out, header)?;
    folder.csv(&rows)?;
    let columns = [
        "scene",
        "s",
        "s with everything in",
        "gain",
        "CPU s",
        "CPU s with everything in",
        "relative RMSE",
        "differing pixels",
        "same",
    ];
    let lines = rows.iter().map(|row| {
        vec![
            row.scene.clone(),
            format!("{:.3}", row.seconds),
            format!("{:.3}", row.seconds_with_all),
            format!("{:.2}", row.gain),
            format!("{:.3}", row.cpu_seconds),
            format!("{:.3}", row.cpu_seconds_with_all),
            format!("{:.1e}", row.relative_rmse),
            format!("{:.2} %", row.differing_pixels * 100.0),
            row.same.to_string(),
        ]
    });
    let body = format!("{}\n{lists}", table(&columns, lines));
    folder.page(
        "What a scene does not need, and what leaving it out is worth",
        &body,
    )?;
    let differing: Vec<&str> = (rows.iter().filter(|row| !row.same))
        .map(|row| row.scene.as_str())
        .collect();
    if !differing.is_empty() {
        bail!(
            "specialised kernels draw another picture of {}",
            differing.join(", ")
        );
    }
    Ok(body)
}

fn measure(
    name: &str,
    scene: &Scene,
    left_out: usize,
    options: &Options,
    progress: &Progress,
    driver: &mut String,
) -> Result<Row> {
    let (side, samples, runs) = if options.quick {
        (128, 4, 3)
    } else {
        (256, 8, 7)
    };
    let camera = Camera {
        world_from_eye: scene.first_eye(),
        fov: Fov::symmetric(1.2),
        width: side,
        height: side,
    };
    let specialised = Integrator::with_bounces(BOUNCES);
    let with_all = Integrator {
        specialised: false,
        ..specialised
    };
    let mut renderers = Vec::new();
    for integrator in [specialised, with_all] {
        let mut renderer = StillRenderer::new(scene, integrator, &mut |_| ())?;
        // Drivers compile at the first use.
        renderer.render(&camera, Duration::ZERO, 1, options.seed)?;
        renderers.push(renderer);
    }
    renderers[0].adapter().clone_into(driver);
    let mut spent: [Vec<Spent>; 2] = Default::default();
    let mut stills: Vec<Still> = Vec::new();
    for run in 0..runs {
        progress.within(run as f32 / runs as f32);
        stills.clear();
        for (renderer, spent) in renderers.iter_mut().zip(&mut spent) {
            let drawn =
                timed(|| Ok(renderer.render(&camera, Duration::ZERO, samples, options.seed)?))?;
            stills.push(drawn.0);
            spent.push(drawn.1);
        }
    }
    let [one, all] = [0, 1].map(|which| stills[which].radiance.as_slice());
    let mean = one
        .iter()
        .map(|pixel| f64::from(pixel.element_sum()))
        .sum::<f64>()
        / (3 * one.len()) as f64;
    let same = one.iter().zip(all).filter(|(a, b)| {
        let most = a.max(**b).max_element().max(mean as f32 * 0.01);
        (**a - **b).abs().max_element() <= ROUNDING * most
    });
    let differing_pixels = 1.0 - same.count() as f64 / one.len() as f64;
    let median = |which: usize, of: fn(&Spent) -> Duration| {
        let mut times: Vec<Duration> = spent[which].iter().map(of).collect();
        times.sort();
        times[times.len() / 2].as_secs_f64()
    };
    let (seconds, seconds_with_all) = (median(0, |s| s.wall), median(1, |s| s.wall));
    Ok(Row {
        scene: name.to_owned(),
        seconds,
        seconds_with_all,
        cpu_seconds: median(0, |s| s.cpu),
        cpu_seconds_with_all: median(1, |s| s.cpu),
        gain: seconds_with_all / seconds,
        relative_rmse: rmse(one, all) / mean.max(f64::MIN_POSITIVE),
        differing_pixels,
        same: differing_pixels <= MOST_DIFFERING,
        left_out,
    })
}
