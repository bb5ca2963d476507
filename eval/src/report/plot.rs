//! Charts of lines, beside each other in one picture.

use std::{ops::Range, path::Path, sync::Once};

use anyhow::{Context, Result, anyhow};
use image::RgbImage;
use plotters::{
    coord::{
        Shift,
        ranged1d::{AsRangedCoord, ValueFormatter},
    },
    prelude::*,
    style::{FontStyle, register_font},
};

/// Of one chart, pixels.
const SIZE: (u32, u32) = (760, 560);
/// Charts in a row.
const IN_A_ROW: usize = 2;
/// Below the charts, for the header.
const FOOT: u32 = 28;

/// An axis and what stands beside it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Scale {
    Linear(&'static str),
    Logarithmic(&'static str),
}

impl Scale {
    fn label(self) -> &'static str {
        match self {
            Self::Linear(label) | Self::Logarithmic(label) => label,
        }
    }

    fn takes(self, value: f64) -> bool {
        value.is_finite() && (matches!(self, Self::Linear(_)) || value > 0.0)
    }

    /// From the least to the greatest value, with some room.
    fn range(self, values: impl Iterator<Item = f64>) -> Range<f64> {
        let found = values.filter(|value| self.takes(*value));
        let (low, high) = found.fold((f64::MAX, f64::MIN), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        match self {
            _ if low > high => 0.1..1.0,
            Self::Linear(_) => {
                let low = low.min(0.0);
                low..high + (high - low).max(1e-9) * 0.08
            }
            Self::Logarithmic(_) => low / 1.5..high * 1.5,
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Line {
    pub(crate) name: String,
    pub(crate) points: Vec<(f64, f64)>,
}

impl Line {
    pub(crate) fn new(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self {
            name: name.into(),
            points,
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Chart {
    pub(crate) title: String,
    pub(crate) x: Scale,
    pub(crate) y: Scale,
    pub(crate) lines: Vec<Line>,
    /// A value that all lines are to be seen against, and its name.
    pub(crate) level: Option<(String, f64)>,
}

/// Draws charts into an SVG or PNG file with `foot` below them.
pub(crate) fn draw(charts: &[Chart], foot: &str, path: &Path) -> Result<()> {
    static FONT: Once = Once::new();
    FONT.call_once(|| {
        // It is a font, as the tests show.
        let _ = register_font(
            "sans-serif",
            FontStyle::Normal,
            epaint_default_fonts::UBUNTU_LIGHT,
        );
    });
    let columns = charts.len().clamp(1, IN_A_ROW) as u32;
    let rows = (charts.len().div_ceil(IN_A_ROW) as u32).max(1);
    let size = (SIZE.0 * columns, SIZE.1 * rows + FOOT);
    let is_png = path.extension().is_some_and(|extension| extension == "png");
    let cannot = || format!("cannot write {}", path.display());
    if is_png {
        let mut pixels = vec![0; size.0 as usize * size.1 as usize * 3];
        let area = BitMapBackend::with_buffer(&mut pixels, size).into_drawing_area();
        fill(&area, charts, foot).with_context(cannot)?;
        drop(area);
        let picture = RgbImage::from_raw(size.0, size.1, pixels)
            .context("the pixels are as many as the size says")?;
        picture.save(path).with_context(cannot)
    } else {
        fill(
            &SVGBackend::new(path, size).into_drawing_area(),
            charts,
            foot,
        )
        .with_context(cannot)
    }
}

fn fill<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    charts: &[Chart],
    foot: &str,
) -> Result<()> {
    let failed = |error: DrawingAreaErrorKind<B::ErrorType>| anyhow!("{error}");
    area.fill(&WHITE).map_err(failed)?;
    let (_, height) = area.dim_in_pixel();
    let (above, below) = area.split_vertically(height - FOOT);
    let style = ("sans-serif", 14).into_font().color(&BLACK.mix(0.6));
    below.draw_text(foot, &style, (12, 4)).map_err(failed)?;
    let columns = charts.len().clamp(1, IN_A_ROW);
    let parts = above.split_evenly((charts.len().div_ceil(IN_A_ROW).max(1), columns));
    for (part, chart) in parts.iter().zip(charts) {
        let points = || chart.lines.iter().flat_map(|line| &line.points);
        let x = chart.x.range(points().map(|point| point.0));
        let level = chart.level.iter().map(|level| level.1);
        let y = chart.y.range(points().map(|point| point.1).chain(level));
        match (chart.x, chart.y) {
            (Scale::Linear(_), Scale::Linear(_)) => lines(part, chart, x, y),
            (Scale::Linear(_), Scale::Logarithmic(_)) => lines(part, chart, x, y.log_scale()),
            (Scale::Logarithmic(_), Scale::Linear(_)) => lines(part, chart, x.log_scale(), y),
            (Scale::Logarithmic(_), Scale::Logarithmic(_)) => {
                lines(part, chart, x.log_scale(), y.log_scale())
            }
        }?;
    }
    area.present().map_err(failed)
}

fn lines<B: DrawingBackend, X, Y>(
    area: &DrawingArea<B, Shift>,
    chart: &Chart,
    x: X,
    y: Y,
) -> Result<()>
where
    X: AsRangedCoord<Value = f64>,
    Y: AsRangedCoord<Value = f64>,
    X::CoordDescType: ValueFormatter<f64>,
    Y::CoordDescType: ValueFormatter<f64>,
{
    let failed = |error: DrawingAreaErrorKind<B::ErrorType>| anyhow!("{error}");
    let mut context = ChartBuilder::on(area)
        .caption(&chart.title, ("sans-serif", 22))
        .margin(12)
        .x_label_area_size(48)
        .y_label_area_size(72)
        .build_cartesian_2d(x, y)
        .map_err(failed)?;
    let number = |value: &f64| {
        format!("{value:.3e}")
            .parse::<f64>()
            .map_or_else(|_| String::new(), |v| v.to_string())
    };
    context
        .configure_mesh()
        .x_desc(chart.x.label())
        .y_desc(chart.y.label())
        .x_label_formatter(&number)
        .y_label_formatter(&number)
        .light_line_style(BLACK.mix(0.05))
        .draw()
        .map_err(failed)?;
    for (index, line) in chart.lines.iter().enumerate() {
        let color = Palette99::pick(index).to_rgba();
        let takes = |point: &(f64, f64)| chart.x.takes(point.0) && chart.y.takes(point.1);
        let points: Vec<_> = line.points.iter().copied().filter(takes).collect();
        context
            .draw_series(LineSeries::new(points.clone(), color.stroke_width(2)))
            .map_err(failed)?
            .label(&line.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
        // Markers where they do not run into each other.
        if points.len() <= 24 {
            let dots = points
                .iter()
                .map(|point| Circle::new(*point, 3, color.filled()));
            context.draw_series(dots).map_err(failed)?;
        }
    }
    if let Some((name, value)) = &chart.level {
        let (from, to) = {
            let range = chart.x.range(
                chart
                    .lines
                    .iter()
                    .flat_map(|line| &line.points)
                    .map(|p| p.0),
            );
            (range.start, range.end)
        };
        let gray = BLACK.mix(0.5);
        context
            .draw_series(DashedLineSeries::new(
                [(from, *value), (to, *value)],
                6,
                4,
                gray.stroke_width(1),
            ))
            .map_err(failed)?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], gray));
    }
    context
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.3))
        .label_font(("sans-serif", 14))
        .draw()
        .map_err(failed)
}
