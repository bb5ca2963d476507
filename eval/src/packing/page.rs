//! Plots and tables of packers beside each other.

use std::fmt::Write as _;

use anyhow::{Context, Result};
use shadecast_protocol::Method;

use super::compare::{Compared, DENSITY_BINS, Row};
use crate::report::{Chart, Folder, Line, Scale, strip, table};

/// Writes `packing.csv`, plots and strips; the result is the page's tables.
pub(super) fn write(folder: &Folder, compared: &[Compared]) -> Result<String> {
    let rows: Vec<&Row> = compared.iter().flat_map(|found| &found.rows).collect();
    folder.csv(&rows)?;
    let over_latency: Vec<Chart> = compared.iter().map(over_latency).collect();
    folder.plot("-latency", &over_latency)?;
    let over_size: Vec<Chart> = compared.iter().map(over_size).collect();
    folder.plot("-size", &over_size)?;
    let densities: Vec<Chart> = compared.iter().map(densities).collect();
    folder.plot("-density", &densities)?;
    let mut body = String::new();
    for (index, found) in compared.iter().enumerate() {
        let path = folder.file(&format!("-pictures-{index}.png"));
        let pictures = strip(&found.strip, 2);
        (pictures.save(&path)).with_context(|| format!("cannot write {}", path.display()))?;
        let scene = found.rows.first().map_or("", |row| &row.scene);
        let names: Vec<&str> = Method::ALL.iter().map(|method| method.name()).collect();
        // Writing to a String cannot fail.
        let _ = write!(
            body,
            "## Packers, {scene}\n\n{}\n{}\n![pictures](packing-pictures-{index}.png)\n\nAbove: the \
             truth, and the atlas of {}, without video, at once. Below: grey where a pixel has one \
             texel, red where it has less, blue where it has more.\n\n",
            room(found),
            errors(found),
            names.join(", "),
        );
    }
    Ok(body)
}

/// Sizes of atlases, MPix.
fn sizes(found: &Compared) -> Vec<f64> {
    let mut sizes: Vec<f64> = found.rows.iter().map(|row| row.atlas_mpix).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.dedup();
    sizes
}

fn middle(found: &Compared) -> f64 {
    let sizes = sizes(found);
    sizes.get(sizes.len() / 2).copied().unwrap_or_default()
}

/// Rows of a packer and an atlas.
fn of<'a>(found: &'a Compared, packer: &'a str, mpix: f64) -> impl Iterator<Item = &'a Row> {
    let rows = found.rows.iter();
    rows.filter(move |row| row.packer == packer && row.atlas_mpix == mpix)
}

/// Mean over what is there; nothing over nothing.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

/// By latency, milliseconds.
fn over_latency(found: &Compared) -> Chart {
    let mpix = middle(found);
    let line = |packer| {
        let mut points: Vec<(f64, f64)> = Vec::new();
        for latency in super::compare::LATENCIES {
            let rows = of(found, packer, mpix).filter(|row| row.latency_ms == latency);
            points.push((latency.into(), mean(rows.filter_map(|row| row.flip))));
        }
        Line::new(packer, points)
    };
    let scene = found.rows.first().map_or("", |row| &row.scene);
    Chart {
        title: format!("{scene}, {mpix:.0} MPix"),
        x: Scale::Linear("milliseconds from update to display"),
        y: Scale::Linear("mean FLIP"),
        lines: Method::ALL
            .iter()
            .map(|method| line(method.name()))
            .collect(),
        level: None,
    }
}

fn over_size(found: &Compared) -> Chart {
    let line = |packer| {
        let points = sizes(found).into_iter().map(|mpix| {
            let rows = of(found, packer, mpix).filter(|row| row.latency_ms == 0);
            (mpix, mean(rows.filter_map(|row| row.flip)))
        });
        Line::new(packer, points.collect())
    };
    let scene = found.rows.first().map_or("", |row| &row.scene);
    Chart {
        title: format!("{scene}, at once"),
        x: Scale::Logarithmic("atlas, MPix"),
        y: Scale::Linear("mean FLIP"),
        lines: Method::ALL
            .iter()
            .map(|method| line(method.name()))
            .collect(),
        level: None,
    }
}

