//! Plots and tables of `visibility`.

use std::fmt::Write as _;

use anyhow::Result;

use super::{
    Found, client,
    client::{CHOICES, PREDICTORS, SERVED},
    coverage, predict,
    trace::WALK,
};
use crate::report::{Chart, Folder, Line, Scale, table};

/// Writes plots and page; the result is the page's tables.
pub(super) fn write(folder: &Folder, found: &Found) -> Result<String> {
    folder.plot("", &set_charts(&found.coverages))?;
    folder.plot("-speed", &speed_charts(&found.coverages))?;
    folder.plot("-prediction", &prediction_charts(&found.predictions))?;
    folder.plot("-missing", &missing_charts(&found.missing))?;
    folder.plot("-cost", &cost_charts(&found.missing))?;
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
         each eye. *Kept n* would hold with patches kept for n updates after they were last \
         seen, whatever the room.\n\n{}\n\
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

fn near(a: f64, b: f64) -> bool {
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
    let missing = |latency| {
        found.missing.iter().find(|row| {
            row.gait == WALK.name && row.policy == SERVED.name && near(row.latency_ms, latency)
        })
    };
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
        tell(
            &format!("missing pixels as served, {latency:.0} ms"),
            &format!("< {:.1} %", most * 100.0),
            missing(latency).map(|row| (fine_percent(row.missing), row.missing < most)),
        );
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

/// Names of what is drawn of visible sets.
fn set_name(row: &coverage::Row) -> String {
    format!("{}, {}", row.predictor, row.image_plane)
}

/// Lines by name, in the order in which names first come.
fn lines<'a, Row: 'a>(
    rows: impl Iterator<Item = &'a Row>,
    name: impl Fn(&Row) -> String,
    point: impl Fn(&Row) -> (f64, f64),
) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    for row in rows {
        let name = name(row);
        match lines.iter_mut().find(|line| line.name == name) {
            Some(line) => line.points.push(point(row)),
            None => lines.push(Line::new(name, vec![point(row)])),
        }
    }
    lines
}

fn first_scene(rows: &[coverage::Row]) -> impl Iterator<Item = &coverage::Row> {
    let first = rows.first().map(|row| &row.scene);
    rows.iter().filter(move |row| Some(&row.scene) == first)
}

fn set_charts(rows: &[coverage::Row]) -> Vec<Chart> {
    let walk = || first_scene(rows).filter(|row| row.gait == WALK.name);
    let scene = rows.first().map_or("", |row| &row.scene);
    vec![
        Chart {
            title: format!("{scene}, walk: area that is not covered, 1 - r_c"),
            x: Scale::Linear("horizon, ms"),
            y: Scale::Logarithmic("share of the visible area"),
            lines: lines(walk(), set_name, |row| (row.horizon_ms, 1.0 - row.coverage)),
            level: Some(("1 %".to_owned(), 0.01)),
        },
        Chart {
            title: format!("{scene}, walk: overestimation, r_o"),
            x: Scale::Linear("horizon, ms"),
            y: Scale::Linear("share of the visible area"),
            lines: lines(walk(), set_name, |row| (row.horizon_ms, row.overestimation)),
            level: Some(("12 %".to_owned(), 0.12)),
        },
    ]
}

fn speed_charts(rows: &[coverage::Row]) -> Vec<Chart> {
    [33.333, 100.0]
        .map(|horizon| Chart {
            title: format!("not covered at {horizon:.0} ms, 1 - r_c"),
            x: Scale::Linear("mean speed of the head, m/s"),
            y: Scale::Logarithmic("share of the visible area"),
            lines: lines(
                first_scene(rows).filter(|row| near(row.horizon_ms, horizon)),
                set_name,
                |row| (row.metres_per_second, 1.0 - row.coverage),
            ),
            level: Some(("1 %".to_owned(), 0.01)),
        })
        .into()
}

fn prediction_charts(rows: &[predict::Row]) -> Vec<Chart> {
    let walk = || {
        let rows = rows.iter().filter(|row| row.gait == WALK.name);
        rows.filter(|row| row.predictor != "reference")
    };
    let name = |row: &predict::Row| row.predictor.to_owned();
    let chart = |title: &str, y, of: fn(&predict::Row) -> f64| Chart {
        title: title.to_owned(),
        x: Scale::Linear("horizon, ms"),
        y: Scale::Logarithmic(y),
        lines: lines(walk(), name, |row| (row.horizon_ms, of(row))),
        level: None,
    };
    vec![
        chart(
            "walk: turned from where it was predicted",
            "rms, degrees",
            |row| row.rms_degrees,
        ),
        chart("walk: away from where it was predicted", "rms, mm", |row| {
            row.rms_mm
        }),
    ]
}

fn missing_charts(rows: &[client::Row]) -> Vec<Chart> {
    let predictors: Vec<&str> = PREDICTORS.iter().chain([&SERVED]).map(|p| p.name).collect();
    let walk = || rows.iter().filter(|row| row.gait == WALK.name);
    let of_scene = |row: &client::Row| format!("{}: {}", row.scene, row.policy);
    let compared = walk().filter(|row| predictors.contains(&row.policy));
    let served = || walk().filter(|row| row.policy == SERVED.name);
    let kept = |row: &client::Row| {
        let points = [
            (1.0, row.missing_kept_0),
            (2.0, row.missing_kept_1),
            (4.0, row.missing_kept_3),
            (10.0, row.missing_kept_9),
            (31.0, row.missing_kept_30),
        ];
        Line::new(
            format!("{}, {:.0} ms", row.scene, row.latency_ms),
            points.into(),
        )
    };
    let name = |row: &client::Row| format!("{}, {:.0} ms", row.scene, row.latency_ms);
    let mut speeds: Vec<Line> = lines(
        rows.iter().filter(|row| row.policy == SERVED.name),
        name,
        |row| (row.metres_per_second, row.missing),
    );
    speeds.retain(|line| line.points.len() > 1);
    let charts = [
        Chart {
            title: "walk: missing pixels".to_owned(),
            x: Scale::Linear("latency, ms"),
            y: Scale::Logarithmic("share of the picture"),
            lines: lines(compared, of_scene, |row| (row.latency_ms, row.missing)),
            level: Some(("0.1 %".to_owned(), 1e-3)),
        },
        Chart {
            title: "walk, as served: missing, were patches kept".to_owned(),
            x: Scale::Logarithmic("updates in which a patch may have been seen last"),
            y: Scale::Logarithmic("share of the picture"),
            lines: served().map(kept).collect(),
            level: None,
        },
        Chart {
            title: "as served: missing pixels".to_owned(),
            x: Scale::Linear("mean speed of the head, m/s"),
            y: Scale::Logarithmic("share of the picture"),
            lines: speeds,
            level: Some(("0.1 %".to_owned(), 1e-3)),
        },
    ];
    let drawn = charts.into_iter();
    drawn.filter(|chart| !chart.lines.is_empty()).collect()
}

/// Error against run time of the ways to choose viewpoints.
fn cost_charts(rows: &[client::Row]) -> Vec<Chart> {
    let first = rows.first().map(|row| &row.scene);
    let choices: Vec<&str> = CHOICES.iter().chain([&SERVED]).map(|p| p.name).collect();
    let chart = |gait: &str, latency: f64| Chart {
        title: format!("{gait}, {latency:.0} ms: missing pixels against time"),
        x: Scale::Linear("CPU ms an update: id pictures and placement"),
        y: Scale::Logarithmic("share of the picture"),
        lines: lines(
            rows.iter()
                .filter(|row| Some(&row.scene) == first && row.gait == gait)
                .filter(|row| near(row.latency_ms, latency))
                .filter(|row| choices.contains(&row.policy)),
            |row| row.policy.to_owned(),
            |row| (row.update_cpu_ms, row.missing),
        ),
        level: None,
    };
    let charts = [WALK.name, "hurry"].map(|gait| [33.333, 100.0].map(|ms| chart(gait, ms)));
    let drawn = charts.into_iter().flatten();
    drawn.filter(|chart| chart.lines.len() > 1).collect()
}
