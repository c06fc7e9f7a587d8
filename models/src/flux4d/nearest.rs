//! The nearest neighbours of points among themselves, exact, by a balanced k-d tree.
//!
//! A node is the median of its points along their widest axis; the left half lies before it in memory, the right half
//! after it. The tree is a permutation of the points and one axis a point. Points are split by rank, not by value, so
//! coincident points neither deepen the tree nor stop it. A grid of one cell size would not do for LiDAR, whose density
//! falls by four orders of magnitude from the sensor to the horizon.

use rayon::prelude::*;

/// Ranges of at most this many points are searched one by one. Between 8 and 16 the time hardly changes.
const LEAF: usize = 12;
/// Subtrees of fewer points are built on one thread.
const ONE_THREAD: usize = 1 << 14;

/// A neighbour: squared distance, and the row of the point.
pub type Neighbour = (f32, u32);

/// A k-d tree.
#[derive(Debug, Clone)]
pub struct NearestPoints {
    points: Vec<[f32; 3]>,
    rows: Vec<u32>,
    axes: Vec<u8>,
}

impl NearestPoints {
    /// A tree over `points`, whose coordinates must be finite.
    pub fn new(points: &[[f32; 3]]) -> Self {
        let mut sorted: Vec<([f32; 3], u32)> = points.iter().copied().zip(0..).collect();
        let mut axes = vec![0; points.len()];
        build(&mut sorted, &mut axes);
        let (points, rows) = sorted.into_iter().unzip();
        Self { points, rows, axes }
    }

    /// For each point, in the order given to [`new`](Self::new), its `K` nearest others, nearest first. Missing
    /// neighbours (fewer than `K + 1` points) have an infinite distance and row 0.
    pub fn all<const K: usize>(&self) -> Vec<[Neighbour; K]> {
        // In the order of the tree, so that consecutive searches visit the same nodes.
        let found: Vec<[Neighbour; K]> = (0..self.points.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|place| {
                let mut best = [(f32::INFINITY, 0); K];
                self.search(0, self.points.len(), self.points[place], place, &mut best);
                best
            })
            .collect();
        let mut ordered = vec![[(f32::INFINITY, 0); K]; found.len()];
        for (row, best) in self.rows.iter().zip(found) {
            ordered[*row as usize] = best;
        }
        ordered
    }

    fn search<const K: usize>(&self, from: usize, to: usize, at: [f32; 3], own: usize, best: &mut [Neighbour; K]) {
        if to - from <= LEAF {
            (from..to).for_each(|place| self.offer(place, at, own, best));
            return;
        }
        let middle = from.midpoint(to);
        let axis = self.axes[middle] as usize;
        let across = at[axis] - self.points[middle][axis];
        let [near, far] =
            if across < 0.0 { [(from, middle), (middle + 1, to)] } else { [(middle + 1, to), (from, middle)] };
        self.search(near.0, near.1, at, own, best);
        self.offer(middle, at, own, best);
        if across * across < best[K - 1].0 {
            self.search(far.0, far.1, at, own, best);
        }
    }

    fn offer<const K: usize>(&self, place: usize, at: [f32; 3], own: usize, best: &mut [Neighbour; K]) {
        let p = self.points[place];
        let [x, y, z] = [p[0] - at[0], p[1] - at[1], p[2] - at[2]];
        let squared = x * x + y * y + z * z;
        if squared >= best[K - 1].0 || place == own {
            return;
        }
        let mut slot = K - 1;
        while slot > 0 && best[slot - 1].0 > squared {
            best[slot] = best[slot - 1];
            slot -= 1;
        }
        best[slot] = (squared, self.rows[place]);
    }
}

fn build(points: &mut [([f32; 3], u32)], axes: &mut [u8]) {
    let count = points.len();
    if count <= LEAF {
        return;
    }
    let axis = widest(points);
    let middle = count / 2;
    // Equal coordinates are ordered by row: the tree is the same for every machine and thread count.
    points.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    axes[middle] = axis as u8;
    let (before, after) = points.split_at_mut(middle);
    let (axes_before, axes_after) = axes.split_at_mut(middle);
    let (after, axes_after) = (&mut after[1..], &mut axes_after[1..]);
    if count < ONE_THREAD {
        build(before, axes_before);
        build(after, axes_after);
    } else {
        rayon::join(|| build(before, axes_before), || build(after, axes_after));
    }
}

fn widest(points: &[([f32; 3], u32)]) -> usize {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (point, _) in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let width = |axis: usize| high[axis] - low[axis];
    (1..3).fold(0, |best, axis| if width(axis) > width(best) { axis } else { best })
}
