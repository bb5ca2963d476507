//! Time of a frame of the atlas: on the GPU, of its twin, and of a quadtree.
//!
//! Everything from the patches asked for to the list of what has moved is timed,
//! on the GPU with reading that list back. What is asked for lies on the GPU
//! beforehand, as it does in the server.

use anyhow::{Result, ensure};
use serde::Serialize;
use shadecast_protocol::Placement;
use shadecast_server::{
    Gpu,
    atlas::{Atlas, AtlasShape, AtlasTwin, Placed},
    patches::PatchedScene,
};
use shadecast_shaders::{
    atlas::Seen,
    visibility::{seen_words, with_seen_bits},
};

use super::{quadtree::Quadtree, trace};
use crate::{
    progress::Progress,
    report::{Spent, table, timed},
};

/// Side of the atlas and of its superblocks, texels: 4 MPix, as in SAS 2018.
const SIDE: u16 = 2048;
const SUPERBLOCK: u16 = 256;
/// Frames of the walk.
const FRAMES: u32 = 90;
const QUICK_FRAMES: u32 = 30;

/// A line of `packing-speed.csv`. Times are milliseconds of a frame.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    triangles: usize,
    patches: usize,
    /// Asked for, on average.
    visible: f64,
    allocator: &'static str,
    /// Of the first frame, which places everything.
    first_ms: f64,
    median_ms: f64,
    p95_ms: f64,
    median_cpu_ms: f64,
    /// Median of the quadtree over this one's: how much faster than the quadtree.
    speedup: f64,
    /// Placed or moved in a frame, on average.
    placements: f64,
    resets: u32,
    out_of_memory: u32,
    bias: f64,
}

/// A line of `packing-kernels.csv`: medians on the device's own clock.
#[derive(Clone, Debug, Serialize)]
pub(super) struct KernelRow {
    triangles: usize,
    visible: f64,
    kernel: &'static str,
    milliseconds: f64,
}

pub(super) struct Measured {
    pub(super) rows: Vec<Row>,
    pub(super) kernels: Vec<KernelRow>,
}

/// What an allocator made of the walk.
struct Run {
    allocator: &'static str,
    spent: Vec<Spent>,
    placed: Vec<Summary>,
}

/// Of a frame: what rows are made of, and what must be alike.
#[derive(Clone, Debug, PartialEq)]
struct Summary {
    placements: Vec<Placement>,
    removals: usize,
    reset: bool,
    out_of_memory: bool,
    bias: f32,
    resets: u32,
}

impl Run {
    fn new(allocator: &'static str) -> Self {
        Self {
            allocator,
            spent: Vec::new(),
            placed: Vec::new(),
        }
    }

    fn frame(&mut self, place: impl FnOnce() -> Result<Placed>) -> Result<()> {
        let (placed, spent) = timed(place)?;
        self.spent.push(spent);
        self.placed.push(Summary {
            removals: placed.removals.len(),
            reset: placed.reset,
            out_of_memory: placed.out_of_memory,
            bias: placed.bias,
            resets: placed.stats.resets,
            placements: placed.placements,
        });
        Ok(())
    }
}

pub(super) fn measure(
    gpu: &Gpu,
    scene: &PatchedScene,
    quick: bool,
    progress: &Progress,
) -> Result<Measured> {
    let frames = if quick { QUICK_FRAMES } else { FRAMES };
    let shape = AtlasShape::new([SIDE; 2], SUPERBLOCK)?;
    let patches = scene.patches.len() as u32;
    let mut on_gpu = OnGpu::new(gpu, shape, patches)?;
    let mut twin = AtlasTwin::new(shape);
    let tree = Quadtree::new(shape.log2_side(), shape.per_row(), shape.superblocks());
    let mut tree = AtlasTwin::over(shape, tree);
    let mut runs = ["GPU", "twin on the CPU", "quadtree on the CPU"].map(Run::new);
    let mut visible = 0;
    on_gpu.warm_up(gpu, shape, patches)?;
    for frame in 0..frames {
        progress.within(frame as f32 / frames as f32);
        let seen = trace::seen(scene, frame);
        visible += seen.len();
        on_gpu.ask(gpu, &seen)?;
        let encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        runs[0].frame(|| Ok(on_gpu.atlas.place(gpu, encoder)?))?;
        runs[1].frame(|| Ok(twin.place(&seen)))?;
        runs[2].frame(|| Ok(tree.place(&seen)))?;
        ensure!(
            runs[0].placed.last() == runs[1].placed.last(),
            "the GPU and its twin place frame {frame} of {patches} patches differently"
        );
    }
    let visible = visible as f64 / f64::from(frames);
    let kernels = on_gpu.kernels(gpu, scene, frames, visible)?;
    let mut rows: Vec<Row> = runs.iter().map(|run| row(run, scene, visible)).collect();
    let quadtree = rows[2].median_ms;
    for row in &mut rows {
        row.speedup = quadtree / row.median_ms;
    }
    Ok(Measured { rows, kernels })
}

/// The atlas and what is asked of it.
struct OnGpu {
    atlas: Atlas,
    pixels: wgpu::Buffer,
    patches: usize,
}

