//! What a packer's own stage adds to the light's.
//!
//! The same walk, with light traced at one path a texel and one bounce, as the server
//! does by itself. A packer's stage is all from knowing what is visible to knowing on
//! the CPU what lies where; the light's is all from there to radiance that can be shown:
//! what moves is carried along, paths are traced, means are smoothed. Both are of the
//! same frames, so that a machine that is busy otherwise slows both.

use anyhow::Result;
use serde::Serialize;
use shadecast_protocol::Method;
use shadecast_server::scene::Scene;

use super::trace;
use crate::{
    ours::even::Even,
    report::{Spent, table},
};

/// Frames that are timed, after a first one that places everything and for which
/// drivers compile.
const FRAMES: u32 = 3;
const QUICK_FRAMES: u32 = 1;
/// The first frame has this part of the paths.
const COARSE: u32 = 64;
/// Of the light's stage, that a packer's may take.
const MOST: f64 = 0.15;

/// A line of `packing-stage.csv`. Times are means of a frame.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    scene: String,
    triangles: usize,
    packer: &'static str,
    atlas_mpix: f64,
    frames: u32,
    visible: f64,
    /// In slots.
    texels: f64,
    paths: f64,
    packing_ms: f64,
    packing_cpu_ms: f64,
    /// With as many paths as there are texels.
    light_ms: f64,
    light_cpu_ms: f64,
    /// Of the packer's stage over the light's.
    share: f64,
    cpu_share: f64,
}

/// Times a packer whose slots have about so many texels.
pub(super) fn measure(
    name: &str,
    scene: &Scene,
    method: Method,
    size: [u16; 2],
    texels: u64,
    quick: bool,
) -> Result<Row> {
    let budget = u32::try_from(texels).unwrap_or(u32::MAX);
    let mut server = Even::traced(scene, method, size)?;
    let frames = if quick { QUICK_FRAMES } else { FRAMES };
    let (mut packing, mut light) = (Spent::default(), Spent::default());
    let (mut visible, mut texels, mut paths) = (0.0, 0.0, 0.0);
    for frame in 0..=frames {
        // The first one may be coarse.
        server.set_paths(if frame == 0 { budget / COARSE } else { budget });
        let made = server.frame(&|seconds| trace::head(scene, seconds), frame)?;
        if frame == 0 {
            continue;
        }
        packing += made.packing;
        light += made.light;
        let stats = &made.frame.stats;
        visible += f64::from(stats.visible);
        texels += stats.atlas.used_texels as f64;
        paths += f64::from(stats.paths);
    }
    let count = f64::from(frames);
    let (packing, light) = (packing / frames, light / frames);
    let ms = |time: std::time::Duration| time.as_secs_f64() * 1e3;
    let whole = texels / f64::max(paths, 1.0);
    let (light_ms, light_cpu_ms) = (ms(light.wall) * whole, ms(light.cpu) * whole);
    Ok(Row {
        scene: name.to_owned(),
        triangles: server.scene().scene.triangles.len(),
        packer: method.name(),
        atlas_mpix: server.texels() as f64 / f64::from(1 << 20),
        frames,
        visible: visible / count,
        texels: texels / count,
        paths: paths / count,
        packing_ms: ms(packing.wall),
        packing_cpu_ms: ms(packing.cpu),
        light_ms,
        light_cpu_ms,
        share: ms(packing.wall) / light_ms,
        cpu_share: ms(packing.cpu) / light_cpu_ms,
    })
}

pub(super) fn table_of(rows: &[Row]) -> String {
    let columns = [
        "scene",
        "atlas, MPix",
        "packer",
        "visible",
        "texels",
        "packer's stage, ms",
        "CPU ms",
        "light's stage, ms",
        "CPU ms",
        "packer's over light's",
        "of CPU time",
        "at most 15 %",
    ];
    let percent = |share: f64| format!("{:.1} %", share * 100.0);
    let lines = rows.iter().map(|row| {
        let holds = row.share <= MOST && row.cpu_share <= MOST;
        vec![
            row.scene.clone(),
            format!("{:.0}", row.atlas_mpix),
            row.packer.to_owned(),
            format!("{:.0}", row.visible),
            format!("{:.0}", row.texels),
            format!("{:.1}", row.packing_ms),
            format!("{:.1}", row.packing_cpu_ms),
            format!("{:.0}", row.light_ms),
            format!("{:.0}", row.light_cpu_ms),
            percent(row.share),
            percent(row.cpu_share),
            if holds { "reached" } else { "not reached" }.to_owned(),
        ]
    });
    format!(
        "## A packer's stage beside the light's\n\nThe light has one path for each texel in a \
         slot and one bounce. Means of {} frames.\n\n{}",
        rows.first().map_or(0, |row| row.frames),
        table(&columns, lines)
    )
}
