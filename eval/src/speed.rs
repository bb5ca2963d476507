//! `shadecast-eval speed`: where the time of the light goes.
//!
//! Every texel of a view's atlas gets one path. Traversal and smoothing leave the
//! same when they run again, so that what a frame takes longer when one of them
//! runs several times is what it costs: on the same rays, in the same run, with
//! no clock inside the GPU.

use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::Args;
use serde::Serialize;
use shadecast_protocol::Fov;
use shadecast_server::{Integrator, kernels::Repeats, scene::Scene, still::DEFAULT_BOUNCES};

use crate::{
    ours::Ours,
    progress::Progress,
    report::{Folder, Header, table},
    scenes,
};

/// Opening of the view, radians, and its side in pixels.
const OPENING: f32 = 1.2;
const SIDE: u16 = 256;
const QUICK_SIDE: u16 = 128;
/// Side of the atlas, texels: room for all that the view shows.
const ATLAS: u16 = 1024;
/// Times that a stage runs to be told from the others.
const REPEATS: u32 = 4;

/// Measures where the time of the light goes.
#[derive(Args, Debug)]
pub struct Options {
    /// `courtyard`, `lamps`, `plates`, or glTF files.
    #[arg(value_name = "SCENE", default_values_t = ["courtyard", "lamps", "plates"].map(String::from))]
    pub scenes: Vec<String>,
    /// Folder for figures.
    #[arg(long, value_name = "DIR", default_value = crate::OUT)]
    pub out: PathBuf,
    /// Smaller pictures and fewer runs.
    #[arg(long)]
    pub quick: bool,
}

/// A line of `speed.csv`. Times are medians, of one update.
#[derive(Clone, Debug, Serialize)]
struct Row {
    scene: String,
    paths: u32,
    rays: u64,
    traversal_ms: f64,
    /// Everything of paths but traversal.
    shading_ms: f64,
    smoothing_ms: f64,
    traversal_mrays_per_s: f64,
    tracing_mrays_per_s: f64,
    /// Rays a second of the whole of paths over those of traversal alone.
    share_of_traversal: f64,
    smoothing_over_tracing: f64,
}

/// Runs the measurement; the result is the page's table.
///
/// # Errors
/// When a scene or a folder cannot be used, or the GPU fails.
pub fn run(options: &Options) -> Result<String> {
    ensure!(!options.scenes.is_empty(), "name at least one scene");
    let progress = Progress::new(options.scenes.len() as u64);
    let mut driver = String::new();
    let mut rows = Vec::new();
    for name in &options.scenes {
        progress.step(name);
        let scene = scenes::named(name)?;
        rows.push(measure(
            name,
            &scene,
            options.quick,
            &progress,
            &mut driver,
        )?);
    }
    progress.finish();
    let header = Header::new("speed", &driver, options.scenes.clone(), 0);
    let folder = Folder::new(&options.out, header)?;
    folder.csv(&rows)?;
    let lines = rows.iter().map(|row| {
        vec![
            row.scene.clone(),
            row.paths.to_string(),
            row.rays.to_string(),
            format!("{:.1}", row.traversal_ms),
            format!("{:.1}", row.shading_ms),
            format!("{:.1}", row.smoothing_ms),
            format!("{:.3}", row.traversal_mrays_per_s),
            format!("{:.3}", row.tracing_mrays_per_s),
            format!("{:.2}", row.share_of_traversal),
            format!("{:.2}", row.smoothing_over_tracing),
        ]
    });
    let columns = [
        "scene",
        "paths",
        "rays",
        "traversal, ms",
        "shading, ms",
        "smoothing, ms",
        "traversal, Mrays/s",
        "all of tracing, Mrays/s",
        "of traversal's",
        "smoothing over tracing",
    ];
    let body = table(&columns, lines);
    folder.page("Where the time of the light goes", &body)?;
    Ok(body)
}

fn measure(
    name: &str,
    scene: &Scene,
    quick: bool,
    progress: &Progress,
    driver: &mut String,
) -> Result<Row> {
    let (side, runs) = if quick { (QUICK_SIDE, 5) } else { (SIDE, 15) };
    let integrator = Integrator::with_bounces(DEFAULT_BOUNCES);
    let view = (Fov::symmetric(OPENING), side);
    let mut ours = Ours::new(scene, integrator, view, ATLAS)?;
    ours.pipeline().gpu().0.adapter.clone_into(driver);
    let eye = scene.first_eye();
    let once = Repeats {
        traversal: 1,
        smoothing: 1,
    };
    let kinds = [
        once,
        Repeats {
            traversal: REPEATS,
            ..once
        },
        Repeats {
            smoothing: REPEATS,
            ..once
        },
    ];
    // Drivers compile at the first use, and the first update places all blocks.
    ours.frame(eye, std::time::Duration::ZERO, u32::MAX)?;
    let mut times: [Vec<f64>; 3] = Default::default();
    let (mut paths, mut rays) = (0, 0);
    for run in 0..runs {
        progress.within(run as f32 / runs as f32);
        for (repeats, times) in kinds.iter().zip(&mut times) {
            ours.pipeline().set_repeats(*repeats);
            let before = ours.pipeline().rays()?;
            let (stats, _) = ours.frame(eye, std::time::Duration::ZERO, u32::MAX)?;
            times.push(stats.stages.light.as_secs_f64() * 1e3);
            (paths, rays) = (stats.paths, ours.pipeline().rays()? - before);
        }
    }
    let median = |kind: usize| {
        let mut sorted = times[kind].clone();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 2]
    };
    let more = f64::from(REPEATS - 1);
    let traversal_ms = (median(1) - median(0)) / more;
    let smoothing_ms = (median(2) - median(0)) / more;
    let tracing_ms = median(0) - smoothing_ms;
    let mrays_per_s = |ms: f64| rays as f64 / ms / 1e3;
    Ok(Row {
        scene: name.to_owned(),
        paths,
        rays,
        traversal_ms,
        shading_ms: tracing_ms - traversal_ms,
        smoothing_ms,
        traversal_mrays_per_s: mrays_per_s(traversal_ms),
        tracing_mrays_per_s: mrays_per_s(tracing_ms),
        share_of_traversal: traversal_ms / tracing_ms,
        smoothing_over_tracing: smoothing_ms / tracing_ms,
    })
}