impl OnGpu {
    fn new(gpu: &Gpu, shape: AtlasShape, patches: u32) -> Result<Self> {
        let pixels = gpu.scratch("pixels of patch", u64::from(seen_words(patches)) * 4)?;
        Ok(Self {
            atlas: Atlas::new(gpu, shape, patches, &pixels)?,
            pixels,
            patches: patches as usize,
        })
    }

    /// Drivers compile at the first use.
    fn warm_up(&mut self, gpu: &Gpu, shape: AtlasShape, patches: u32) -> Result<()> {
        self.ask(gpu, &[])?;
        self.atlas.place_timed(gpu)?;
        self.atlas = Atlas::new(gpu, shape, patches, &self.pixels)?;
        Ok(())
    }

    fn ask(&self, gpu: &Gpu, seen: &[Seen]) -> Result<()> {
        let mut pixels = vec![0_u32; self.patches];
        let mut wishes = vec![0_u32; self.patches];
        for seen in seen {
            pixels[seen.patch as usize] = seen.pixels;
            wishes[seen.patch as usize] = seen.wish.word();
        }
        let queue = &gpu.queue;
        let pixels = with_seen_bits(pixels);
        queue.write_buffer(&self.pixels, 0, bytemuck::cast_slice(&pixels));
        queue.write_buffer(self.atlas.wishes(), 0, bytemuck::cast_slice(&wishes));
        queue.submit([]);
        Ok(gpu.wait()?)
    }

    /// The walk goes on, and every kernel is timed.
    fn kernels(
        &mut self,
        gpu: &Gpu,
        scene: &PatchedScene,
        frames: u32,
        visible: f64,
    ) -> Result<Vec<KernelRow>> {
        let mut names: Vec<&'static str> = Vec::new();
        let mut times: Vec<Vec<f64>> = Vec::new();
        for frame in frames..frames + frames / 2 {
            self.ask(gpu, &trace::seen(scene, frame))?;
            let (_, spent) = self.atlas.place_timed(gpu)?;
            names = spent.iter().map(|(name, _)| *name).collect();
            times.push(spent.iter().map(|(_, t)| t.as_secs_f64() * 1e3).collect());
        }
        let rows = names.into_iter().enumerate().map(|(at, kernel)| KernelRow {
            triangles: scene.scene.triangles.len(),
            visible,
            kernel,
            milliseconds: quantile(times.iter().map(|frame| frame[at]), 0.5),
        });
        Ok(rows.collect())
    }
}

fn row(run: &Run, scene: &PatchedScene, visible: f64) -> Row {
    let later = &run.spent[1..];
    let wall = |spent: &Spent| spent.wall.as_secs_f64() * 1e3;
    let frames = run.placed.len() as f64;
    Row {
        triangles: scene.scene.triangles.len(),
        patches: scene.patches.len(),
        visible,
        allocator: run.allocator,
        first_ms: wall(&run.spent[0]),
        median_ms: quantile(later.iter().map(wall), 0.5),
        p95_ms: quantile(later.iter().map(wall), 0.95),
        median_cpu_ms: quantile(later.iter().map(|s| s.cpu.as_secs_f64() * 1e3), 0.5),
        speedup: f64::NAN,
        placements: run
            .placed
            .iter()
            .map(|p| p.placements.len() as f64)
            .sum::<f64>()
            / frames,
        resets: run.placed.last().map_or(0, |placed| placed.resets),
        out_of_memory: run
            .placed
            .iter()
            .filter(|placed| placed.out_of_memory)
            .count() as u32,
        bias: run.placed.iter().map(|p| f64::from(p.bias)).sum::<f64>() / frames,
    }
}

fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let at = (sorted.len().saturating_sub(1) as f64 * share).round() as usize;
    sorted.get(at).copied().unwrap_or(f64::NAN)
}

pub(super) fn table_of(rows: &[Row]) -> String {
    let columns = [
        "visible patches",
        "of",
        "allocator",
        "first frame, ms",
        "median, ms",
        "95 %, ms",
        "median CPU, ms",
        "speed in quadtree's",
        "placed a frame",
        "resets",
        "out of memory",
        "bias",
    ];
    let lines = rows.iter().map(|row| {
        vec![
            format!("{:.0}", row.visible),
            row.patches.to_string(),
            row.allocator.to_owned(),
            format!("{:.2}", row.first_ms),
            format!("{:.2}", row.median_ms),
            format!("{:.2}", row.p95_ms),
            format!("{:.2}", row.median_cpu_ms),
            format!("{:.2}", row.speedup),
            format!("{:.0}", row.placements),
            row.resets.to_string(),
            row.out_of_memory.to_string(),
            format!("{:.2}", row.bias),
        ]
    });
    format!(
        "## Time of a frame\n\nThe GPU finds what is visible among all patches, and its \
         result is read back; the others are given the list of what is visible.\n\n{}",
        table(&columns, lines)
    )
}

/// Kernels beside each other, sizes below.
pub(super) fn table_of_kernels(rows: &[KernelRow]) -> String {
    let lines = rows.iter().map(|row| {
        vec![
            format!("{:.0}", row.visible),
            row.kernel.to_owned(),
            format!("{:.3}", row.milliseconds),
        ]
    });
    let columns = ["visible patches", "kernel", "median, ms"];
    format!("## Kernels on the device\n\n{}", table(&columns, lines))
}
