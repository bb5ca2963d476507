//! `shadecast-eval packing`: how fast and how well the atlas is managed.
//!
//! The packers beside each other, whole: `compare`. Then SAS by itself. The same walk
//! through the built-in scene, at several sizes, asks for patches; the allocator on
//! the GPU, its twin and a quadtree place them, and the twin over simpler memories
//! shows what each part of it is worth. GPU and twin must agree in every frame.
//!
//! Source: SAS 2018, sections 5.2 to 5.4, table 2 and figure 11.

mod compare;
mod culling;
mod page;
mod quadtree;
mod speed;
mod stage;
mod strategies;
mod strategy;
#[cfg(test)]
mod tests;
mod trace;

use std::{fmt::Write as _, path::PathBuf};

use anyhow::Result;
use clap::Args;
use shadecast_protocol::Method;
use shadecast_server::{
    Gpu,
    patches::{self, PatchLimits, PatchedScene},
    scene::{self, Scene},
};

use crate::{
    progress::Progress,
    report::{Folder, Header},
    scenes,
};

/// Triangles of the scene, and whether large ones are split as for streaming: for
/// about 1,900, 25,000 and 222,000 patches asked for.
const WALKS: [(usize, bool); 3] = [(7_000, false), (110_000, true), (1_300_000, true)];
/// Of these walks and of the sizes below, those of a quick run.
const QUICK_WALKS: usize = 2;
const QUICK_SIZES: usize = 2;

/// Triangles of the built-in scene, where no other is named.
const TRIANGLES: [usize; 3] = [15_000, 250_000, 1_000_000];
/// Sides of the atlases, texels: 1, 4 and 8 MPix. The last is the widest picture that
/// the video encoder takes, in whole superblocks.
const SIZES: [[u16; 2]; 3] = [[1024, 1024], [2048, 2048], [3840, 2048]];

/// Measures how fast and how well the atlas is managed.
#[derive(Args, Debug)]
pub struct Options {
    /// Scenes that packers are compared in, and nothing else is measured: `courtyard`,
    /// `lamps`, `plates`, or glTF files [default: the built-in one of 15,000, 250,000
    /// and 1,000,000 triangles, quick: of 15,000; then the allocator by itself].
    #[arg(value_name = "SCENE")]
    pub scenes: Vec<String>,
    /// Folder for figures.
    #[arg(long, value_name = "DIR", default_value = crate::OUT)]
    pub out: PathBuf,
    /// Fewer frames of smaller scenes.
    #[arg(long)]
    pub quick: bool,
    /// Frames of the walk that packers are compared along [default: 60, quick: 8].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub frames: Option<u32>,
}

/// Runs the measurement; the result is the page's tables.
///
/// # Errors
/// When a folder cannot be used, the GPU fails, or GPU and twin differ.
pub fn run(options: &Options) -> Result<String> {
    let walks = match options {
        Options { scenes, .. } if !scenes.is_empty() => &[],
        Options { quick: true, .. } => &WALKS[..QUICK_WALKS],
        _ => &WALKS[..],
    };
    let gpu = Gpu::open()?;
    let subjects = subjects(options)?;
    let sizes = if options.quick {
        &SIZES[..QUICK_SIZES]
    } else {
        &SIZES[..]
    };
    let runs = subjects.len() * sizes.len() * Method::ALL.len();
    let progress = Progress::new((runs + walks.len() + usize::from(!walks.is_empty())) as u64);
    let mut compared = Vec::new();
    for (name, scene) in &subjects {
        compared.push(compare::measure(
            name,
            scene,
            sizes,
            (options.quick, options.frames),
            &progress,
        )?);
    }
    let mut speeds = Vec::new();
    let mut kernels = Vec::new();
    for &(triangles, split) in walks {
        progress.step(&format!("a walk through {triangles} triangles"));
        let scene = walked(triangles, split);
        let measured = speed::measure(&gpu, &scene, options.quick, &progress)?;
        speeds.extend(measured.rows);
        kernels.extend(measured.kernels);
    }
    let folder = |name| {
        let walks = (walks.iter()).map(|(triangles, _)| courtyard_of(*triangles));
        let scenes = (subjects.iter()).map(|(name, _)| name.clone());
        let header = Header::new(name, &gpu.adapter, scenes.chain(walks).collect(), 0);
        Folder::new(&options.out, header)
    };
    let mut body = page::write(&folder("packing")?, &compared)?;
    let stages: Vec<stage::Row> = (compared.iter())
        .flat_map(|found| found.stages.iter().cloned())
        .collect();
    folder("packing-stage")?.csv(&stages)?;
    write!(body, "\n{}", stage::table_of(&stages))?;
    if !walks.is_empty() {
        progress.step("strategies");
        let scene = walked(strategy::TRIANGLES, true);
        let strategies = strategy::measure(&scene, options.quick, &progress);
        folder("packing-speed")?.csv(&speeds)?;
        folder("packing-kernels")?.csv(&kernels)?;
        folder("packing-strategies")?.csv(&strategies)?;
        let tables = [
            speed::table_of(&speeds),
            speed::table_of_kernels(&kernels),
            strategy::table_of(&strategies),
        ];
        write!(body, "\n{}", tables.join("\n"))?;
    }
    progress.finish();
    folder("packing")?.page("How fast and how well the atlas is managed", &body)?;
    Ok(body)
}

fn courtyard_of(triangles: usize) -> String {
    format!("courtyard of {triangles} triangles")
}

/// The scenes that packers are compared in.
fn subjects(options: &Options) -> Result<Vec<(String, Scene)>> {
    if options.scenes.is_empty() {
        let sizes = if options.quick {
            &TRIANGLES[..1]
        } else {
            &TRIANGLES[..]
        };
        let built_in = |&size: &usize| (courtyard_of(size), scene::courtyard(size));
        return Ok(sizes.iter().map(built_in).collect());
    }
    let named = |name: &String| Ok((name.clone(), scenes::named(name)?));
    options.scenes.iter().map(named).collect()
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
