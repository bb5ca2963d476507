//! The page of `visibility`.

use std::fmt::Write as _;

use anyhow::Result;
use shadecast_shaders::visibility::LIFETIME;

use super::{Found, charts, client, coverage, policy::SERVED, predict, trace::WALK};
use crate::report::{Folder, table};

/// Writes plots and page; the result is the page's tables.
pub(super) fn write(folder: &Folder, found: &Found) -> Result<String> {
    folder.plot("", &charts::set_charts(&found.coverages))?;
    folder.plot("-speed", &charts::speed_charts(&found.coverages))?;
    folder.plot(
        "-prediction",
        &charts::prediction_charts(&found.predictions),
    )?;
    folder.plot("-missing", &charts::missing_charts(&found.missing))?;
    folder.plot("-cost", &charts::cost_charts(&found.missing))?;
    let mut body = String::new();
    // Writing to a String cannot fail.
    let _ = write!(
        body,
        "## Targets\n\n{}\n\
         ## Coverage and overestimation\n\nOf predicted visible sets, as SAS 2018, section 5.1, \
         defines them, at walking speed and at {:.0} ms. The truth is what the eyes see from \
         the true path in their own field of view.\n\n{}\n\
         ![coverage](visibility.png)\n\n![against speed](visibility-speed.png)\n\n\
         ## How far predicted heads are off\n\n{}\n\
         ![prediction](visibility-prediction.png)\n\n\
         ## Missing pixels\n\nShares of the client's pictures whose patch is in no block of \
         the atlas. An update is shown from the latency on for 33 ms, in three pictures for \
         each eye. What had few pixels in one of the last {LIFETIME} updates is in the visible \
         set too, but for the rows *nothing recalled*. *Kept n* would hold with patches kept for n \
         updates after they were last in that set, whatever the room.\n\n{}\n\
         ![missing](visibility-missing.png)\n\n![cost](visibility-cost.png)\n\n",
        targets(found),
        TABLE_HORIZON,
        coverage_table(&found.coverages),
        prediction_table(&found.predictions),
        missing_table(&found.missing),
    );
    folder.page("What is found to be visible", &body)?;
    Ok(body)
}

/// Of the tables, milliseconds.
const TABLE_HORIZON: f64 = 33.333;

/// Whether two numbers of milliseconds mean the same.
pub(super) fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 0.5
}

fn percent(share: f64) -> String {
    format!("{:.2} %", share * 100.0)
}

fn fine_percent(share: f64) -> String {
    format!("{:.4} %", share * 100.0)
}

/// What must be reached, and what is.
fn targets(found: &Found) -> String {
    let set = |predictor, plane, horizon| {
        found.coverages.iter().find(|row| {
            row.gait == WALK.name
                && row.predictor == predictor
                && row.image_plane == plane
                && near(row.horizon_ms, horizon)
        })
    };
    let doubted = "as wide as in doubt";
    let mut rows: Vec<Vec<String>> = Vec::new();
    let mut tell = |what: &str, wanted: &str, measured: Option<(String, bool)>| {
        if let Some((measured, holds)) = measured {
            let holds = if holds { "reached" } else { "not reached" };
            rows.push([what, wanted, &measured, holds].map(str::to_owned).into());
        }
    };
    let linear = set("linear", doubted, 33.333);
    tell(
        "coverage, linear, 33 ms",
        "> 99 %",
        linear.map(|row| (percent(row.coverage), row.coverage > 0.99)),
    );
    tell(
        "overestimation, linear, 33 ms",
        "<= 12 %",
        linear.map(|row| (percent(row.overestimation), row.overestimation <= 0.12)),
    );
    for (plane, name) in [("the eyes' own", "eyes' own"), (doubted, "doubted")] {
        let both = set("Kalman", plane, 100.0).zip(set("linear", plane, 100.0));
        tell(
            &format!("coverage, Kalman, 100 ms, {name} image plane"),
            "better than linear",
            both.map(|(kalman, linear)| {
                let told = [kalman, linear].map(|row| percent(row.coverage)).join(", ");
                (told, kalman.coverage > linear.coverage)
            }),
        );
    }
    for (latency, most) in [(33.333, 1e-3), (100.0, 5e-3)] {
        let served = (found.missing.iter())
            .filter(|row| row.gait == WALK.name && row.policy == SERVED.name)
            .filter(|row| near(row.latency_ms, latency));
        for row in served {
            if near(latency, 33.333) {
                tell(
                    &format!("{}: overestimation as served, {latency:.0} ms", row.scene),
                    "<= 12 %",
                    Some((percent(row.overestimation), row.overestimation <= 0.12)),
                );
            }
            tell(
                &format!("{}: missing pixels as served, {latency:.0} ms", row.scene),
                &format!("< {:.1} %", most * 100.0),
                Some((fine_percent(row.missing), row.missing < most)),
            );
        }
    }
    table(
        &["at walking speed", "wanted", "measured", ""],
        rows.into_iter(),
    )
}

