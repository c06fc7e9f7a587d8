//! A scatter chart as SVG text: points, labels that do not overlap, and the Pareto front.

use std::fmt::Write as _;

use gsburn::report::axis::{Axis, WIDTH_OF_CHARACTER, named};
use gsburn::report::html::escaped;

use super::labels::Placer;

/// Colours that colour-blind readers can distinguish (Okabe and Ito 2008); the last is for points without a value.
pub(crate) const COLORS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#b8a800", "#777777"];

/// Size of a chart, pixels.
pub(crate) const SIZE: (u32, u32) = (760, 460);

/// Ratio of costs above which the axis is logarithmic.
const LOG_FROM: f64 = 30.0;

/// The same of a chart that asks for a logarithmic axis.
const LOG_FROM_ASKED: f64 = 3.0;

/// Number of runs from which on their lines are faint.
const MANY: usize = 12;

/// A point.
#[derive(Debug, Clone, PartialEq)]
pub struct Dot {
    /// Cost.
    pub x: f64,
    /// Quality.
    pub y: f64,
    /// Lowest and highest of the qualities whose mean it is.
    pub range: Option<(f64, f64)>,
    /// Index into the colours.
    pub color: usize,
    pub label: Option<String>,
    /// Whether it is the last of its run; those before it are smaller.
    pub last: bool,
    /// Whether it is on the front.
    pub front: bool,
    pub tip: String,
}

/// A chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Scatter {
    pub title: String,
    /// A remark in small letters under the title.
    pub note: String,
    /// Label and unit along x.
    pub x: String,
    /// Label and unit along y.
    pub y: String,
    /// Points.
    pub dots: Vec<Dot>,
    /// Thin lines through the points of one run, with their colour.
    pub trails: Vec<(usize, Vec<(f64, f64)>)>,
    /// Whether costs that differ threefold are on a logarithmic axis; otherwise only far larger ratios are.
    pub log_x: bool,
    /// The meaning of the colours.
    pub legend: Vec<(String, usize)>,
}

/// The rectangle of the data, pixels.
#[derive(Debug, Clone, Copy)]
struct Frame {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Scatter {
    /// The chart as SVG. Points that are not finite are left out; a chart without points contains a sentence instead.
    pub fn svg(&self) -> String {
        let (width, height) = SIZE;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#222222\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n"
        );
        self.draw(&mut svg).expect("writing to a string does not fail");
        svg + "</svg>\n"
    }

    fn draw(&self, svg: &mut String) -> std::fmt::Result {
        text(svg, 64.0, 24.0, "start", 16, "#222222", &self.title)?;
        let mut top = 30.0;
        if !self.note.is_empty() {
            top += 14.0;
            text(svg, 64.0, top, "start", 11, "#666666", &self.note)?;
        }
        let top = self.draw_legend(svg, top + 18.0)? + 14.0;
        let dots: Vec<&Dot> = self.dots.iter().filter(|dot| dot.x.is_finite() && dot.y.is_finite()).collect();
        let frame = Frame { left: 64.0, right: f64::from(SIZE.0) - 18.0, top, bottom: f64::from(SIZE.1) - 46.0 };
        let range = |of: fn(&Dot) -> f64| {
            dots.iter().map(|dot| of(dot)).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
        };
        if dots.is_empty() {
            return text(svg, frame.left, frame.top + 20.0, "start", 13, "#222222", "no data");
        }
        let (lows, highs) =
            (range(|dot| dot.range.map_or(dot.y, |r| r.0)), range(|dot| dot.range.map_or(dot.y, |r| r.1)));
        let (xs, ys) = (range(|dot| dot.x), (lows.0, highs.1));
        let log_from = if self.log_x { LOG_FROM_ASKED } else { LOG_FROM };
        let x_axis = Axis::new(xs, frame.left, frame.right, xs.0 > 0.0 && xs.1 / xs.0 > log_from);
        let y_axis = Axis::new(ys, frame.bottom, frame.top, false);
        self.draw_axes(svg, &frame, &x_axis, &y_axis)?;

        let place = |x: f64, y: f64| (x_axis.place(x), y_axis.place(y));
        let faint = if self.trails.len() > MANY { 0.2 } else { 0.45 };
        for (color, points) in &self.trails {
            let points = points.iter().filter(|(x, y)| x.is_finite() && y.is_finite()).map(|(x, y)| place(*x, *y));
            line(
                svg,
                points,
                &format!("stroke=\"{}\" stroke-width=\"1.2\" stroke-opacity=\"{faint}\"", COLORS[*color]),
            )?;
        }
        let mut front: Vec<(f64, f64)> = dots.iter().filter(|d| d.front).map(|d| place(d.x, d.y)).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        line(svg, front.iter().copied(), "stroke=\"#222222\" stroke-width=\"1\" stroke-dasharray=\"4 3\"")?;
        for dot in &dots {
            let ((x, y), radius) = (place(dot.x, dot.y), if dot.last { 5.0 } else { 3.0 });
            if let Some((low, high)) = dot.range {
                let style = format!("stroke=\"{}\" stroke-width=\"1.5\"", COLORS[dot.color]);
                line(svg, [place(dot.x, low), place(dot.x, high)].into_iter(), &style)?;
            }
            if dot.front {
                writeln!(
                    svg,
                    "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\" fill=\"none\" stroke=\"#222222\"/>",
                    radius + 3.5
                )?;
            }
            writeln!(
                svg,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\" fill=\"{}\"><title>{}</title></circle>",
                COLORS[dot.color],
                escaped(&dot.tip)
            )?;
        }
        self.draw_labels(svg, &frame, &dots, &place)
    }

