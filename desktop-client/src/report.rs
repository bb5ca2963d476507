//! What a run amounts to, as client.json.

use std::path::Path;

use anyhow::{Context, Result};
use serde::Serialize;
use shadecast_client::LatencySummary;

/// The whole file.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    /// From the first picture to the end.
    pub(crate) seconds: f64,
    /// Display frames in that time.
    pub(crate) frames: u64,
    pub(crate) frames_per_second: f64,
    /// Upload, drawing and waiting for the GPU.
    pub(crate) frame_ms: Percentiles,
    pub(crate) missed_ticks: u64,
    pub(crate) video_bytes: u64,
    pub(crate) update_bytes: u64,
    pub(crate) updates: u64,
    pub(crate) updates_per_second: f64,
    /// Medians of the phases of SAS 2018, figure 2.
    pub(crate) latency_ms: Option<LatencySummary>,
    /// None where the system does not tell.
    pub(crate) peak_memory_bytes: Option<u64>,
    pub(crate) stereo: &'static str,
    pub(crate) adapter: String,
    pub(crate) samples: Vec<Sample>,
}

/// One eye as it was drawn at one moment.
#[derive(Debug, Serialize)]
pub(crate) struct Sample {
    /// File, relative to client.json.
    pub(crate) picture: String,
    /// The same atlas from where the server thought the head would be.
    pub(crate) unwarped: String,
    pub(crate) eye: &'static str,
    /// Of the eye in the world, metres.
    pub(crate) position: [f32; 3],
    /// Of the eye in the world, x y z w.
    pub(crate) orientation: [f32; 4],
    /// Angles of left, right, up and down, radians.
    pub(crate) fov: [f32; 4],
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Since the first picture.
    pub(crate) seconds: f64,
    /// From the sampling of the pose that the server answered to the moment of
    /// this one.
    pub(crate) pose_age_ms: f64,
    /// The scene's own time at this moment.
    pub(crate) scene_time_s: f64,
    pub(crate) frame: u32,
}

/// Of a list of durations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Percentiles {
    pub(crate) p50: f64,
    pub(crate) p95: f64,
    pub(crate) p99: f64,
}

impl Percentiles {
    /// By nearest rank; zero for an empty list.
    pub(crate) fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |percent: usize| {
            let rank = (sorted.len() * percent).div_ceil(100).max(1);
            sorted.get(rank - 1).copied().unwrap_or(0.0)
        };
        Self {
            p50: at(50),
            p95: at(95),
            p99: at(99),
        }
    }
}

impl Report {
    /// Writes `client.json` into `folder`.
    pub(crate) fn write(&self, folder: &Path) -> Result<()> {
        let path = folder.join("client.json");
        let text = serde_json::to_string_pretty(self).context("cannot write the report")?;
        std::fs::write(&path, text + "\n")
            .with_context(|| format!("cannot write {}", path.display()))
    }
}

/// The most memory that this process has had resident.
pub(crate) fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_of_the_nearest_rank() {
        let hundred: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        let expected = Percentiles {
            p50: 50.0,
            p95: 95.0,
            p99: 99.0,
        };
        assert_eq!(Percentiles::of(&hundred), expected);
        assert_eq!(Percentiles::of(&[7.0]).p99, 7.0);
        assert_eq!(Percentiles::of(&[]).p50, 0.0);
    }
}
