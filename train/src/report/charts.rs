//! Line and scatter charts as SVG text.

use plotters::coord::types::RangedCoordf64;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;
use serde::Serialize;

/// Size of a chart, pixels.
pub(crate) const SIZE: (u32, u32) = (640, 300);

/// Colours that colour-blind readers can distinguish (Okabe and Ito 2008).
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];

/// Weight of the newest value in [`smoothed`].
const SMOOTHING: f64 = 0.1;

/// Two axes of numbers.
type Plane = Cartesian2d<RangedCoordf64, RangedCoordf64>;

/// Opacity of the line of an event: what is drawn over it stays visible.
const EVENT: f64 = 0.7;

/// Points that belong together.
#[derive(Debug, Clone, Serialize)]
pub struct Series {
    name: String,
    points: Vec<(f64, f64)>,
    #[serde(skip)]
    style: Style,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Style {
    Line,
    Dots,
    LineAndDots,
    Draws,
    Events,
}

impl Style {
    /// Radius of its dots, pixels; `None` without dots.
    fn radius(self) -> Option<u32> {
        match self {
            Self::Line | Self::Events => None,
            Self::Dots | Self::LineAndDots => Some(4),
            Self::Draws => Some(2),
        }
    }
}

impl Series {
    /// Points joined by a line.
    pub fn line(name: &str, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), points, style: Style::Line }
    }

    /// Points as dots.
    pub fn dots(name: &str, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), points, style: Style::Dots }
    }

    /// Points as dots joined by a line.
    pub fn line_and_dots(name: &str, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), points, style: Style::LineAndDots }
    }

    /// Many points as small dots.
    pub fn draws(name: &str, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), points, style: Style::Draws }
    }

    /// A vertical line from `low` to `high` at each step.
    pub fn events(name: &str, steps: &[usize], [low, high]: [f64; 2]) -> Self {
        let points = steps.iter().flat_map(|step| [(*step as f64, low), (*step as f64, high)]).collect();
        Self { name: name.into(), points, style: Style::Events }
    }

    /// Its name in the legend.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its points.
    pub fn points(&self) -> &[(f64, f64)] {
        &self.points
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// A chart of one or more series.
#[derive(Debug, Clone, Serialize)]
pub struct Chart {
    /// Its title.
    pub title: String,
    /// Label and unit along x.
    pub x: String,
    /// Label and unit along y.
    pub y: String,
    /// The series.
    pub series: Vec<Series>,
}

impl Chart {
    /// The chart as SVG. Points that are not finite are left out; a chart without points contains a sentence instead.
    pub fn svg(&self) -> String {
        let mut svg = String::new();
        self.draw(SVGBackend::with_string(&mut svg, SIZE)).expect("drawing into a string does not fail");
        svg
    }

    fn draw(&self, backend: SVGBackend) -> Result<(), Box<dyn std::error::Error>> {
        let root = backend.into_drawing_area();
        root.fill(&WHITE)?;
        let points = self.series.iter().flat_map(|series| finite(&series.points));
        let Some((x_range, y_range)) = ranges(points) else {
            root.draw(&Text::new(format!("{}: no data", self.title), (20, 20), ("sans-serif", 16)))?;
            return Ok(root.present()?);
        };
        let mut chart = ChartBuilder::on(&root)
            .caption(&self.title, ("sans-serif", 17))
            .margin(10)
            .x_label_area_size(38)
            .y_label_area_size(64)
            .build_cartesian_2d(x_range, y_range)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(RGBColor(225, 225, 225))
            .axis_style(RGBColor(120, 120, 120))
            .x_desc(&self.x)
            .y_desc(&self.y)
            .x_label_formatter(&|v| number(*v))
            .y_label_formatter(&|v| number(*v))
            .label_style(("sans-serif", 12))
            .draw()?;
        for (series, color) in self.series.iter().zip(COLORS.iter().cycle()) {
            draw_series(&mut chart, series, *color)?;
        }
        if self.series.len() > 1 {
            // Curves of a training end near their best, schedules begin with the first frame: these corners are free.
            let has_events = self.series.iter().any(|series| series.style == Style::Events);
            let corner = if has_events { SeriesLabelPosition::UpperLeft } else { SeriesLabelPosition::LowerRight };
            chart
                .configure_series_labels()
                .position(corner)
                .background_style(WHITE.mix(0.85))
                .border_style(RGBColor(200, 200, 200))
                .label_font(("sans-serif", 12))
                .draw()?;
        }
        Ok(root.present()?)
    }
}

/// Draws a series with its entry in the legend.
fn draw_series<'a, B: DrawingBackend + 'a>(
    chart: &mut ChartContext<'a, B, Plane>,
    series: &Series,
    color: RGBColor,
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let points = finite(&series.points);
    if matches!(series.style, Style::Line | Style::LineAndDots) {
        let drawn = chart.draw_series(LineSeries::new(points.clone(), color.stroke_width(2)))?;
        drawn.label(&series.name).legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
    }
    if series.style == Style::Events {
        let ends = points.chunks_exact(2).map(|ends| PathElement::new(ends.to_vec(), color.mix(EVENT)));
        let drawn = chart.draw_series(ends)?;
        drawn
            .label(&series.name)
            .legend(move |(x, y)| PathElement::new([(x + 9, y - 6), (x + 9, y + 6)], color.mix(EVENT)));
    }
    if let Some(radius) = series.style.radius() {
        let dots = points.iter().map(|point| Circle::new(*point, radius, color.filled()));
        let drawn = chart.draw_series(dots)?;
        if series.style != Style::LineAndDots {
            drawn.label(&series.name).legend(move |(x, y)| Circle::new((x + 9, y), radius, color.filled()));
        }
    }
    Ok(())
}

/// A running mean: it shows the trend behind the variation between photos.
pub fn smoothed(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut mean = None;
    finite(points)
        .into_iter()
        .map(|(x, y)| {
            let next = mean.map_or(y, |mean: f64| mean + SMOOTHING * (y - mean));
            mean = Some(next);
            (x, next)
        })
        .collect()
}

fn finite(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
}

/// The bounding box of the points with a margin; `None` without points.
fn ranges(points: impl Iterator<Item = (f64, f64)>) -> Option<(std::ops::Range<f64>, std::ops::Range<f64>)> {
    let start = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    let [x0, x1, y0, y1] = points.fold(start, |[x0, x1, y0, y1], (x, y)| [x0.min(x), x1.max(x), y0.min(y), y1.max(y)]);
    let with_air = |low: f64, high: f64| {
        let air = if high > low { 0.05 * (high - low) } else { 0.05 * high.abs().max(1.0) };
        low - air..high + air
    };
    (x0 <= x1).then(|| (with_air(x0, x1), with_air(y0, y1)))
}

/// A number with as few characters as it needs.
fn number(value: f64) -> String {
    match value.abs() {
        0.0..1e-9 => "0".into(),
        1e-9..0.1 => short(value, 3),
        0.1..1000.0 => short(value, 2),
        1000.0..1e6 => short(value / 1e3, 2) + "k",
        _ => short(value / 1e6, 2) + "M",
    }
}

/// A number of at most so many decimals, without trailing zeros.
fn short(value: f64, decimals: usize) -> String {
    format!("{value:.decimals$}").trim_end_matches('0').trim_end_matches('.').into()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ticks a fifth apart are told apart.
    #[test]
    fn numbers_are_short() {
        let all = [0.0, 0.004, 0.25, 16.2, 16.0, 100.0, -50.0, 12_500.0, 2e6].map(number);
        assert_eq!(all, ["0", "0.004", "0.25", "16.2", "16", "100", "-50", "12.5k", "2M"]);
    }

    #[test]
    fn charts_are_svg_with_or_without_points() {
        let chart = |series| Chart { title: "Quality".into(), x: "step".into(), y: "dB".into(), series };
        let points = vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0)];
        let svg = chart(vec![Series::line("a", points.clone()), Series::line_and_dots("b", points)]).svg();
        assert!(svg.starts_with("<svg") && svg.contains("polyline") && svg.contains("Quality"));
        assert!(chart(Vec::new()).svg().contains("no data"));
        assert!(chart(vec![Series::dots("one", vec![(5.0, 5.0)])]).svg().contains("circle"));
    }
}
