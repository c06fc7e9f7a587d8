//! Line and scatter charts as SVG text.

use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;
use serde::Serialize;

use super::axis::Axis;
use super::legend::{Corner, Occupied};

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

/// Most points of a curve: a chart has fewer pixels along x.
const COURSE_MAX: usize = 1000;

/// Weight of the newest value in [`smoothed`].
const SMOOTHING: f64 = 0.1;

/// Two axes of numbers.
type Plane = Cartesian2d<Axis, Axis>;

/// Margin around a chart and widths of its labels below and on the left, pixels.
const MARGIN: u32 = 10;
const BELOW: u32 = 42;
const LEFT: u32 = 64;

/// Height of the chart's title, pixels.
const TITLE: u32 = 24;

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

    /// Whether something of it can be seen: a dot, or a line between two points.
    pub fn is_visible(&self) -> bool {
        finite(&self.points).len() > usize::from(self.style.radius().is_none())
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
        let points: Vec<(f64, f64)> = self.series.iter().flat_map(|series| finite(&series.points)).collect();
        let Some([x_axis, y_axis]) = axes(&points) else {
            root.draw(&Text::new(format!("{}: no data", self.title), (20, 20), ("sans-serif", 16)))?;
            return Ok(root.present()?);
        };
        let mut chart = ChartBuilder::on(&root)
            .caption(&self.title, ("sans-serif", 17))
            .margin(MARGIN)
            .x_label_area_size(BELOW)
            .y_label_area_size(LEFT)
            .build_cartesian_2d(x_axis, y_axis)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(RGBColor(225, 225, 225))
            .axis_style(RGBColor(120, 120, 120))
            .x_desc(&self.x)
            .y_desc(&self.y)
            .label_style(("sans-serif", 14))
            .draw()?;
        for (series, color) in self.series.iter().zip(COLORS.iter().cycle()) {
            draw_series(&mut chart, series, *color)?;
        }
        if self.series.len() > 1 {
            chart
                .configure_series_labels()
                .position(self.legend_corner([x_axis, y_axis]).position())
                .background_style(WHITE.mix(0.85))
                .border_style(RGBColor(200, 200, 200))
                .label_font(("sans-serif", 13))
                .draw()?;
        }
        Ok(root.present()?)
    }
}

impl Chart {
    /// Whether there is a course to see: points at two values of x.
    pub fn has_course(&self) -> bool {
        self.series.iter().any(|series| {
            let points = finite(&series.points);
            points.first().is_some_and(|first| points.iter().any(|point| point.0 != first.0))
        })
    }

    /// The corner in which the legend hides least.
    fn legend_corner(&self, axes: [Axis; 2]) -> Corner {
        let plot = [SIZE.0 - LEFT - 2 * MARGIN, SIZE.1 - BELOW - TITLE - 2 * MARGIN];
        let mut occupied = Occupied::new(self.series.iter().map(Series::name), plot);
        for series in &self.series {
            let place = |(x, y)| [axes[0].place(x), axes[1].place(y)];
            let points: Vec<[f64; 2]> = finite(&series.points).into_iter().map(place).collect();
            if series.style.radius().is_some() {
                occupied.dots.extend(&points);
            }
            if matches!(series.style, Style::Line | Style::LineAndDots) {
                occupied.add_line(&points);
            }
        }
        // Curves of a training end near their best, schedules begin with the first frame: these corners are mostly
        // free.
        let has_events = self.series.iter().any(|series| series.style == Style::Events);
        occupied.freest(if has_events { Corner::UpperLeft } else { Corner::LowerRight })
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

/// At most `COURSE_MAX` of the points of a curve, evenly spread, the newest among them.
pub fn course(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let every = points.len().div_ceil(COURSE_MAX).max(1);
    let mut kept: Vec<(f64, f64)> = points.iter().rev().step_by(every).copied().collect();
    kept.reverse();
    kept
}

fn finite(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
}

/// The axes of the points, from 0 to 1; `None` without points.
fn axes(points: &[(f64, f64)]) -> Option<[Axis; 2]> {
    let axis = |values: Vec<f64>| {
        let low = values.iter().copied().reduce(f64::min)?;
        let high = values.iter().copied().reduce(f64::max)?;
        Some(Axis::new((low, high), 0.0, 1.0, false).whole(values.iter().all(|value| value.fract() == 0.0)))
    };
    let [xs, ys] = [points.iter().map(|point| point.0).collect(), points.iter().map(|point| point.1).collect()];
    Some([axis(xs)?, axis(ys)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charts_are_svg_with_or_without_points() {
        let chart = |series| Chart { title: "Quality".into(), x: "step".into(), y: "dB".into(), series };
        let points = vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0)];
        let svg = chart(vec![Series::line("a", points.clone()), Series::line_and_dots("b", points)]).svg();
        assert!(svg.starts_with("<svg") && svg.contains("polyline") && svg.contains("Quality"));
        assert!(chart(Vec::new()).svg().contains("no data"));
        assert!(chart(vec![Series::dots("one", vec![(5.0, 5.0)])]).svg().contains("circle"));
    }

    #[test]
    fn a_long_curve_keeps_its_newest_point() {
        let points: Vec<(f64, f64)> = (1..=2500).map(|i| (f64::from(i), 0.0)).collect();
        let kept = course(&points);
        assert_eq!((kept.len(), kept.last().map(|point| point.0)), (834, Some(2500.0)));
        assert_eq!(course(&points[..7]), points[..7]);
    }

    #[test]
    fn one_point_is_no_course() {
        let chart = |series| Chart { title: "Loss".into(), x: "step".into(), y: "loss".into(), series };
        assert!(!chart(vec![Series::line("loss", vec![(6.0, 0.8)]), Series::dots("b", vec![(6.0, 2.0)])]).has_course());
        assert!(chart(vec![Series::line("loss", vec![(3.0, 0.8), (6.0, 0.8)])]).has_course());
        assert!(
            !Series::line("loss", vec![(6.0, 0.8)]).is_visible() && Series::dots("b", vec![(6.0, 2.0)]).is_visible()
        );
    }
}
