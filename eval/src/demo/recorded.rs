//! What the two ends wrote about a run: `client.json` and `server.json`.

use std::{collections::BTreeMap, fs::File, io::BufReader, path::Path, time::Duration};

use anyhow::{Context, Result, ensure};
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use shadecast_protocol::{Fov, Pose};
use shadecast_server::still::Camera;

/// `client.json`.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct ClientRecord {
    pub(super) seconds: f64,
    pub(super) frames_per_second: f64,
    pub(super) frame_ms: Percentiles,
    pub(super) missed_ticks: u64,
    pub(super) video_bytes: u64,
    pub(super) update_bytes: u64,
    /// None when no update came to be replaced by another.
    pub(super) latency_ms: Option<LatencyPhases>,
    /// None where the system does not tell.
    pub(super) peak_memory_bytes: Option<u64>,
    pub(super) stereo: String,
    pub(super) adapter: String,
    pub(super) samples: Vec<Sample>,
}

/// `server.json`.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct ServerRecord {
    pub(super) updates_per_second: f64,
    pub(super) atlas_used_fraction: f64,
    pub(super) atlas_resets: u64,
    pub(super) visible_patches: u64,
    pub(super) texels_per_update: u64,
    /// Factor from radiance to what is tone-mapped.
    pub(super) exposure: f32,
    /// None where the system does not tell.
    pub(super) peak_memory_bytes: Option<u64>,
    pub(super) adapter: String,
    /// Medians by the name of the stage.
    pub(super) stages_ms: BTreeMap<String, f64>,
    pub(super) scene: String,
    pub(super) patches: PatchShares,
    /// One sentence each.
    pub(super) left_out: Vec<String>,
}

/// Percentiles of the time that a display frame took.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Percentiles {
    pub(super) p50: f64,
    pub(super) p95: f64,
    pub(super) p99: f64,
}

/// Shares of the patches of one, two and three triangles, 0 to 1.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct PatchShares {
    pub(super) solo: f64,
    pub(super) pair: f64,
    pub(super) triple: f64,
}

/// Medians of the eight phases of SAS 2018, figure 2, and of the sum of the
/// first seven.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct LatencyPhases {
    pub(super) pose_to_server: f64,
    pub(super) wait_at_server: f64,
    pub(super) server_processing: f64,
    pub(super) transfer: f64,
    pub(super) decode: f64,
    pub(super) wait_at_client: f64,
    pub(super) draw: f64,
    pub(super) shown: f64,
    pub(super) total: f64,
}

/// A picture that the client kept, and the pose at which it drew it.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Sample {
    /// Of one eye before the lens; relative to the folder of the record.
    pub(super) picture: String,
    /// The same atlas drawn at the pose that the server made it for.
    pub(super) unwarped: String,
    pub(super) eye: String,
    position: Vec3,
    orientation: Quat,
    /// Left, right, up, down, radians.
    fov: [f32; 4],
    width: u32,
    height: u32,
    /// Since the client's first picture.
    pub(super) seconds: f64,
    /// From the sampling of the server's pose to the drawing.
    pub(super) pose_age_ms: f64,
    scene_time_s: f64,
    pub(super) frame: u32,
}

impl Sample {
    /// Where the reference is taken from.
    pub(super) fn camera(&self) -> Camera {
        let [left, right, up, down] = self.fov;
        Camera {
            world_from_eye: Pose {
                position: self.position,
                orientation: self.orientation,
            },
            fov: Fov {
                left,
                right,
                up,
                down,
            },
            width: self.width,
            height: self.height,
        }
    }

    /// Where moving objects were.
    pub(super) fn scene_time(&self) -> Result<Duration> {
        Duration::try_from_secs_f64(self.scene_time_s)
            .with_context(|| format!("{} has an impossible scene time", self.picture))
    }
}

impl ClientRecord {
    pub(super) fn read(path: &Path) -> Result<Self> {
        let record: Self = read(path)?;
        record.check().with_context(|| path.display().to_string())?;
        Ok(record)
    }