fn coverage_table(rows: &[coverage::Row]) -> String {
    let columns = [
        "scene",
        "gait",
        "m/s",
        "predictor",
        "image plane",
        "r_c",
        "least r_c",
        "r_o",
    ];
    let rows = rows
        .iter()
        .filter(|row| near(row.horizon_ms, TABLE_HORIZON));
    table(
        &columns,
        rows.map(|row| {
            vec![
                row.scene.clone(),
                row.gait.to_owned(),
                format!("{:.1}", row.metres_per_second),
                row.predictor.to_owned(),
                row.image_plane.to_owned(),
                percent(row.coverage),
                percent(row.least_coverage),
                percent(row.overestimation),
            ]
        }),
    )
}

fn prediction_table(rows: &[predict::Row]) -> String {
    let columns = [
        "gait",
        "horizon, ms",
        "predictor",
        "rms, mm",
        "95 %, mm",
        "rms, degrees",
        "95 %, degrees",
        "within doubt",
    ];
    let told = [33.333, 100.0, 200.0];
    let rows = (rows.iter())
        .filter(|row| row.predictor != "reference")
        .filter(|row| told.iter().any(|horizon| near(row.horizon_ms, *horizon)));
    table(
        &columns,
        rows.map(|row| {
            vec![
                row.gait.to_owned(),
                format!("{:.0}", row.horizon_ms),
                row.predictor.to_owned(),
                format!("{:.2}", row.rms_mm),
                format!("{:.2}", row.p95_mm),
                format!("{:.2}", row.rms_degrees),
                format!("{:.2}", row.p95_degrees),
                percent(row.within_doubt),
            ]
        }),
    )
}

fn missing_table(rows: &[client::Row]) -> String {
    let columns = [
        "scene",
        "gait",
        "latency, ms",
        "viewpoints",
        "pictures",
        "ms an update",
        "CPU ms",
        "patches",
        "r_c",
        "r_o",
        "missing",
        "worst picture",
        "kept 0",
        "kept 1",
        "kept 3",
        "kept 9",
        "kept 30",
    ];
    table(
        &columns,
        rows.iter().map(|row| {
            vec![
                row.scene.clone(),
                row.gait.to_owned(),
                format!("{:.0}", row.latency_ms),
                row.policy.to_owned(),
                format!("{:.1}", row.pictures_per_update),
                format!("{:.1}", row.update_ms),
                format!("{:.1}", row.update_cpu_ms),
                format!("{:.0}", row.visible_patches),
                percent(row.coverage),
                percent(row.overestimation),
                fine_percent(row.missing),
                fine_percent(row.most_missing),
                fine_percent(row.missing_kept_0),
                fine_percent(row.missing_kept_1),
                fine_percent(row.missing_kept_3),
                fine_percent(row.missing_kept_9),
                fine_percent(row.missing_kept_30),
            ]
        }),
    )
}
