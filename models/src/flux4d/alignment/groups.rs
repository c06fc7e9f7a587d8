//! Points in groups, seen from above.

use std::collections::HashMap;

/// Edge of the cells in which evident points are joined, and how many cells a gap may have.
const JOIN_CELL: f64 = 0.3;
const JOIN_GAP: i32 = 2;

/// Points in groups: those whose cells are neighbours. Groups are in the order of their first points.
pub fn joined(points: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
    let cell = |point: &[f64; 2]| point.map(|x| (x / JOIN_CELL).floor() as i32);
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
            let around = (-JOIN_GAP..=JOIN_GAP).flat_map(|dx| (-JOIN_GAP..=JOIN_GAP).map(move |dy| [x + dx, y + dy]));
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
