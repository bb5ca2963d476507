//! `shadecast-eval packing`: how fast and how well the atlas is managed.
//!
//! The same walk through the built-in scene, at several sizes, asks for patches;
//! the allocator on the GPU, its twin and a quadtree place them, and the twin over
//! simpler memories shows what each part of it is worth. GPU and twin must agree in
//! every frame. Nothing is drawn: what is compared is where blocks lie.
//!
//! Source: SAS 2018, sections 5.3 and 5.4, table 2 and figure 11.

mod quadtree;
mod speed;
mod strategies;
mod strategy;
#[cfg(test)]
mod tests;
mod trace;

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use shadecast_server::{
    Gpu,
    patches::{self, PatchLimits, PatchedScene},
    scene,
};

use crate::{
    progress::Progress,
    report::{Folder, Header},
};

/// Triangles of the scene, and whether large ones are split as for streaming: for
/// about 1,000, 10,000 and 100,000 patches asked for.
const WALKS: [(usize, bool); 3] = [(7_000, false), (110_000, true), (1_300_000, true)];
/// Of these walks, those of a quick run.
const QUICK_WALKS: usize = 2;

/// Measures how fast and how well the atlas is managed.
#[derive(Args, Debug)]
pub struct Options {
    /// Folder for figures.
    #[arg(long, value_name = "DIR", default_value = crate::OUT)]
    pub out: PathBuf,
    /// Fewer frames of smaller scenes.
    #[arg(long)]
    pub quick: bool,
}

/// Runs the measurement; the result is the page's tables.
///
/// # Errors
/// When a folder cannot be used, the GPU fails, or GPU and twin differ.
pub fn run(options: &Options) -> Result<String> {
    let walks = if options.quick {
        &WALKS[..QUICK_WALKS]
    } else {
        &WALKS[..]
    };
    let gpu = Gpu::open()?;
    let progress = Progress::new(walks.len() as u64 + 1);
    let mut speeds = Vec::new();
    let mut kernels = Vec::new();
    for &(triangles, split) in walks {
        progress.step(&format!("a walk through {triangles} triangles"));
        let scene = walked(triangles, split);
        let measured = speed::measure(&gpu, &scene, options.quick, &progress)?;
        speeds.extend(measured.rows);
        kernels.extend(measured.kernels);
    }
    progress.step("strategies");
    let strategies =
        strategy::measure(&walked(strategy::TRIANGLES, true), options.quick, &progress);
    progress.finish();
    let folder = |name| {
        let scenes = walks
            .iter()
            .map(|(t, _)| format!("courtyard of {t} triangles"));
        let header = Header::new(name, &gpu.adapter, scenes.collect(), 0);
        Folder::new(&options.out, header)
    };
    folder("packing-speed")?.csv(&speeds)?;
    folder("packing-kernels")?.csv(&kernels)?;
    folder("packing-strategies")?.csv(&strategies)?;
    let body = format!(
        "{}\n{}\n{}",
        speed::table_of(&speeds),
        speed::table_of_kernels(&kernels),
        strategy::table_of(&strategies),
    );
    folder("packing")?.page("How fast and how well the atlas is managed", &body)?;
    Ok(body)
}

/// The built-in scene in patches; split for superblocks of 256 texels.
fn walked(triangles: usize, split: bool) -> PatchedScene {
    let for_streaming = PatchLimits::for_atlas(256, trace::PIXELS_PER_RADIAN);
    let limits = PatchLimits {
        longest_edge: if split {
            for_streaming.longest_edge
        } else {
            f32::MAX
        },
        ..for_streaming
    };
    patches::cut(scene::courtyard(triangles), limits)
}
