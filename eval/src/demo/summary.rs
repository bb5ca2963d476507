//! `summary.json`: everything that a run is judged by, as numbers.

use std::{collections::BTreeMap, thread, time::Duration};

use anyhow::Result;
use serde::Serialize;

use super::{
    Options,
    errors::SampleError,
    recorded::{ClientRecord, LatencyPhases, PatchShares, Percentiles, ServerRecord},
};
use crate::{psnr_from_mean_squared_error, report::processor};

/// The figures of a run.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Summary {
    pub(super) server_updates_per_second: f64,
    pub(super) client_frames_per_second: f64,
    pub(super) client_frame_ms: Percentiles,
    pub(super) video_bytes: u64,
    pub(super) update_bytes: u64,
    pub(super) seconds: f64,
    pub(super) atlas_used_fraction: f64,
    pub(super) atlas_resets: u64,
    pub(super) visible_patches: u64,
    pub(super) latency_ms: Option<LatencyPhases>,
    pub(super) error: MeanError,
    pub(super) peak_memory_bytes: PeakMemory,

    pub(super) missed_ticks: u64,
    pub(super) texels_per_update: u64,
    pub(super) server_stages_ms: BTreeMap<String, f64>,
    pub(super) patches: PatchShares,
    pub(super) left_out: Vec<String>,
    pub(super) scene: String,
    pub(super) settings: Settings,
    pub(super) machine: Machine,
    /// Wall time from the start of the server to this summary.
    pub(super) demo_seconds: f64,
}

/// What a window without any error counts as, dB: about half a code value of
/// 8 bits everywhere.
const BEST_PSNR: f64 = 54.0;

/// Over the compared windows, one of each of `frames` pictures.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct MeanError {
    pub(super) frames: usize,
    /// Mean over the windows; one that shows nothing but sky would be infinite,
    /// and counts as [`BEST_PSNR`].
    pub(super) psnr_db: f64,
    /// Of the mean of the squared errors, which the worst windows decide.
    pub(super) psnr_of_mean_square_db: f64,
    pub(super) ssim: f64,
    pub(super) flip: f64,
    pub(super) flip_unwarped: f64,
    pub(super) pose_age_ms: f64,
    /// The same as `psnr_of_mean_square_db` for the references against themselves without
    /// noise: no picture can be measured to be much better.
    pub(super) psnr_reference_ceiling_db: f64,
    /// The same as `psnr_of_mean_square_db` with the references' noise taken off: its squared
    /// error and the client's add up, since neither knows of the other.
    pub(super) psnr_without_reference_noise_db: f64,
    /// Samples a pixel of a reference.
    pub(super) reference_samples: u32,
    /// Side of a window, pixels.
    pub(super) window: u32,
}

/// Largest resident memory, where the system tells.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct PeakMemory {
    pub(super) server: Option<u64>,
    pub(super) client: Option<u64>,
}

/// What the run was asked for.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Settings {
    pub(super) method: &'static str,
    pub(super) seed: u32,
    pub(super) seconds: u32,
    pub(super) atlas: u32,
    pub(super) eye_size: u32,
    pub(super) display_rate: u32,
    /// Mbit/s.
    pub(super) bitrate: f64,
}

/// Where it ran.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Machine {
    pub(super) processor: String,
    pub(super) cores: usize,
    pub(super) server_adapter: String,
    pub(super) client_adapter: String,
    pub(super) stereo: String,
}

impl Summary {
    pub(super) fn new(
        options: &Options,
        client: &ClientRecord,
        server: &ServerRecord,
        errors: &[SampleError],
        reference_samples: u32,
        elapsed: Duration,
    ) -> Self {
        let mean = |figure: fn(&SampleError) -> f64| {
            errors.iter().map(figure).sum::<f64>() / errors.len() as f64
        };
        let squared_error = mean(|error| error.mean_squared_error);
        let noise = mean(|error| error.reference_noise);
        Self {
            server_updates_per_second: server.updates_per_second,
            client_frames_per_second: client.frames_per_second,
            client_frame_ms: client.frame_ms,
            video_bytes: client.video_bytes,
            update_bytes: client.update_bytes,
            seconds: client.seconds,
            atlas_used_fraction: server.atlas_used_fraction,
            atlas_resets: server.atlas_resets,
            visible_patches: server.visible_patches,
            latency_ms: client.latency_ms,
            error: MeanError {
                frames: errors.len(),
                psnr_db: mean(|error| error.psnr_db().min(BEST_PSNR)),
                psnr_of_mean_square_db: psnr_from_mean_squared_error(squared_error),
                ssim: mean(|error| error.ssim),
                flip: mean(|error| error.flip),
                flip_unwarped: mean(|error| error.flip_unwarped),
                pose_age_ms: mean(|error| error.pose_age_ms),
                psnr_reference_ceiling_db: psnr_from_mean_squared_error(noise),
                psnr_without_reference_noise_db: psnr_from_mean_squared_error(
                    (squared_error - noise).max(0.0),
                ),
                reference_samples,
                window: errors.first().map_or(0, |error| error.window.width),
            },
            peak_memory_bytes: PeakMemory {
                server: server.peak_memory_bytes,
                client: client.peak_memory_bytes,
            },
            missed_ticks: client.missed_ticks,
            texels_per_update: server.texels_per_update,
            server_stages_ms: server.stages_ms.clone(),
            patches: server.patches,
            left_out: server.left_out.clone(),
            scene: server.scene.clone(),
            settings: Settings {
                method: options.method.name(),
                seed: options.seed,
                seconds: options.seconds,
                atlas: options.atlas,
                eye_size: options.eye_size,
                display_rate: options.display_rate,
                bitrate: options.bitrate,
            },
            machine: Machine {
                processor: processor(),
                cores: thread::available_parallelism().map_or(1, Into::into),
                server_adapter: server.adapter.clone(),
                client_adapter: client.adapter.clone(),
                stereo: client.stereo.clone(),
            },
            demo_seconds: elapsed.as_secs_f64(),
        }
    }

