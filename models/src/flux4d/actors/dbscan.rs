//! DBSCAN (Ester et al. 1996) on a grid, deterministic.
//!
//! Cells have the edge `eps / sqrt 3`, so two points of a cell are neighbours, and neighbours of a point lie at most
//! two cells away. Cells are keys of 21 bits an axis, sorted; the five cells of a column are consecutive. Core points
//! of a cell belong to one cluster; cells are joined where a pair of their core points is near. A border point goes to
//! the lowest of its clusters, and clusters are numbered by their first core point, so the labels depend on the order
//! of the points and on nothing else.

use rayon::prelude::*;

use crate::flux4d::error::{FluxError, check_points, check_range};

/// Bits of a cell's index along an axis.
const BITS: u32 = 21;
/// Cells along an axis.
const CELLS: i64 = 1 << BITS;
/// `ceil(sqrt 3)`: a neighbour is at most this many cells away.
const REACH: i64 = 2;

/// The cluster of each point, numbered from 0; `None` for noise. `eps` in the points' unit; a core point has at least
/// `min_points` points within `eps`, itself included.
///
/// # Errors
/// When a coordinate is not usable, `eps` or `min_points` is out of range, or the points spread over more than two
/// million cells.
pub fn dbscan(points: &[[f32; 3]], eps: f64, min_points: usize) -> Result<Vec<Option<u32>>, FluxError> {
    check_points(points)?;
    check_range("the radius of the clustering", eps, [1e-6, 1e6], "a positive length")?;
    check_range("the smallest number of neighbours", min_points as f64, [1.0, 1e9], "1 or more")?;
    let grid = Grid::new(points, eps)?;
    let core = grid.core(min_points);
    let cell_cluster = grid.join(&core);
    Ok(grid.labels(&core, &cell_cluster))
}

struct Cell {
    index: [i64; 3],
    from: usize,
    to: usize,
}

struct Grid<'a> {
    points: &'a [[f32; 3]],
    squared: f64,
    /// Rows, by cell.
    rows: Vec<u32>,
    keys: Vec<u64>,
    cells: Vec<Cell>,
}

fn key([x, y, z]: [i64; 3]) -> u64 {
    ((x as u64) << (2 * BITS)) | ((y as u64) << BITS) | z as u64
}

impl<'a> Grid<'a> {
    fn new(points: &'a [[f32; 3]], eps: f64) -> Result<Self, FluxError> {
        let edge = eps / 3.0_f64.sqrt();
        let lowest = |axis: usize| points.iter().map(|p| p[axis]).fold(f32::INFINITY, f32::min);
        let low = [0, 1, 2].map(lowest);
        let index = |p: &[f32; 3]| [0, 1, 2].map(|a| ((f64::from(p[a]) - f64::from(low[a])) / edge) as i64);
        let largest = points.par_iter().map(|p| index(p).into_iter().max().unwrap_or(0)).max().unwrap_or(0);
        check_range("the spread of the points in cells", largest as f64, [0.0, (CELLS - 1) as f64], "2097151 at most")?;
        let mut sorted: Vec<(u64, u32)> =
            points.par_iter().enumerate().map(|(row, p)| (key(index(p)), row as u32)).collect();
        sorted.par_sort_unstable();
        let (mut keys, mut cells, mut from) = (Vec::new(), Vec::new(), 0);
        for group in sorted.chunk_by(|a, b| a.0 == b.0) {
            keys.push(group[0].0);
            cells.push(Cell { index: index(&points[group[0].1 as usize]), from, to: from + group.len() });
            from += group.len();
        }
        let rows = sorted.into_iter().map(|(_, row)| row).collect();
        Ok(Self { points, squared: eps * eps, rows, keys, cells })
    }

    fn rows_of(&self, cell: usize) -> &[u32] {
        &self.rows[self.cells[cell].from..self.cells[cell].to]
    }

    fn near(&self, a: u32, b: u32) -> bool {
        let (a, b) = (self.points[a as usize], self.points[b as usize]);
        (0..3).map(|axis| (f64::from(a[axis]) - f64::from(b[axis])).powi(2)).sum::<f64>() <= self.squared
    }

