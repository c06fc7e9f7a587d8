//! Points in groups, seen from above.

use std::collections::HashMap;

/// Cells from the cell of a point to that of one of its group, at most.
const JOIN_CELLS: i32 = 2;

/// A cell of a grid.
pub type Cell = [i32; 2];

/// The cell of a point, of cells of an edge, metres.
pub fn cell(point: &[f64; 2], edge: f64) -> Cell {
    point.map(|x| (x / edge).floor() as i32)
}

/// The points of each cell, ascending.
pub fn cells(points: &[[f64; 2]], edge: f64) -> HashMap<Cell, Vec<usize>> {
    let mut cells: HashMap<Cell, Vec<usize>> = HashMap::new();
    for (index, point) in points.iter().enumerate() {
        cells.entry(cell(point, edge)).or_default().push(index);
    }
    cells
}

/// The cells up to `by` away from one along each axis, itself included.
pub fn around([x, y]: Cell, by: i32) -> impl Iterator<Item = Cell> {
    (-by..=by).flat_map(move |dx| (-by..=by).map(move |dy| [x + dx, y + dy]))
}

/// Points in groups: those whose cells of an edge, metres, are at most two apart. Groups are in the order of
/// their first points.
pub fn joined(points: &[[f64; 2]], edge: f64) -> Vec<Vec<[f64; 2]>> {
    let mut cells = cells(points, edge);
    let (mut groups, mut stack) = (Vec::new(), Vec::new());
    for point in points {
        let mut group = Vec::new();
        stack.push(cell(point, edge));
        while let Some(at) = stack.pop() {
            let Some(members) = cells.remove(&at) else { continue };
            group.extend(members);
            stack.extend(around(at, JOIN_CELLS).filter(|cell| cells.contains_key(cell)));
        }
        if !group.is_empty() {
            group.sort_unstable();
            groups.push(group.into_iter().map(|index| points[index]).collect());
        }
    }
    groups
}

/// Smallest distance of two sets of points, metres; infinite without points.
pub fn gap(one: &[[f64; 2]], two: &[[f64; 2]]) -> f64 {
    let squared = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    one.iter().flat_map(|a| two.iter().map(move |b| squared(a, b))).fold(f64::INFINITY, f64::min).sqrt()
}

/// The mean of points.
pub fn middle(points: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|axis| points.iter().map(|p| p[axis]).sum::<f64>() / points.len() as f64)
}