    /// Draws the labels of the points; those of the front are placed first.
    fn draw_labels(
        &self,
        svg: &mut String,
        frame: &Frame,
        dots: &[&Dot],
        place: &dyn Fn(f64, f64) -> (f64, f64),
    ) -> std::fmt::Result {
        let mut placer = Placer::new([frame.left, frame.top, frame.right, frame.bottom]);
        dots.iter().for_each(|dot| placer.keep_free(place(dot.x, dot.y), if dot.last { 7.0 } else { 4.0 }));
        let mut order: Vec<&&Dot> = dots.iter().filter(|dot| dot.label.is_some()).collect();
        order.sort_by_key(|dot| !dot.front);
        for dot in order {
            let label = dot.label.as_deref().unwrap_or_default();
            let point = place(dot.x, dot.y);
            let spot = placer.place(point, label);
            if spot.far {
                let (x, y) = spot.anchor();
                line(svg, [point, (x, y)].into_iter(), "stroke=\"#999999\" stroke-width=\"0.7\"")?;
            }
            text(svg, spot.left, spot.baseline, "start", 11, "#333333", label)?;
        }
        Ok(())
    }

    /// Draws rows of colours with their meaning, and the symbol of the front; returns the y coordinate below them,
    /// pixels.
    fn draw_legend(&self, svg: &mut String, top: f64) -> Result<f64, std::fmt::Error> {
        let (mut x, mut y) = (64.0, top);
        let entries = self.legend.iter().map(|(name, color)| (name.as_str(), Some(*color)));
        let earlier = self.dots.iter().any(|dot| !dot.last).then_some(("small: measured on the way", None));
        let front = [("best at its cost (Pareto front)", None)];
        for (i, (name, color)) in entries.chain(front).chain(earlier).enumerate() {
            let wide = 34.0 + WIDTH_OF_CHARACTER * 1.12 * name.chars().count() as f64;
            if x + wide > f64::from(SIZE.0) - 18.0 && x > 64.0 {
                (x, y) = (64.0, y + 17.0);
            }
            let (cx, cy) = (x + 7.0, y - 4.0);
            match color {
                Some(color) => writeln!(svg, "<circle cx=\"{cx}\" cy=\"{cy}\" r=\"5\" fill=\"{}\"/>", COLORS[color])?,
                None if i == self.legend.len() => {
                    writeln!(svg, "<circle cx=\"{cx}\" cy=\"{cy}\" r=\"7\" fill=\"none\" stroke=\"#222222\"/>")?
                }
                None => writeln!(svg, "<circle cx=\"{cx}\" cy=\"{cy}\" r=\"3\" fill=\"#777777\"/>")?,
            }
            text(svg, x + 18.0, y, "start", 12, "#222222", name)?;
            x += wide;
        }
        Ok(y)
    }

    fn draw_axes(&self, svg: &mut String, frame: &Frame, x_axis: &Axis, y_axis: &Axis) -> std::fmt::Result {
        let Frame { left, right, top, bottom } = *frame;
        let rule = "stroke=\"#e3e3e3\" stroke-width=\"1\"";
        for (x, name) in named(&x_axis.ticks()) {
            let x = x_axis.place(x);
            line(svg, [(x, top), (x, bottom)].into_iter(), rule)?;
            text(svg, x, bottom + 17.0, "middle", 11, "#444444", &name)?;
        }
        for (y, name) in named(&y_axis.ticks()) {
            let y = y_axis.place(y);
            line(svg, [(left, y), (right, y)].into_iter(), rule)?;
            text(svg, left - 7.0, y + 4.0, "end", 11, "#444444", &name)?;
        }
        line(svg, [(left, top), (left, bottom), (right, bottom)].into_iter(), "stroke=\"#777777\" stroke-width=\"1\"")?;
        text(svg, (left + right) / 2.0, bottom + 37.0, "middle", 12, "#222222", &self.x)?;
        let (x, y) = (17.0, (top + bottom) / 2.0);
        writeln!(
            svg,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\" font-size=\"12\" fill=\"#222222\" \
             transform=\"rotate(-90 {x:.1} {y:.1})\">{}</text>",
            escaped(&self.y)
        )
    }
}

fn text(svg: &mut String, x: f64, y: f64, anchor: &str, size: u32, fill: &str, content: &str) -> std::fmt::Result {
    writeln!(
        svg,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-size=\"{size}\" fill=\"{fill}\">{}</text>",
        escaped(content)
    )
}

/// A line through at least two points.
fn line(svg: &mut String, points: impl Iterator<Item = (f64, f64)>, style: &str) -> std::fmt::Result {
    let points: Vec<String> = points.map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    if points.len() > 1 {
        writeln!(svg, "<polyline points=\"{}\" fill=\"none\" {style}/>", points.join(" "))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: &[(f64, f64)]) -> Scatter {
        let dot = |(x, y): &(f64, f64)| Dot {
            x: *x,
            y: *y,
            range: None,
            color: 0,
            label: Some("a<b".into()),
            last: true,
            front: true,
            tip: "tip".into(),
        };
        Scatter {
            title: "Quality".into(),
            note: String::new(),
            x: "CPU seconds".into(),
            y: "dB".into(),
            dots: points.iter().map(dot).collect(),
            trails: vec![(0, points.to_vec())],
            log_x: false,
            legend: vec![("N 7".into(), 0)],
        }
    }

    #[test]
    fn charts_are_svg_with_or_without_points() {
        let svg = chart(&[(1.0, 20.0), (2.0, f64::NAN), (3.0, 25.0)]).svg();
        assert!(svg.starts_with("<svg") && svg.contains("a&lt;b") && svg.contains("N 7") && !svg.contains("NaN"));
        assert!(chart(&[]).svg().contains("no data"));
        assert!(!chart(&[(5.0, 5.0)]).svg().contains("NaN"), "one point has a range of its own");
    }
}