fn densities(found: &Compared) -> Chart {
    let mpix = middle(found);
    let line = |packer: &'static str| {
        let texels = (mpix * f64::from(1 << 20)) as u64;
        let bins = found.densities.get(&(packer, texels));
        let bins = bins.map_or(&[][..], Vec::as_slice);
        let all: f64 = bins.iter().map(|&count| f64::from(count)).sum();
        let points = bins.iter().enumerate().map(|(bin, &count)| {
            let octaves = (bin as f64 - (DENSITY_BINS / 2) as f64) / 4.0;
            (octaves.exp2(), f64::from(count) / all)
        });
        Line::new(packer, points.collect())
    };
    let scene = found.rows.first().map_or("", |row| &row.scene);
    Chart {
        title: format!("{scene}, {mpix:.0} MPix"),
        x: Scale::Logarithmic("texels of a pixel, area"),
        y: Scale::Linear("share of pixels"),
        lines: Method::ALL
            .iter()
            .map(|method| line(method.name()))
            .collect(),
        level: None,
    }
}

/// What becomes of the atlas's room, and what a frame takes.
fn room(found: &Compared) -> String {
    let mut lines = Vec::new();
    for mpix in sizes(found) {
        for method in Method::ALL {
            let packer = method.name();
            let rows = || of(found, packer, mpix).filter(|row| row.latency_ms == 0);
            let texels = mpix * f64::from(1 << 20);
            let share = |of_row: &dyn Fn(&Row) -> f64| {
                format!("{:.1} %", mean(rows().map(of_row)) / texels * 100.0)
            };
            // The first frame places and sends everything.
            let later = || rows().filter(|row| row.frame > 0);
            let milliseconds =
                |of_row: fn(&Row) -> f64| format!("{:.1}", mean(later().map(of_row)));
            lines.push(vec![
                format!("{mpix:.0}"),
                packer.to_owned(),
                format!("{:.0}", mean(rows().map(|row| f64::from(row.visible)))),
                share(&|row| row.asked_texels),
                share(&|row| row.culled_texels),
                share(&|row| row.useful_texels),
                share(&|row| row.inset_texels),
                share(&|row| row.empty_half_texels),
                share(&|row| row.kept_texels),
                share(&|row| row.stacked_texels as f64),
                share(&|row| row.tail_texels as f64),
                share(&|row| row.free_texels as f64),
                format!("{:.0}", mean(later().map(|row| f64::from(row.moved)))),
                later().filter(|row| row.reset).count().to_string(),
                rows().filter(|row| row.out_of_memory).count().to_string(),
                format!(
                    "{:.1}",
                    mean(later().map(|row| row.video_bytes as f64 / 1e3))
                ),
                milliseconds(|row| row.visibility_ms),
                milliseconds(|row| row.packing_ms),
                milliseconds(|row| row.packing_cpu_ms),
                milliseconds(|row| row.shading_ms),
                milliseconds(|row| row.frame_cpu_ms),
            ]);
        }
    }
    let columns = [
        "atlas, MPix",
        "packer",
        "visible",
        "asked",
        "asked by culling objects",
        "useful",
        "inset",
        "empty halves",
        "kept unseen",
        "free in stacks",
        "free at ends",
        "free",
        "moved a frame",
        "resets",
        "frames out of memory",
        "video, kB a frame",
        "visibility, ms",
        "packing, ms",
        "packing, CPU ms",
        "shading, ms",
        "frame, CPU ms",
    ];
    table(&columns, lines.into_iter())
}

/// How what is displayed differs, and how densely it is sampled.
fn errors(found: &Compared) -> String {
    let mut lines = Vec::new();
    for mpix in sizes(found) {
        for method in Method::ALL {
            let packer = method.name();
            let at = |latency: u32, of_row: fn(&Row) -> Option<f64>| {
                let rows = of(found, packer, mpix).filter(|row| row.latency_ms == latency);
                mean(rows.filter_map(of_row))
            };
            let every = |of_row: fn(&Row) -> Option<f64>| {
                let values =
                    super::compare::LATENCIES.map(|latency| format!("{:.4}", at(latency, of_row)));
                values.join(" / ")
            };
            lines.push(vec![
                format!("{mpix:.0}"),
                packer.to_owned(),
                every(|row| row.ssim),
                every(|row| row.flip),
                every(|row| row.missing.map(|share| share * 100.0)),
                format!("{:.2}", at(0, |row| row.density_5)),
                format!("{:.2}", at(0, |row| row.density_50)),
                format!("{:.2}", at(0, |row| row.density_95)),
                format!("{:.1} %", at(0, |row| row.within_factor_2) * 100.0),
            ]);
        }
    }
    let columns = [
        "atlas, MPix",
        "packer",
        "MSSIM at 0 / 33 / 66 / 100 ms",
        "FLIP, likewise",
        "missing, %, likewise",
        "texels a pixel, 5 %",
        "50 %",
        "95 %",
        "within a factor of 2",
    ];
    table(&columns, lines.into_iter())
}
