//! A sweep from above: the distance of every place to its nearest surface, as far as that matters.
//!
//! A surface is the points and the lines between neighbours. Without the lines, the beams that graze the side of a car
//! are points a metre apart that keep their places before the LiDAR, and the side seems to move with the ego vehicle.

use super::groups::{around, cell, cells};
use crate::flux4d::far::extremes;

/// Edge of the cells of the plans, metres, and most of them along an axis.
const CELL: f64 = 0.1;
const CELLS_MAX: usize = 4096;
/// Room around the points, metres.
const PAD: f64 = 2.0;
/// Longest line between neighbours, metres: beams that graze the side of a car at 20 m are as far apart.
const LINE_MAX: f64 = 1.2;
/// A point has one neighbour in each of so many directions.
const DIRECTIONS: usize = 8;
/// Units of distance in a cell.
const UNITS: f64 = 3.0;
const FAR: u8 = 255;

/// The grid that all plans of a snippet share.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    low: [f64; 2],
    cell: f64,
    size: [usize; 2],
}

impl Extent {
    /// Around points, with the smallest cells that suffice.
    pub fn of(points: impl Iterator<Item = [f64; 2]>) -> Self {
        let [mut low, mut high] = extremes(points);
        if low[0] > high[0] {
            (low, high) = ([0.0; 2], [0.0; 2]);
        }
        let low = low.map(|x| x - PAD);
        let lengths = [0, 1].map(|axis| high[axis] + PAD - low[axis]);
        let cell = CELL.max(lengths[0].max(lengths[1]) / CELLS_MAX as f64);
        Self { low, cell, size: lengths.map(|length| ((length / cell) as usize + 1).min(CELLS_MAX + 1)) }
    }

    /// The same places in larger cells, metres: of the edge `cell` or, where there would be more than `most` along an
    /// axis, larger ones.
    pub fn coarser(&self, cell: f64, most: f64) -> Self {
        let lengths = self.size.map(|cells| cells as f64 * self.cell);
        let cell = lengths.into_iter().fold(cell, |cell, length| cell.max(length / most));
        Self { low: self.low, cell, size: lengths.map(|length| (length / cell).ceil() as usize) }
    }

    /// The middle of each cell, metres, in the order of their numbers.
    pub fn middles(&self) -> impl Iterator<Item = [f64; 2]> {
        let Self { low, cell, size } = *self;
        (0..size[0] * size[1]).map(move |place| {
            let [x, y] = [place % size[0], place / size[0]].map(|step| (step as f64 + 0.5) * cell);
            [low[0] + x, low[1] + y]
        })
    }

    /// The number of the cell of a place, if it is in one.
    pub fn place(&self, x: f64, y: f64) -> Option<usize> {
        let (column, row) = ((x - self.low[0]) / self.cell, (y - self.low[1]) / self.cell);
        // Also refuses NaN.
        let inside = column >= 0.0 && row >= 0.0 && column < self.size[0] as f64 && row < self.size[1] as f64;
        inside.then(|| row as usize * self.size[0] + column as usize)
    }
}

/// Distances to the points of a sweep, seen from above.
#[derive(Debug)]
pub struct Plan {
    extent: Extent,
    /// Distance of each cell, in thirds of a cell; [`FAR`] from the reach on.
    distances: Vec<u8>,
    /// Distance from which on a place is not near a point, metres.
    reach: f64,
    /// Closeness by distance, 1 at a point and 0 from the reach on.
    closeness: [f32; 256],
}

impl Plan {
    /// The plan of some points of a sweep and the lines between them; a place within `reach`, metres, is near them.
    pub fn new(points: impl Iterator<Item = [f64; 2]>, extent: Extent, reach: f64) -> Self {
        let mut occupied = vec![false; extent.size[0] * extent.size[1]];
        // One point a cell: more add nothing.
        let mut kept = Vec::new();
        for [x, y] in points {
            if let Some(place) = extent.place(x, y).filter(|place| !occupied[*place]) {
                occupied[place] = true;
                kept.push([x, y]);
            }
        }
        let mut surface: Vec<usize> = kept.iter().filter_map(|[x, y]| extent.place(*x, *y)).collect();
        for [from, to] in lines(&kept) {
            let steps = ((to[0] - from[0]).hypot(to[1] - from[1]) / extent.cell).ceil();
            for step in 1..steps as usize {
                let part = step as f64 / steps;
                let [x, y] = [0, 1].map(|axis| from[axis] + part * (to[axis] - from[axis]));
                if let Some(place) = extent.place(x, y).filter(|place| !occupied[*place]) {
                    occupied[place] = true;
                    surface.push(place);
                }
            }
        }
        let distances = distances(&surface, extent, reach);
        let unit = extent.cell / UNITS;
        let closeness = std::array::from_fn(|d| (1.0 - d as f64 * unit / reach).max(0.0) as f32);
        Self { extent, distances, reach, closeness }
    }

    /// Distance from which on a place is not near a point, metres.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// 1 where a point is, 0 where none is within the reach or beyond the border.
    pub fn closeness(&self, x: f64, y: f64) -> f32 {
        self.extent.place(x, y).map_or(0.0, |place| self.closeness[usize::from(self.distances[place])])
    }
}

/// The lines from each point to the nearest in each direction.
fn lines(points: &[[f64; 2]]) -> Vec<[[f64; 2]; 2]> {
    let cells = cells(points, LINE_MAX);
    let mut found = Vec::new();
    for from in points {
        let mut nearest: [(f64, Option<usize>); DIRECTIONS] = [(LINE_MAX, None); DIRECTIONS];
        for index in around(cell(from, LINE_MAX), 1).filter_map(|cell| cells.get(&cell)).flatten() {
            let [dx, dy] = [0, 1].map(|axis| points[*index][axis] - from[axis]);
            let distance = (dx * dx + dy * dy).sqrt();
            let octant = 4 * usize::from(dx < 0.0) + 2 * usize::from(dy < 0.0) + usize::from(dx.abs() < dy.abs());
            let slot = &mut nearest[octant];
            if distance > 0.0 && distance < slot.0 {
                *slot = (distance, Some(*index));
            }
        }
        found.extend(nearest.into_iter().filter_map(|(_, index)| Some([*from, points[index?]])));
    }
    found
}

/// The distance of each cell to the nearest of some cells, as far as the reach.
fn distances(surface: &[usize], extent: Extent, reach: f64) -> Vec<u8> {
    let [width, height] = extent.size;
    let side = (reach / extent.cell).ceil() as i64;
    let span = 2 * side as usize + 1;
    let of = |at: usize| {
        let [x, y] = [at % span, at / span].map(|step| (step as i64 - side) as f64);
        let distance = UNITS * x.hypot(y);
        if distance * extent.cell < UNITS * reach { distance.round() as u8 } else { FAR }
    };
    let disk: Vec<u8> = (0..span * span).map(of).collect();
    let mut distances = vec![FAR; width * height];
    for place in surface {
        let [x, y] = [place % width, place / width].map(|at| at as i64 - side);
        // The columns and rows of the disk that are in the grid.
        let [columns, rows] = [(x, width), (y, height)].map(|(low, size)| {
            let first = (-low).max(0) as usize;
            first..span.min((size as i64 - low) as usize)
        });
        for row in rows {
            let begin = ((y + row as i64) * width as i64 + x + columns.start as i64) as usize;
            let stamp = &disk[row * span + columns.start..row * span + columns.end];
            for (distance, near) in distances[begin..begin + stamp.len()].iter_mut().zip(stamp) {
                *distance = (*distance).min(*near);
            }
        }
    }
    distances
}
