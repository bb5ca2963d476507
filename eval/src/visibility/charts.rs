//! Plots of `visibility`.

use super::{
    client, coverage,
    page::near,
    policy::{CHOICES, PREDICTORS, SERVED, WITHOUT_RECALL},
    predict,
    trace::{GAITS, WALK},
};
use crate::report::{Chart, Line, Scale};

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

/// Coverage and overestimation by horizon.
pub(super) fn set_charts(rows: &[coverage::Row]) -> Vec<Chart> {
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

/// Coverage by the speed of the head.
pub(super) fn speed_charts(rows: &[coverage::Row]) -> Vec<Chart> {
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

/// How far predicted heads are off, by horizon.
pub(super) fn prediction_charts(rows: &[predict::Row]) -> Vec<Chart> {
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

/// Missing pixels by latency, by how long patches are kept, and by the speed of the head.
pub(super) fn missing_charts(rows: &[client::Row]) -> Vec<Chart> {
    let predictors: Vec<&str> = PREDICTORS
        .iter()
        .chain([&SERVED, &WITHOUT_RECALL])
        .map(|p| p.name)
        .collect();
    let walk = || rows.iter().filter(|row| row.gait == WALK.name);
    let of_scene = |row: &client::Row| format!("{}: {}", row.scene, row.policy);
    let compared = walk().filter(|row| predictors.contains(&row.policy));
    let forgetful = walk().filter(|row| row.policy == WITHOUT_RECALL.name);
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
            title: "walk, nothing recalled: missing, were patches kept".to_owned(),
            x: Scale::Logarithmic("updates in which a patch may have been seen last"),
            y: Scale::Logarithmic("share of the picture"),
            lines: forgetful.map(kept).collect(),
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
pub(super) fn cost_charts(rows: &[client::Row]) -> Vec<Chart> {
    let first = rows.first().map(|row| &row.scene);
    let choices: Vec<&str> = CHOICES
        .iter()
        .chain([&SERVED, &WITHOUT_RECALL])
        .map(|p| p.name)
        .collect();
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
    let charts = [WALK.name, GAITS[GAITS.len() - 1].name]
        .map(|gait| [33.333, 100.0].map(|ms| chart(gait, ms)));
    let drawn = charts.into_iter().flatten();
    drawn.filter(|chart| chart.lines.len() > 1).collect()
}
