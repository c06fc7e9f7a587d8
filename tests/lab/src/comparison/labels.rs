//! The position of a label beside its point: of several candidates, the first that covers least.

use gsburn::report::axis::WIDTH_OF_CHARACTER;

/// Height of a line, pixels.
const HEIGHT: f64 = 12.0;

/// Distances of candidates from the point, pixels; from the second on a thin line leads to the label.
const RINGS: [f64; 5] = [10.0, 22.0, 36.0, 52.0, 72.0];

/// Directions of candidates in each ring, the most readable first.
const DIRECTIONS: [(f64, f64); 8] =
    [(1.0, 0.0), (0.8, -0.7), (0.8, 0.7), (0.0, -1.0), (0.0, 1.0), (-1.0, 0.0), (-0.8, -0.7), (-0.8, 0.7)];

/// Cost of a square pixel outside the chart, in covered square pixels.
const OUTSIDE: f64 = 20.0;

/// Cost of a pixel of distance, likewise: covering a corner is worse than moving away from the point, anything less is
/// not.
const DISTANCE: f64 = 0.6;

/// left, top, right, bottom
type Rectangle = [f64; 4];

/// Labels placed so far, and the rectangles that they must not cover.
#[derive(Debug)]
pub(super) struct Placer {
    bounds: Rectangle,
    taken: Vec<Rectangle>,
}

/// The position of a label.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spot {
    /// Left end of the text.
    pub left: f64,
    /// Its baseline.
    pub baseline: f64,
    /// Whether a line leads to its point.
    pub far: bool,
    area: Rectangle,
    towards: (f64, f64),
}

impl Spot {
    /// The point on the label's edge that is nearest to `point`.
    pub fn anchor(&self) -> (f64, f64) {
        let [left, top, right, bottom] = self.area;
        (self.towards.0.clamp(left, right), self.towards.1.clamp(top, bottom))
    }
}

impl Placer {
    pub fn new(bounds: Rectangle) -> Self {
        Self { bounds, taken: Vec::new() }
    }

    /// Keeps labels off a point.
    pub fn keep_free(&mut self, (x, y): (f64, f64), radius: f64) {
        self.taken.push([x - radius, y - radius, x + radius, y + radius]);
    }

    /// Chooses the position of a label and reserves it.
    pub fn place(&mut self, point: (f64, f64), label: &str) -> Spot {
        let width = WIDTH_OF_CHARACTER * label.chars().count() as f64;
        let spots = RINGS.iter().enumerate().flat_map(|(ring, distance)| {
            DIRECTIONS.iter().map(move |direction| spot(point, *direction, *distance, width, ring > 0))
        });
        let cost = |spot: &Spot, distance: usize| {
            let covered: f64 = self.taken.iter().map(|other| overlap(&spot.area, other)).sum();
            let outside = width * HEIGHT - overlap(&spot.area, &self.bounds);
            covered + OUTSIDE * outside + DISTANCE * distance as f64 * DIRECTIONS.len() as f64 / 4.0
        };
        let best = spots
            .enumerate()
            .map(|(i, spot)| (cost(&spot, i), spot))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, spot)| spot)
            .expect("there are places to try");
        self.taken.push(best.area);
        best
    }
}

fn spot(point: (f64, f64), (dx, dy): (f64, f64), distance: f64, width: f64, far: bool) -> Spot {
    let (x, y) = (point.0 + dx * distance, point.1 + dy * distance);
    let left = match dx {
        dx if dx > 0.1 => x,
        dx if dx < -0.1 => x - width,
        _ => x - width / 2.0,
    };
    // Above and below the point the label's edge keeps the distance; beside it, its middle is at the point's height.
    let middle = y + dy.signum() * if dy == 0.0 { 0.0 } else { HEIGHT / 2.0 };
    let top = middle - HEIGHT / 2.0;
    let area = [left, top, left + width, top + HEIGHT];
    Spot { left, baseline: top + 9.5, far, area, towards: point }
}

fn overlap(a: &Rectangle, b: &Rectangle) -> f64 {
    let width = a[2].min(b[2]) - a[0].max(b[0]);
    let height = a[3].min(b[3]) - a[1].max(b[1]);
    width.max(0.0) * height.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_keep_out_of_each_others_way() {
        let mut placer = Placer::new([0.0, 0.0, 700.0, 400.0]);
        // Twenty points close together, as runs of one budget are.
        let points: Vec<(f64, f64)> =
            (0..20).map(|i| (300.0 + 14.0 * f64::from(i % 5), 180.0 + 11.0 * f64::from(i / 5))).collect();
        points.iter().for_each(|point| placer.keep_free(*point, 5.0));
        let spots: Vec<Spot> = points.iter().map(|point| placer.place(*point, "N 15, order 3")).collect();
        let area = HEIGHT * WIDTH_OF_CHARACTER * 13.0;
        for (i, spot) in spots.iter().enumerate() {
            let covered: f64 = spots[..i].iter().map(|other| overlap(&spot.area, &other.area)).sum();
            assert!(covered < 0.35 * area, "label {i}: {covered} of {area}");
        }
    }

    #[test]
    fn a_label_at_the_edge_stays_inside() {
        let mut placer = Placer::new([0.0, 0.0, 700.0, 400.0]);
        let spot = placer.place((695.0, 5.0), "a long label");
        assert!(spot.area[2] <= 700.0 && spot.area[1] >= 0.0, "{spot:?}");
    }
}
