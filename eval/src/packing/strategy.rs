//! How the atlas fares without columns, stacks and resets, along one walk.

use serde::Serialize;
use shadecast_server::{
    atlas::{AtlasShape, AtlasTwin, Placed},
    patches::PatchedScene,
};
use shadecast_shaders::atlas::{Memory, Seen};

use super::{
    SIZES,
    quadtree::Quadtree,
    strategies::{Grids, Without},
    trace,
};
use crate::{progress::Progress, report::table};

/// Of the scene that the strategies are compared in.
pub(super) const TRIANGLES: usize = 100_000;
/// Frames of the walk: as many as figure 11 averages over.
const FRAMES: u32 = 1000;
const QUICK_FRAMES: u32 = 150;
/// Superblocks of an atlas are this many on its shorter side.
const SUPERBLOCKS: u16 = 8;

/// A line of `packing-strategies.csv`: shares of the atlas are means over frames.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    atlas_mpix: f64,
    strategy: &'static str,
    frames: u32,
    visible: f64,
    out_of_memory_frames: u32,
    unplaced_patches: u64,
    resets: u32,
    allocated: f64,
    /// At the ends of partly filled superblocks.
    tails: f64,
    /// On block stacks, or out of reach until a superblock is free.
    in_superblocks: f64,
    free_superblocks: f64,
    bias: f64,
}

pub(super) fn measure(scene: &PatchedScene, quick: bool, progress: &Progress) -> Vec<Row> {
    let frames = if quick { QUICK_FRAMES } else { FRAMES };
    let mut walks: Vec<Vec<Walk>> = SIZES.map(all).into();
    for frame in 0..frames {
        progress.within(frame as f32 / frames as f32);
        let seen = trace::seen(scene, frame);
        for walk in walks.iter_mut().flatten() {
            walk.frame(&seen);
        }
    }
    walks.into_iter().flatten().map(Walk::row).collect()
}

/// A frame of an atlas over whatever memory.
type Place = Box<dyn FnMut(&[Seen]) -> Placed>;

/// A strategy on its way.
struct Walk {
    place: Place,
    frames: u32,
    row: Row,
}

/// All strategies over an atlas of this size.
fn all(size: [u16; 2]) -> Vec<Walk> {
    let superblock = size[1] / SUPERBLOCKS;
    let Ok(shape) = AtlasShape::new(size, superblock) else {
        return Vec::new();
    };
    let (side, per_row, total) = (shape.log2_side(), shape.per_row(), shape.superblocks());
    let grids = |stacks, resets| Grids::new(Without { stacks, resets }, side, per_row, total);
    vec![
        Walk::new("S0, ours", shape, AtlasTwin::new(shape)),
        Walk::new(
            "S1, no columns",
            shape,
            AtlasTwin::over(shape, grids(false, false)),
        ),
        Walk::new(
            "S2, nor block stacks",
            shape,
            AtlasTwin::over(shape, grids(true, false)),
        ),
        Walk::new(
            "S3, nor atlas resets",
            shape,
            AtlasTwin::over(shape, grids(true, true)),
        ),
        Walk::new(
            "quadtree",
            shape,
            AtlasTwin::over(shape, Quadtree::new(side, per_row, total)),
        ),
    ]
}

impl Walk {
    fn new<M: Memory + 'static>(
        strategy: &'static str,
        shape: AtlasShape,
        mut atlas: AtlasTwin<M>,
    ) -> Self {
        Self {
            place: Box::new(move |seen| atlas.place(seen)),
            frames: 0,
            row: Row {
                atlas_mpix: shape.texels() as f64 / f64::from(1 << 20),
                strategy,
                frames: 0,
                visible: 0.0,
                out_of_memory_frames: 0,
                unplaced_patches: 0,
                resets: 0,
                allocated: 0.0,
                tails: 0.0,
                in_superblocks: 0.0,
                free_superblocks: 0.0,
                bias: 0.0,
            },
        }
    }

    fn frame(&mut self, seen: &[Seen]) {
        let placed = (self.place)(seen);
        let (row, stats) = (&mut self.row, &placed.stats);
        let share = |texels: u64| texels as f64 / stats.texels as f64;
        let free =
            share(stats.texels - stats.used_texels - stats.stacked_texels - stats.tail_texels);
        self.frames += 1;
        row.visible += seen.len() as f64;
        row.out_of_memory_frames += u32::from(placed.out_of_memory || placed.unplaced > 0);
        row.unplaced_patches += u64::from(placed.unplaced);
        row.resets = stats.resets;
        row.allocated += share(stats.used_texels);
        row.tails += share(stats.tail_texels);
        row.in_superblocks += share(stats.stacked_texels);
        row.free_superblocks += free;
        row.bias += f64::from(placed.bias);
    }

    fn row(self) -> Row {
        let mean = |sum: f64| sum / f64::from(self.frames.max(1));
        Row {
            frames: self.frames,
            visible: mean(self.row.visible),
            allocated: mean(self.row.allocated),
            tails: mean(self.row.tails),
            in_superblocks: mean(self.row.in_superblocks),
            free_superblocks: mean(self.row.free_superblocks),
            bias: mean(self.row.bias),
            ..self.row
        }
    }
}

pub(super) fn table_of(rows: &[Row]) -> String {
    let columns = [
        "atlas, MPix",
        "strategy",
        "frames out of memory",
        "patches without a block",
        "resets",
        "allocated",
        "ends of superblocks",
        "free within superblocks",
        "free superblocks",
        "bias",
    ];
    let percent = |share: f64| format!("{:.1} %", share * 100.0);
    let lines = rows.iter().map(|row| {
        vec![
            format!("{:.0}", row.atlas_mpix),
            row.strategy.to_owned(),
            row.out_of_memory_frames.to_string(),
            row.unplaced_patches.to_string(),
            row.resets.to_string(),
            percent(row.allocated),
            percent(row.tails),
            percent(row.in_superblocks),
            percent(row.free_superblocks),
            format!("{:.2}", row.bias),
        ]
    });
    let frames = rows.first().map_or(0, |row| row.frames);
    let visible = rows.first().map_or(0.0, |row| row.visible);
    format!(
        "## Strategies, {frames} frames of {visible:.0} visible patches\n\n{}",
        table(&columns, lines)
    )
}
