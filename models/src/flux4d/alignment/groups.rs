//! Points in groups, seen from above.

use std::collections::HashMap;

/// Cells from the cell of a point to that of one of its group, at most.
const JOIN_CELLS: i32 = 2;

/// Points in groups: those whose cells of the edge `cell`, metres, are at most two apart. Groups are in the order of
/// their first points.
pub fn joined(points: &[[f64; 2]], cell: f64) -> Vec<Vec<[f64; 2]>> {
    let cell = |point: &[f64; 2]| point.map(|x| (x / cell).floor() as i32);
    let mut cells: HashMap<[i32; 2], Vec<usize>> = HashMap::new();
    for (index, point) in points.iter().enumerate() {
        cells.entry(cell(point)).or_default().push(index);
    }
    let (mut groups, mut stack) = (Vec::new(), Vec::new());
    for point in points {
        let mut group = Vec::new();
        stack.push(cell(point));
        while let Some([x, y]) = stack.pop() {
            let Some(members) = cells.remove(&[x, y]) else { continue };
            group.extend(members);
            let around =
                (-JOIN_CELLS..=JOIN_CELLS).flat_map(|dx| (-JOIN_CELLS..=JOIN_CELLS).map(move |dy| [x + dx, y + dy]));
            stack.extend(around.filter(|cell| cells.contains_key(cell)));
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
