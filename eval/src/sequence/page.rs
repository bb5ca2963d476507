//! Plots and tables of `sequence`.

use std::fmt::Write as _;

use anyhow::{Context, Result};

use super::{METHODS, Measured, Row};
use crate::report::{Chart, Folder, Line, Scale, table};

type Of = fn(&Row) -> f64;

/// Writes plots, strips and page; the result is the page's tables.
pub(super) fn write(folder: &Folder, measured: &[Measured]) -> Result<String> {
    let over_time: Vec<Chart> = measured.iter().map(over_time).collect();
    folder.plot("", &over_time)?;
    let over_budget: Vec<Chart> = measured.iter().map(over_budget).collect();
    folder.plot("-budget", &over_budget)?;
    let mut body = String::new();
    for (index, found) in measured.iter().enumerate() {
        let strip = folder.file(&format!("-{index}.png"));
        (found.strip.save(&strip)).with_context(|| format!("cannot write {}", strip.display()))?;
        // Writing to a String cannot fail.
        let _ = write!(
            body,
            "## {}, {}\n\n{}\n![pictures](sequence-{index}.png)\n\nAbove in the middle of the trace, \
             below at its end: the reference, then the methods in the table's order. The \
             references' own relative error is {:.1e}.\n\n",
            found.scene,
            found.motion.name(),
            means(found),
            found.reference_noise,
        );
    }
    folder.page("Error while things move", &body)?;
    Ok(body)
}

fn budgets(found: &Measured) -> Vec<f64> {
    let mut budgets: Vec<f64> = found.rows.iter().map(|row| row.budget_ms).collect();
    budgets.sort_by(f64::total_cmp);
    budgets.dedup();
    budgets
}

fn of<'a>(found: &'a Measured, method: &'a str, budget: f64) -> impl Iterator<Item = &'a Row> {
    let rows = found.rows.iter();
    rows.filter(move |row| row.method == method && row.budget_ms == budget)
}

fn mean(rows: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = rows.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

fn over_time(found: &Measured) -> Chart {
    let budgets = budgets(found);
    let middle = budgets.get(budgets.len() / 2).copied().unwrap_or_default();
    let line = |method| {
        let points = of(found, method, middle).map(|row| (f64::from(row.frame), row.flip));
        Line::new(method, points.collect())
    };
    Chart {
        title: format!("{}, {}, {middle:.0} ms", found.scene, found.motion.name()),
        x: Scale::Linear("update"),
        y: Scale::Linear("mean FLIP"),
        lines: METHODS.iter().map(|method| line(method.name)).collect(),
        level: None,
    }
}

fn over_budget(found: &Measured) -> Chart {
    let line = |method| {
        let points = budgets(found).into_iter().map(|budget| {
            (
                budget,
                mean(of(found, method, budget).map(|row| row.relmse)),
            )
        });
        Line::new(method, points.collect())
    };
    Chart {
        title: format!("{}, {}", found.scene, found.motion.name()),
        x: Scale::Logarithmic("milliseconds an update"),
        y: Scale::Logarithmic("mean relMSE"),
        lines: METHODS.iter().map(|method| line(method.name)).collect(),
        level: None,
    }
}

/// Means over the compared updates, and ours relative to the others.
fn means(found: &Measured) -> String {
    let ours = METHODS[METHODS.len() - 1].name;
    let mut rows = Vec::new();
    for budget in budgets(found) {
        for method in &METHODS {
            let mean = |method, of_row: Of| mean(of(found, method, budget).map(of_row));
            let relative = |of_row: Of| ratio(mean(ours, of_row), mean(method.name, of_row));
            let work = of(found, method.name, budget)
                .next()
                .map_or(0, |row| row.work);
            let unit = if method.per_pixel { "spp" } else { "paths" };
            rows.push(vec![
                format!("{budget:.0}"),
                method.name.to_owned(),
                format!("{work} {unit}"),
                format!("{:.0}", mean(method.name, |row| row.server_ms)),
                format!("{:.0}", mean(method.name, |row| row.server_cpu_ms)),
                format!("{:.4}", mean(method.name, |row| row.flip)),
                format!("{:.4}", mean(method.name, |row| row.relmse)),
                relative(|row| row.flip),
                relative(|row| row.relmse),
            ]);
        }
    }
    let columns = [
        "budget, ms",
        "method",
        "work",
        "server, ms",
        "CPU, ms",
        "FLIP",
        "relMSE",
        "our FLIP over its",
        "our relMSE over its",
    ];
    table(&columns, rows.into_iter())
}

/// In words of a table; none to what its four decimals show as nothing.
fn ratio(ours: f64, theirs: f64) -> String {
    let ratio = ours / theirs;
    if ratio.is_finite() && theirs >= 5e-5 {
        format!("{ratio:.2}")
    } else {
        "–".into()
    }
}