    fn check(&self) -> Result<()> {
        for sample in &self.samples {
            ensure!(
                sample.camera().world_from_eye.is_valid(),
                "{} has an impossible pose",
                sample.picture
            );
            sample.scene_time()?;
        }
        Ok(())
    }
}

impl ServerRecord {
    pub(super) fn read(path: &Path) -> Result<Self> {
        read(path)
    }
}

fn read<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let file = File::open(path).with_context(|| format!("cannot open {}", path.display()))?;
    serde_json::from_reader(BufReader::new(file))
        .with_context(|| format!("{} is not as expected", path.display()))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::demo) fn client() -> ClientRecord {
        serde_json::from_str(
            r#"{
                "seconds": 20.0, "frames": 590, "frames_per_second": 29.5,
                "frame_ms": {"p50": 12.0, "p95": 20.0, "p99": 30.5},
                "missed_ticks": 3, "video_bytes": 5000000, "update_bytes": 900000,
                "updates": 90, "updates_per_second": 4.5,
                "latency_ms": {
                    "pose_to_server": 1.0, "wait_at_server": 100.0, "server_processing": 220.0,
                    "transfer": 2.0, "decode": 3.0, "wait_at_client": 16.0, "draw": 12.0,
                    "shown": 240.0, "total": 350.0
                },
                "peak_memory_bytes": 150000000, "stereo": "two_pass", "adapter": "llvmpipe",
                "samples": [{
                    "picture": "samples/00.png", "unwarped": "samples/00_unwarped.png",
                    "eye": "left", "position": [0.5, 1.6, -2.0],
                    "orientation": [0.0, 1.0, 0.0, 0.0], "fov": [-0.8, 0.7, 0.6, -0.5],
                    "width": 256, "height": 128, "seconds": 5.1, "pose_age_ms": 230.5,
                    "scene_time_s": 6.25, "frame": 21
                }]
            }"#,
        )
        .expect("a record")
    }

    pub(in crate::demo) fn server() -> ServerRecord {
        serde_json::from_str(
            r#"{
                "updates": 90, "seconds": 20.0, "updates_per_second": 4.5,
                "atlas_used_fraction": 0.4, "atlas_resets": 0, "visible_patches": 4000,
                "video_bytes": 5000000, "update_bytes": 900000, "exposure": 1.5,
                "peak_memory_bytes": 200000000, "adapter": "llvmpipe",
                "stages_ms": {"light": 120.5, "encode": 3.0}, "scene": "courtyard",
                "patches": {"solo": 0.1, "pair": 0.8, "triple": 0.1}, "texels_per_update": 40000,
                "left_out": ["no alpha masks"]
            }"#,
        )
        .expect("a record")
    }

    #[test]
    fn a_sample_is_the_camera_that_it_was_drawn_with() {
        let record = client();
        let camera = record.samples[0].camera();
        assert_eq!(camera.world_from_eye.position, Vec3::new(0.5, 1.6, -2.0));
        assert_eq!(
            camera.world_from_eye.orientation,
            Quat::from_xyzw(0.0, 1.0, 0.0, 0.0)
        );
        assert_eq!((camera.fov.left, camera.fov.down), (-0.8, -0.5));
        assert_eq!((camera.width, camera.height), (256, 128));
        assert_eq!(
            record.samples[0].scene_time().unwrap(),
            Duration::from_millis(6250)
        );
    }

    #[test]
    fn impossible_samples_are_refused() {
        let mut record = client();
        record.samples[0].orientation = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
        assert!(
            record
                .check()
                .unwrap_err()
                .to_string()
                .contains("impossible pose")
        );
        let mut record = client();
        record.samples[0].scene_time_s = -1.0;
        assert!(
            record
                .check()
                .unwrap_err()
                .to_string()
                .contains("impossible scene time")
        );
    }
}
