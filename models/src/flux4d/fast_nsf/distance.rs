//! The distance to the nearest point of a cloud, on a grid, exact between cells (Felzenszwalb and Huttenlocher 2012).

use rayon::prelude::*;

use crate::flux4d::error::{FluxError, check_points, check_range};
use crate::flux4d::far::Bounds;

/// Squared cells from the nearest point where there is none; far above any grid's diagonal and exact in `f32`.
const FAR: f32 = 1e12;

/// Distances to a cloud.
#[derive(Debug, Clone)]
pub struct DistanceGrid {
    /// Centre of the first cell, world, metres.
    low: [f64; 3],
    /// Edge of a cell, metres.
    cell: f64,
    /// Cells along x, y and z.
    size: [usize; 3],
    /// Metres, `[y, x, z]` with z fastest.
    distances: Vec<f32>,
}

impl DistanceGrid {
    /// The grid around both clouds, padded by a cell, of distances to `target`. Cells have the edge `cell` (metres), or
    /// the smallest edge for which there are at most `most_cells`.
    ///
    /// # Errors
    /// When there is no point, a coordinate is not usable, or a setting is out of range.
    pub fn new(target: &[[f32; 3]], others: &[[f32; 3]], cell: f64, most_cells: usize) -> Result<Self, FluxError> {
        check_points(target)?;
        check_points(others)?;
        check_range("the cell of the distance grid", cell, [1e-3, 100.0], "1 mm to 100 m")?;
        check_range("the number of cells of the distance grid", most_cells as f64, [1e3, 1e9], "1000 to 1e9")?;
        if target.is_empty() {
            return Err(FluxError::TooFew { what: "the distance grid", needed: 1, found: 0 });
        }
        let bounds = Bounds::of(target.iter().chain(others));
        let (cell, size) = fitting(&bounds, cell, most_cells);
        let low = bounds.low.map(|x| x - cell);
        let mut grid = Self { low, cell, size, distances: Vec::new() };
        let mut squared = vec![FAR; size.iter().product()];
        for point in target {
            let [x, y, z] = [0, 1, 2].map(|a| ((f64::from(point[a]) - low[a]) / cell).round() as usize);
            squared[(z * size[1] + y) * size[0] + x] = 0.0;
        }
        grid.distances = transformed(squared, size).into_iter().map(|d| d.sqrt() * cell as f32).collect();
        Ok(grid)
    }

    /// Edge of a cell, metres.
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// Distance at a world position, metres, and its gradient; trilinear between cells. Beyond the border the border's
    /// value counts, and the gradient across it is zero.
    pub fn sample(&self, at: [f64; 3]) -> (f64, [f64; 3]) {
        let (mut base, mut part, mut inside) = ([0; 3], [0.0; 3], [1.0; 3]);
        for axis in 0..3 {
            let last = (self.size[axis] - 1) as f64;
            let place = (at[axis] - self.low[axis]) / self.cell;
            if !(place > 0.0 && place < last) {
                inside[axis] = 0.0;
            }
            let place = place.clamp(0.0, last);
            base[axis] = (place as usize).min(self.size[axis] - 2);
            part[axis] = place - base[axis] as f64;
        }
        let (mut value, mut slope) = (0.0, [0.0; 3]);
        for corner in 0..8_usize {
            let side = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight = |axis: usize| if side[axis] == 1 { part[axis] } else { 1.0 - part[axis] };
            let sign = |axis: usize| if side[axis] == 1 { 1.0 } else { -1.0 };
            let [x, y, z] = [0, 1, 2].map(|axis| base[axis] + side[axis]);
            let distance = f64::from(self.distances[(y * self.size[0] + x) * self.size[2] + z]);
            let [wx, wy, wz] = [weight(0), weight(1), weight(2)];
            value += distance * wx * wy * wz;
            slope[0] += distance * sign(0) * wy * wz;
            slope[1] += distance * sign(1) * wx * wz;
            slope[2] += distance * sign(2) * wx * wy;
        }
        (value, [0, 1, 2].map(|axis| slope[axis] / self.cell * inside[axis]))
    }
}

/// The edge and the number of cells along each axis, padding included.
fn fitting(bounds: &Bounds, mut cell: f64, most: usize) -> (f64, [usize; 3]) {
    loop {
        let size = [0, 1, 2].map(|axis| ((bounds.high[axis] - bounds.low[axis]) / cell).ceil() + 3.0);
        let count: f64 = size.iter().product();
        if count <= most as f64 {
            return (cell, size.map(|cells| cells as usize));
        }
        // At least a percent larger each time, so it ends: padding alone is 27 cells.
        cell *= (count / most as f64).cbrt().max(1.01);
    }
}

/// Squared distances in cells, `[z, y, x]` to `[y, x, z]`.
fn transformed(mut squared: Vec<f32>, [nx, ny, nz]: [usize; 3]) -> Vec<f32> {
    squared.par_chunks_exact_mut(nx).for_each_init(Scratch::default, |scratch, line| scratch.transform(line));
    squared.par_chunks_exact_mut(nx * ny).for_each_init(Scratch::default, |scratch, slab| {
        let mut line = vec![0.0; ny];
        for x in 0..nx {
            (0..ny).for_each(|y| line[y] = slab[y * nx + x]);
            scratch.transform(&mut line);
            (0..ny).for_each(|y| slab[y * nx + x] = line[y]);
        }
    });
    let mut turned = vec![0.0; squared.len()];
    turned.par_chunks_exact_mut(nz).enumerate().for_each_init(Scratch::default, |scratch, (place, line)| {
        (0..nz).for_each(|z| line[z] = squared[z * nx * ny + place]);
        scratch.transform(line);
    });
    turned
}

/// The lower envelope of parabolas along a line.
#[derive(Default)]
struct Scratch {
    line: Vec<f32>,
    roots: Vec<usize>,
    starts: Vec<f64>,
}

impl Scratch {
    /// `line[i]` becomes the least `line[j] + (i - j)^2`.
    fn transform(&mut self, line: &mut [f32]) {
        self.line.clear();
        self.line.extend_from_slice(line);
        self.roots.clear();
        self.starts.clear();
        for (place, value) in self.line.iter().enumerate().filter(|(_, value)| **value < FAR) {
            let mut start = f64::NEG_INFINITY;
            while let (Some(root), Some(first)) = (self.roots.last(), self.starts.last()) {
                let (a, b) = (*root as f64, place as f64);
                let cross = (f64::from(*value) + b * b - f64::from(self.line[*root]) - a * a) / (2.0 * (b - a));
                if cross > *first {
                    start = cross;
                    break;
                }
                self.roots.pop();
                self.starts.pop();
            }
            self.roots.push(place);
            self.starts.push(start);
        }
        let mut current = 0;
        for (place, value) in line.iter_mut().enumerate().filter(|_| !self.roots.is_empty()) {
            while self.starts.get(current + 1).is_some_and(|start| *start < place as f64) {
                current += 1;
            }
            let root = self.roots[current];
            *value = self.line[root] + (place.abs_diff(root) as f32).powi(2);
        }
    }
}
