//! What a measurement leaves behind: CSV for programs, plots and a page for
//! people, and in each of them what it was measured on.

mod plot;

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    process::Command,
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use cpu_time::ProcessTime;
use image::RgbImage;
use serde::Serialize;

pub(crate) use plot::{Chart, Line, Scale, draw};

/// On what and of what something was measured.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Header {
    pub(crate) command: String,
    pub(crate) processor: String,
    pub(crate) cores: usize,
    pub(crate) driver: String,
    pub(crate) scenes: Vec<String>,
    pub(crate) seed: u32,
    pub(crate) commit: String,
}

impl Header {
    pub(crate) fn new(command: &str, driver: &str, scenes: Vec<String>, seed: u32) -> Self {
        Self {
            command: command.to_owned(),
            processor: processor(),
            cores: thread::available_parallelism().map_or(1, Into::into),
            driver: driver.to_owned(),
            scenes,
            seed,
            commit: commit(),
        }
    }

    /// In a line, for plots.
    fn line(&self) -> String {
        format!(
            "{}, {} cores, {}, seed {}, commit {}",
            self.processor, self.cores, self.driver, self.seed, self.commit
        )
    }

    fn markdown(&self) -> String {
        format!(
            "| | |\n|---|---|\n| processor | {}, {} cores |\n| driver | {} |\n| scenes | {} |\n\
             | seed | {} |\n| commit | {} |\n",
            self.processor,
            self.cores,
            self.driver,
            self.scenes.join(", "),
            self.seed,
            self.commit
        )
    }
}

/// The folder that a command fills; its files have the command's name.
#[derive(Debug)]
pub(crate) struct Folder {
    path: PathBuf,
    header: Header,
}

impl Folder {
    /// Makes the folder where there is none.
    pub(crate) fn new(path: &Path, header: Header) -> Result<Self> {
        fs::create_dir_all(path).with_context(|| format!("cannot make {}", path.display()))?;
        Ok(Self {
            path: path.to_owned(),
            header,
        })
    }

    /// A file of the command with this ending.
    pub(crate) fn file(&self, ending: &str) -> PathBuf {
        self.path.join(format!("{}{ending}", self.header.command))
    }

    /// Writes rows as CSV, their field names first, and beside it the header as JSON.
    pub(crate) fn csv<Row: Serialize>(&self, rows: &[Row]) -> Result<()> {
        let path = self.file(".csv");
        let mut writer = csv::Writer::from_path(&path)
            .with_context(|| format!("cannot write {}", path.display()))?;
        for row in rows {
            writer.serialize(row)?;
        }
        writer.flush()?;
        let header = serde_json::to_string_pretty(&self.header)? + "\n";
        self.write(&self.file(".json"), &header)
    }

    /// Writes charts beside each other as SVG and PNG; `name` tells them from other plots.
    pub(crate) fn plot(&self, name: &str, charts: &[Chart]) -> Result<()> {
        draw(
            charts,
            &self.header.line(),
            &self.file(&format!("{name}.svg")),
        )?;
        draw(
            charts,
            &self.header.line(),
            &self.file(&format!("{name}.png")),
        )
    }

    /// Writes the page: a title, on what it was measured, and `body`.
    pub(crate) fn page(&self, title: &str, body: &str) -> Result<()> {
        let page = format!("# {title}\n\n{}\n{body}", self.header.markdown());
        self.write(&self.file(".md"), &page)
    }

    fn write(&self, path: &Path, text: &str) -> Result<()> {
        fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
    }
}

/// Pictures beside each other, the first `down` of them one above the other, and so on.
pub(crate) fn strip(pictures: &[RgbImage], down: usize) -> RgbImage {
    let (width, height) = pictures
        .first()
        .map_or((1, 1), |picture| picture.dimensions());
    let across = pictures.len().div_ceil(down) as u32;
    let mut strip = RgbImage::new(width * across, height * down as u32);
    for (index, picture) in pictures.iter().enumerate() {
        let (x, y) = (index / down, index % down);
        let (x, y) = (x as i64 * i64::from(width), y as i64 * i64::from(height));
        image::imageops::replace(&mut strip, picture, x, y);
    }
    strip
}

/// A Markdown table.
pub(crate) fn table(columns: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut text = format!(
        "| {} |\n|{}\n",
        columns.join(" | "),
        "---|".repeat(columns.len())
    );
    for row in rows {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "| {} |", row.join(" | "));
    }
    text
}

/// Time on the clock, and of all cores on this process.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spent {
    pub(crate) wall: Duration,
    pub(crate) cpu: Duration,
}