    /// The cells within reach of `cell`, itself included, ascending.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> + '_ {
        let [x, y, z] = self.cells[cell].index;
        let columns = (-REACH..=REACH).flat_map(move |dx| (-REACH..=REACH).map(move |dy| [x + dx, y + dy]));
        let columns = columns.filter(|column| column.iter().all(|c| (0..CELLS).contains(c)));
        columns.flat_map(move |[x, y]| {
            let (first, last) = (key([x, y, (z - REACH).max(0)]), key([x, y, (z + REACH).min(CELLS - 1)]));
            let from = self.keys.partition_point(|key| *key < first);
            from..from + self.keys[from..].iter().take_while(|key| **key <= last).count()
        })
    }

    /// Whether each point is a core point.
    fn core(&self, min_points: usize) -> Vec<bool> {
        let of_cell = |cell: usize| -> Vec<(u32, bool)> {
            let own = self.rows_of(cell);
            if own.len() >= min_points {
                return own.iter().map(|row| (*row, true)).collect();
            }
            let around: Vec<usize> = self.around(cell).collect();
            let is_core = |row: u32| {
                let others = around.iter().flat_map(|other| self.rows_of(*other));
                others.filter(|other| self.near(row, **other)).take(min_points).count() == min_points
            };
            own.iter().map(|row| (*row, is_core(*row))).collect()
        };
        let found: Vec<(u32, bool)> = (0..self.cells.len()).into_par_iter().flat_map_iter(of_cell).collect();
        let mut core = vec![false; self.points.len()];
        found.into_iter().for_each(|(row, is_core)| core[row as usize] = is_core);
        core
    }

    /// The cluster of each cell's core points, `None` for a cell without.
    fn join(&self, core: &[bool]) -> Vec<Option<u32>> {
        let core_rows: Vec<Vec<u32>> = (0..self.cells.len())
            .map(|cell| self.rows_of(cell).iter().copied().filter(|row| core[*row as usize]).collect())
            .collect();
        let mut parents: Vec<usize> = (0..self.cells.len()).collect();
        for cell in 0..self.cells.len() {
            for other in self.around(cell).filter(|other| *other > cell) {
                let (a, b) = (root(&mut parents, cell), root(&mut parents, other));
                let touch = || core_rows[cell].iter().any(|p| core_rows[other].iter().any(|q| self.near(*p, *q)));
                if a != b && touch() {
                    parents[a.max(b)] = a.min(b);
                }
            }
        }
        let mut first = vec![u32::MAX; self.cells.len()];
        for cell in 0..self.cells.len() {
            let root = root(&mut parents, cell);
            first[root] = first[root].min(core_rows[cell].iter().copied().min().unwrap_or(u32::MAX));
        }
        let mut roots: Vec<usize> = (0..self.cells.len()).filter(|cell| first[*cell] < u32::MAX).collect();
        roots.sort_unstable_by_key(|cell| first[*cell]);
        let mut number = vec![0; self.cells.len()];
        roots.iter().zip(0..).for_each(|(cell, n)| number[*cell] = n);
        let of_cell = |cell: usize| (!core_rows[cell].is_empty()).then(|| number[root(&mut parents, cell)]);
        (0..self.cells.len()).map(of_cell).collect()
    }

    fn labels(&self, core: &[bool], cluster: &[Option<u32>]) -> Vec<Option<u32>> {
        let border = |row: u32, cell: usize| {
            let others = self.around(cell).filter(|other| cluster[*other].is_some());
            let touching =
                others.filter(|other| self.rows_of(*other).iter().any(|q| core[*q as usize] && self.near(row, *q)));
            touching.filter_map(|other| cluster[other]).min()
        };
        let of_cell = |cell: usize| {
            let label = |row: &u32| if core[*row as usize] { cluster[cell] } else { border(*row, cell) };
            self.rows_of(cell).iter().map(|row| (*row, label(row))).collect::<Vec<_>>()
        };
        let found: Vec<(u32, Option<u32>)> = (0..self.cells.len()).into_par_iter().flat_map_iter(of_cell).collect();
        let mut labels = vec![None; self.points.len()];
        found.into_iter().for_each(|(row, label)| labels[row as usize] = label);
        labels
    }
}

fn root(parents: &mut [usize], mut cell: usize) -> usize {
    while parents[cell] != cell {
        parents[cell] = parents[parents[cell]];
        cell = parents[cell];
    }
    cell
}
