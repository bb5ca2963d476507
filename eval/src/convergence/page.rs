//! Plots and tables of `convergence`.

use std::fmt::Write as _;

use anyhow::{Context, Result};

use super::{METHODS, Measured, Row};
use crate::report::{Chart, Folder, Line, Scale, log_slope, table};

type Of = fn(&Row) -> f64;

/// Writes plots, strips and page; the result is the page's tables.
pub(super) fn write(folder: &Folder, measured: &[Measured]) -> Result<String> {
    let seconds = Scale::Logarithmic("seconds");
    folder.plot("", &charts(measured, seconds, |row| row.seconds))?;
    let samples = Scale::Logarithmic("samples a pixel");
    folder.plot("-spp", &charts(measured, samples, |row| row.spp))?;
    let mut body = String::new();
    for (index, scene) in measured.iter().enumerate() {
        let strip = folder.file(&format!("-scene-{index}.png"));
        (scene.strip.save(&strip)).with_context(|| format!("cannot write {}", strip.display()))?;
        // Writing to a String cannot fail.
        let _ = write!(
            body,
            "## {}\n\n{}\n![pictures](convergence-scene-{index}.png)\n\nLeft to right: the reference, and \
             the last picture of each method in the table's order. The reference has {} samples a \
             pixel and a standard error of {:.2e}; {} points with less than ten times that error \
             are left out.\n\n",
            scene.scene,
            methods(scene),
            scene.reference.samples,
            scene.reference.standard_error,
            scene.left_out,
        );
    }
    folder.page("Error against run time", &body)?;
    Ok(body)
}

fn of<'a>(scene: &'a Measured, method: &'a str) -> impl DoubleEndedIterator<Item = &'a Row> {
    scene.rows.iter().filter(move |row| row.method == method)
}

fn charts(measured: &[Measured], x: Scale, of_x: Of) -> Vec<Chart> {
    let line = |scene, method| {
        let points = of(scene, method).map(|row| (of_x(row), row.rmse));
        Line::new(method, points.collect())
    };
    (measured.iter())
        .map(|scene| Chart {
            title: scene.scene.clone(),
            x,
            y: Scale::Logarithmic("RMSE"),
            lines: METHODS
                .iter()
                .map(|method| line(scene, method.name))
                .collect(),
            level: Some((
                "the reference's own".to_owned(),
                scene.reference.standard_error,
            )),
        })
        .collect()
}

/// The last point of each method, and how it came there.
fn methods(scene: &Measured) -> String {
    let slope = |method, of_x: Of| {
        let points: Vec<_> = of(scene, method)
            .map(|row| (of_x(row), row.rmse.powi(2)))
            .collect();
        log_slope(&points).map_or_else(|| "-".to_owned(), |slope| format!("{slope:.2}"))
    };
    // Were path tracing's squared error to fall with time as it is expected to.
    let plain = of(scene, METHODS[0].name).next_back();
    let at_equal_time = |row: &Row| {
        plain.map_or_else(String::new, |plain| {
            let expected = plain.rmse * (plain.seconds / row.seconds).sqrt();
            format!("{:.2}", row.rmse / expected)
        })
    };
    let rows = METHODS.iter().filter_map(|method| {
        let last = of(scene, method.name).next_back()?;
        Some(vec![
            method.name.to_owned(),
            format!("{:.1}", last.spp),
            format!("{:.2}", last.seconds),
            format!("{:.2}", last.cpu_seconds),
            format!("{:.4}", last.rmse),
            format!("{:.5}", last.relmse),
            format!("{:.4}", last.flip),
            slope(method.name, |row| row.spp),
            slope(method.name, |row| row.seconds),
            at_equal_time(last),
        ])
    });
    let columns = [
        "method",
        "spp",
        "s",
        "CPU s",
        "RMSE",
        "relMSE",
        "FLIP",
        "slope of MSE over spp",
        "over seconds",
        "RMSE over path tracing's at equal time",
    ];
    table(&columns, rows)
}