impl std::ops::AddAssign for Spent {
    fn add_assign(&mut self, other: Self) {
        self.wall += other.wall;
        self.cpu += other.cpu;
    }
}

impl std::ops::Div<u32> for Spent {
    type Output = Self;

    fn div(self, count: u32) -> Self {
        Self {
            wall: self.wall / count,
            cpu: self.cpu / count,
        }
    }
}

/// What something took, and what came of it.
pub(crate) fn timed<T>(work: impl FnOnce() -> Result<T>) -> Result<(T, Spent)> {
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let result = work()?;
    let spent = Spent {
        wall: wall.elapsed(),
        cpu: cpu.elapsed(),
    };
    Ok((result, spent))
}

/// Slope of the line through points in logarithms of both axes, by least squares.
/// None where fewer than two points, or no two abscissas, are positive.
pub(crate) fn log_slope(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> = (points.iter())
        .filter(|(x, y)| *x > 0.0 && *y > 0.0)
        .map(|(x, y)| (x.ln(), y.ln()))
        .collect();
    let count = logs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / count;
    let (x_mean, y_mean) = (mean(|p| p.0), mean(|p| p.1));
    let covariance: f64 = logs.iter().map(|(x, y)| (x - x_mean) * (y - y_mean)).sum();
    let variance: f64 = logs.iter().map(|(x, _)| (x - x_mean).powi(2)).sum();
    (variance > 0.0).then(|| covariance / variance)
}

/// As the system names it.
pub(crate) fn processor() -> String {
    let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    info.lines()
        .filter(|line| line.starts_with("model name"))
        .find_map(|line| Some(line.split_once(':')?.1.trim().to_owned()))
        .unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}

/// Of the sources that the program was built from, where they are still there.
fn commit() -> String {
    let git = |arguments: &[&str]| {
        let source = ["-C", env!("CARGO_MANIFEST_DIR")];
        let output = Command::new("git")
            .args(source)
            .args(arguments)
            .output()
            .ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    let Some(commit) = git(&["rev-parse", "--short=10", "HEAD"]) else {
        return "unknown".to_owned();
    };
    match git(&["status", "--porcelain", "--untracked-files=no"]) {
        Some(changes) if changes.is_empty() => commit,
        _ => format!("{commit} with changes"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_powers() {
        let points: Vec<_> = (1..6).map(|x| (f64::from(x), 3.0 / f64::from(x))).collect();
        assert!((log_slope(&points).unwrap() + 1.0).abs() < 1e-12);
        assert_eq!(log_slope(&points[..1]), None);
        assert_eq!(log_slope(&[(0.0, 1.0), (-1.0, 2.0), (2.0, 0.0)]), None);
        assert_eq!(log_slope(&[(2.0, 1.0), (2.0, 3.0)]), None);
    }

    #[test]
    fn a_folder_gets_the_files_of_its_command() {
        #[derive(Serialize)]
        struct Row {
            name: &'static str,
            value: f64,
        }
        let path = std::env::temp_dir().join(format!("shadecast-report-{}", std::process::id()));
        let header = Header::new("try", "no driver", vec!["none".to_owned()], 7);
        let folder = Folder::new(&path, header).unwrap();
        let rows = [Row {
            name: "a, b",
            value: 0.5,
        }];
        folder.csv(&rows).unwrap();
        folder
            .page(
                "A try",
                &table(&["one"], [vec!["1".to_owned()]].into_iter()),
            )
            .unwrap();
        let chart = Chart {
            title: "a line & a point".to_owned(),
            x: Scale::Logarithmic("samples"),
            y: Scale::Linear("error"),
            lines: vec![
                Line::new("line", vec![(1.0, 1.0), (10.0, 0.1)]),
                Line::new("nothing", vec![]),
                Line::new("not a number", vec![(1.0, f64::NAN), (0.0, 1.0)]),
            ],
            level: Some(("floor".to_owned(), 0.05)),
        };
        folder.plot("-lines", &[chart]).unwrap();
        let csv = fs::read_to_string(path.join("try.csv")).unwrap();
        assert_eq!(csv, "name,value\n\"a, b\",0.5\n");
        let svg = fs::read_to_string(path.join("try-lines.svg")).unwrap();
        assert!(svg.contains("a line &amp; a point") && svg.contains("seed 7"));
        let png = image::open(path.join("try-lines.png")).unwrap().into_rgb8();
        assert!(png.pixels().any(|pixel| pixel.0 != [255; 3]));
        fs::remove_dir_all(&path).unwrap();
    }
}
