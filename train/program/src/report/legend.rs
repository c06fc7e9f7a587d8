//! The corner of a chart for its legend: one in which it hides no dot, and little of the lines.

use plotters::prelude::SeriesLabelPosition;

use super::axis::WIDTH_OF_CHARACTER;

/// Height of a row of the legend, and width of all beside its names, pixels.
const ROW: f64 = 19.0;
const SIDE: f64 = 50.0;

/// Places between two points of a line at which it may be covered.
const BETWEEN: usize = 8;

/// A corner of a chart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Corner {
    LowerRight,
    UpperLeft,
    UpperRight,
    LowerLeft,
}

impl Corner {
    /// The corner as plotters names it.
    pub fn position(self) -> SeriesLabelPosition {
        match self {
            Self::LowerRight => SeriesLabelPosition::LowerRight,
            Self::UpperLeft => SeriesLabelPosition::UpperLeft,
            Self::UpperRight => SeriesLabelPosition::UpperRight,
            Self::LowerLeft => SeriesLabelPosition::LowerLeft,
        }
    }
}

/// Dots and lines that a legend may cover, in shares of the plot from the left and from below.
#[derive(Debug)]
pub(super) struct Occupied {
    /// Width and height of the legend.
    size: [f64; 2],
    /// Dots.
    pub dots: Vec<[f64; 2]>,
    /// Places on lines.
    places: Vec<[f64; 2]>,
}

impl Occupied {
    /// The legend with these names in a plot of so many pixels, which is empty as yet.
    pub fn new<'a>(names: impl Iterator<Item = &'a str>, plot: [u32; 2]) -> Self {
        let lengths: Vec<usize> = names.map(|name| name.chars().count()).collect();
        // Letters of 13 pixels, where the width is that of 11.
        let longest = WIDTH_OF_CHARACTER * 13.0 / 11.0 * lengths.iter().copied().max().unwrap_or(0) as f64;
        let size = [(SIDE + longest) / f64::from(plot[0]), ROW * (lengths.len() + 1) as f64 / f64::from(plot[1])];
        Self { size, dots: Vec::new(), places: Vec::new() }
    }

    /// Adds a line through these points.
    pub fn add_line(&mut self, points: &[[f64; 2]]) {
        for pair in points.windows(2) {
            let at = |part: f64| [0, 1].map(|axis| pair[0][axis] + part * (pair[1][axis] - pair[0][axis]));
            self.places.extend((0..=BETWEEN).map(|i| at(i as f64 / BETWEEN as f64)));
        }
    }

    /// The corner in which least is covered, `first` among equals.
    pub fn freest(&self, first: Corner) -> Corner {
        let corners = [first, Corner::LowerRight, Corner::UpperLeft, Corner::UpperRight, Corner::LowerLeft];
        corners.into_iter().min_by_key(|corner| self.cost(*corner)).unwrap_or(first)
    }

    /// Covered dots, then covered places of lines: a line goes on beside the legend, a dot is gone.
    fn cost(&self, corner: Corner) -> (usize, usize) {
        let [width, height] = self.size;
        let is_covered = |[x, y]: &&[f64; 2]| {
            let right = matches!(corner, Corner::LowerRight | Corner::UpperRight);
            let top = matches!(corner, Corner::UpperLeft | Corner::UpperRight);
            (if right { *x > 1.0 - width } else { *x < width }) && (if top { *y > 1.0 - height } else { *y < height })
        };
        (self.dots.iter().filter(is_covered).count(), self.places.iter().filter(is_covered).count())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A training that improves, and one measurement at its end: the dot stays visible wherever it is.
    #[test]
    fn the_legend_leaves_dots_free() {
        for (dot, expected) in [
            ([0.95, 0.5], Corner::LowerRight),
            ([0.95, 0.1], Corner::UpperLeft),
            ([0.1, 0.1], Corner::LowerRight),
            ([0.95, 0.95], Corner::LowerRight),
        ] {
            let names = ["training photo", "held-out mean", "held-out moving parts"];
            let mut occupied = Occupied::new(names.into_iter(), [560, 220]);
            occupied.add_line(&[[0.05, 0.6], [0.5, 0.65], [0.95, 0.9]]);
            occupied.dots.push(dot);
            assert_eq!(occupied.freest(Corner::LowerRight), expected, "{dot:?}");
        }
        // However many points a line has, a dot counts more.
        let mut dense = Occupied::new(["training photo", "moving parts"].into_iter(), [560, 220]);
        let line: Vec<[f64; 2]> = (0..200).map(|i| [0.05 + 0.9 * i as f64 / 199.0, 0.9]).collect();
        dense.add_line(&line);
        dense.dots.push([0.95, 0.1]);
        assert_eq!(dense.freest(Corner::LowerRight), Corner::LowerLeft);
        dense.dots.push([0.1, 0.1]);
        assert_eq!(dense.freest(Corner::LowerRight), Corner::UpperLeft);
        // A line alone moves the legend as well, and events keep their corner among equals.
        let mut occupied = Occupied::new(["loss"].into_iter(), [560, 220]);
        assert_eq!(occupied.freest(Corner::UpperLeft), Corner::UpperLeft);
        occupied.add_line(&[[0.05, 0.95], [0.95, 0.05]]);
        assert_eq!(occupied.freest(Corner::UpperLeft), Corner::UpperRight);
    }
}
