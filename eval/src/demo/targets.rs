//! What a run is to reach on two cores without a GPU, beside what it reached.

use std::fmt::Write as _;

use super::summary::Summary;

/// Time that the demo may take beyond the run itself.
const SECONDS_BESIDE_THE_RUN: f64 = 70.0;
const MEBIBYTE: f64 = 1024.0 * 1024.0;

/// One row of the table.
#[derive(Clone, Debug)]
pub(super) struct Target {
    pub(super) what: &'static str,
    pub(super) wanted: String,
    pub(super) measured: String,
    pub(super) reached: bool,
}

pub(super) fn of(summary: &Summary) -> Vec<Target> {
    let error = &summary.error;
    let memory = |what, bytes: Option<u64>| Target {
        what,
        wanted: "< 1024 MiB".into(),
        measured: bytes.map_or("not known".into(), |bytes| {
            format!("{:.0} MiB", bytes as f64 / MEBIBYTE)
        }),
        reached: bytes.is_some_and(|bytes| bytes < 1 << 30),
    };
    vec![
        at_least(
            "server updates a second",
            4.0,
            summary.server_updates_per_second,
            "",
        ),
        at_least(
            "client frames a second",
            20.0,
            summary.client_frames_per_second,
            "",
        ),
        at_least("mean PSNR", 24.0, error.psnr_db, " dB"),
        Target {
            what: "mean FLIP",
            wanted: "<= 0.150".into(),
            measured: format!("{:.3}", error.flip),
            reached: error.flip <= 0.15,
        },
        Target {
            what: "mean FLIP, against the unwarped server view",
            wanted: format!("< {:.3}", error.flip_unwarped),
            measured: format!("{:.3}", error.flip),
            reached: error.flip < error.flip_unwarped,
        },
        Target {
            what: "compared frames",
            wanted: ">= 20".into(),
            measured: error.frames.to_string(),
            reached: error.frames >= 20,
        },
        memory(
            "resident memory of the server",
            summary.peak_memory_bytes.server,
        ),
        memory(
            "resident memory of the client",
            summary.peak_memory_bytes.client,
        ),
        {
            let limit = f64::from(summary.settings.seconds) + SECONDS_BESIDE_THE_RUN;
            Target {
                what: "time of the whole demo",
                wanted: format!("<= {limit:.0} s"),
                measured: format!("{:.1} s", summary.demo_seconds),
                reached: summary.demo_seconds <= limit,
            }
        },
    ]
}

fn at_least(what: &'static str, wanted: f64, measured: f64, unit: &str) -> Target {
    Target {
        what,
        wanted: format!(">= {wanted}{unit}"),
        measured: format!("{measured:.2}{unit}"),
        reached: measured >= wanted,
    }
}

/// For a terminal.
pub(super) fn text(targets: &[Target]) -> String {
    let mut table = format!("{:<45}{:>12}{:>12}\n", "", "target", "measured");
    for target in targets {
        let _ = writeln!(
            table,
            "{:<45}{:>12}{:>12}  {}",
            target.what,
            target.wanted,
            target.measured,
            verdict(target)
        );
    }
    table
}

pub(super) fn verdict(target: &Target) -> &'static str {
    if target.reached { "reached" } else { "MISSED" }
}

#[cfg(test)]
mod tests {
    use super::super::summary::tests::summary;
    use super::*;

    fn missed(summary: &Summary) -> Vec<&'static str> {
        let missed = of(summary).into_iter().filter(|target| !target.reached);
        missed.map(|target| target.what).collect()
    }

    #[test]
    fn what_is_missed_is_said() {
        let mut summary = summary();
        assert_eq!(missed(&summary), ["compared frames"]);
        summary.error.frames = 20;
        assert!(missed(&summary).is_empty());
        summary.error.flip = f64::NAN;
        summary.demo_seconds = 90.5;
        assert_eq!(
            missed(&summary),
            [
                "mean FLIP",
                "mean FLIP, against the unwarped server view",
                "time of the whole demo"
            ]
        );
        assert_eq!(text(&of(&summary)).matches("MISSED").count(), 3);
    }
}