    pub(super) fn to_json(&self) -> Result<String> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }
}

/// The processor's name where Linux tells it, else its architecture.
#[cfg(test)]
pub(super) mod tests {
    use std::path::PathBuf;

    use shadecast_protocol::Method;

    use super::*;
    use crate::demo::{
        recorded::tests::{client, server},
        window::Window,
    };

    pub(in crate::demo) fn errors() -> Vec<SampleError> {
        let of = |mean_squared_error| SampleError {
            picture: "samples/00.png".into(),
            eye: "left".into(),
            seconds: 5.1,
            pose_age_ms: 230.0,
            frame: 21,
            window: Window {
                x: 44,
                y: 88,
                width: 80,
                height: 80,
            },
            mean_squared_error,
            ssim: 0.9,
            flip: 0.1,
            flip_unwarped: 0.2,
            reference_noise: 1e-4,
        };
        vec![of(0.0), of(4e-3)]
    }

    pub(in crate::demo) fn summary() -> Summary {
        let options = Options {
            out: PathBuf::from("demo-out"),
            scene: PathBuf::from("courtyard"),
            method: Method::Sas,
            triangles: 15_000,
            seconds: 20,
            atlas: 512,
            eye_size: 256,
            display_rate: 30,
            bitrate: 20.0,
            seed: 1,
            reference_seconds: 50,
            whole: false,
        };
        let elapsed = Duration::from_secs(80);
        Summary::new(&options, &client(), &server(), &errors(), 16, elapsed)
    }

    /// Equal windows count, and do not make the whole infinite.
    #[test]
    fn errors_are_means() {
        let error = summary().error;
        assert_eq!(error.frames, 2);
        assert!((error.psnr_db - 38.9897).abs() < 1e-3, "{}", error.psnr_db);
        assert!((error.psnr_of_mean_square_db - 26.9897).abs() < 1e-4);
        assert!((error.psnr_reference_ceiling_db - 40.0).abs() < 1e-9);
        let without_noise = error.psnr_without_reference_noise_db;
        assert!((without_noise - 27.2125).abs() < 1e-4, "{without_noise}");
        assert_eq!((error.reference_samples, error.window), (16, 80));
    }

    /// Others read these keys.
    #[test]
    fn keys_stay() {
        let json: serde_json::Value = serde_json::from_str(&summary().to_json().unwrap()).unwrap();
        for key in [
            "/server_updates_per_second",
            "/client_frames_per_second",
            "/client_frame_ms/p50",
            "/client_frame_ms/p95",
            "/client_frame_ms/p99",
            "/video_bytes",
            "/update_bytes",
            "/seconds",
            "/atlas_used_fraction",
            "/atlas_resets",
            "/visible_patches",
            "/latency_ms/pose_to_server",
            "/latency_ms/wait_at_server",
            "/latency_ms/server_processing",
            "/latency_ms/transfer",
            "/latency_ms/decode",
            "/latency_ms/wait_at_client",
            "/latency_ms/draw",
            "/latency_ms/shown",
            "/latency_ms/total",
            "/error/frames",
            "/error/psnr_db",
            "/error/ssim",
            "/error/flip",
            "/error/flip_unwarped",
            "/error/psnr_reference_ceiling_db",
            "/error/psnr_without_reference_noise_db",
            "/error/reference_samples",
            "/error/window",
            "/peak_memory_bytes/server",
            "/peak_memory_bytes/client",
        ] {
            assert!(
                json.pointer(key).is_some_and(|value| value.is_number()),
                "{key}"
            );
        }
    }
}
