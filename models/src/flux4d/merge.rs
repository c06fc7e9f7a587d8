//! Fewer points where they add nothing: points of one voxel and one time become their mean.
//!
//! With viewpoints the edge of a voxel grows with the root of the distance to the nearest of them. One edge everywhere
//! merges near surfaces alone, which have the most points and fill the image; an edge in proportion to the distance
//! merges near and far alike, and what is far has few points to spare. At equal counts the root was the best of the
//! powers 0, 1/3, 2/3 and 1 on streets of 32 to 128 beams and on PandaSet.

use rayon::prelude::*;

use super::error::{FluxError, check_length, check_points, check_range};

/// Shortest edge of merging voxels, metres: below it a LiDAR's own noise (2 cm) decides which voxel a point is in.
pub const EDGE_MIN: f32 = 0.03;

/// Longest edge of merging voxels, metres: a car is one point or two.
pub const EDGE_MAX: f32 = 4.0;

/// The distance from the nearest viewpoint at which an edge has its nominal length, metres.
pub const NOMINAL_DISTANCE: f32 = 10.0;

/// Steps of the ladder in which an edge doubles. Points on surfaces become a fourth when the edge doubles, so at least
/// 0.84 of a budget is used where the points are dense (measured: 0.88 to 0.98 on a street of 128 beams).
const STEPS_PER_DOUBLING: i32 = 8;

/// Edges that grow with the distance are rounded down to this many in each doubling: points whose edges differ are
/// never in one voxel, so there are few.
const EDGES_PER_DOUBLING: i32 = 2;

/// Edges of merging voxels, metres, from [`EDGE_MIN`] to [`EDGE_MAX`].
pub fn ladder() -> Vec<f32> {
    steps(EDGE_MIN, EDGE_MAX, STEPS_PER_DOUBLING)
}

fn steps(first: f32, last: f32, per_doubling: i32) -> Vec<f32> {
    let at = |step: i32| first * (f64::from(step) / f64::from(per_doubling)).exp2() as f32;
    (0..).map(at).take_while(|value| *value < last).chain([last]).collect()
}

/// Points with what is known of them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TimedPoints {
    /// World, metres.
    pub points: Vec<[f32; 3]>,
    /// 0 to 1 in the window.
    pub times: Vec<f32>,
    /// 0 to 1 each; `None` where no image shows the point.
    pub colors: Vec<Option<[f32; 3]>>,
}

/// The configuration of a merge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MergeConfig<'a> {
    /// The largest number of points that is wanted.
    pub budget: usize,
    /// The window is cut into this many equal times, 1 to 4096, and points of different times stay apart: merging two
    /// times of a moving object would erase its motion. The number of input sweeps is right.
    pub times: usize,
    /// Positions from which the points are seen, world, metres. Without any, voxels have one edge.
    pub viewpoints: &'a [[f32; 3]],
}

/// Result of [`merge_to_budget`].
#[derive(Debug, Clone, PartialEq)]
pub struct Merged {
    /// The points that are left of each part.
    pub parts: Vec<TimedPoints>,
    /// Edge of the voxels, with viewpoints that at [`NOMINAL_DISTANCE`], metres; `None` if nothing had to be merged.
    pub edge: Option<f32>,
}

/// Merges with the smallest edge of [`ladder`] that keeps at most the budget in all parts together, or with the largest
/// if none does. Points of two parts stay apart.
///
/// The edge is found by halving: about six of the ladder's steps are tried.
///
/// # Errors
/// When lengths differ, a coordinate or time is not usable, or `times` is out of range.
pub fn merge_to_budget(parts: Vec<TimedPoints>, config: &MergeConfig) -> Result<Merged, FluxError> {
    if count(&parts) <= config.budget {
        return Ok(Merged { parts, edge: None });
    }
    check_points(config.viewpoints)?;
    parts.iter().try_for_each(|part| check(part, config.times))?;
    let growth: Vec<Vec<f32>> = parts.iter().map(|part| growth(&part.points, config.viewpoints)).collect();
    let edges = Edges::new();
    let at = |edge: f32| -> Vec<TimedPoints> {
        let of_part = |(part, growth): (&TimedPoints, &Vec<f32>)| match growth.is_empty() {
            true => merged(part, |_| (0, edge), config.times),
            false => merged(part, |row| edges.of(edge * growth[row]), config.times),
        };
        parts.iter().zip(&growth).map(of_part).collect()
    };
    let values = ladder();
    let (mut from, mut to) = (0, values.len() - 1);
    let mut best = None;
    while from < to {
        let middle = (from + to) / 2;
        let merged = at(values[middle]);
        if count(&merged) <= config.budget {
            (to, best) = (middle, Some(merged));
        } else {
            from = middle + 1;
        }
    }
    // The last value is never tried by halving.
    let parts = best.unwrap_or_else(|| at(values[to]));
    Ok(Merged { parts, edge: Some(values[to]) })
}

fn count(parts: &[TimedPoints]) -> usize {
    parts.iter().map(|part| part.points.len()).sum()
}

/// The factor of the edge at each point; empty without viewpoints.
fn growth(points: &[[f32; 3]], viewpoints: &[[f32; 3]]) -> Vec<f32> {
    if viewpoints.is_empty() {
        return Vec::new();
    }
    let squared = |a: &[f32; 3], b: &[f32; 3]| (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f32>();
    let nearest = |point| viewpoints.iter().map(|viewpoint| squared(point, viewpoint)).fold(f32::INFINITY, f32::min);
    points.par_iter().map(|point| (nearest(point).sqrt() / NOMINAL_DISTANCE).sqrt()).collect()
}

/// The edges that wanted ones are rounded down to.
struct Edges(Vec<f32>);

impl Edges {
    fn new() -> Self {
        Self(steps(EDGE_MIN, EDGE_MAX, EDGES_PER_DOUBLING))
    }

    /// The number and the length of the longest edge that is not longer than wanted, or of the shortest.
    fn of(&self, wanted: f32) -> (u8, f32) {
        let number = self.0.partition_point(|edge| *edge <= wanted).saturating_sub(1);
        (number as u8, self.0[number])
    }
}

/// Points of one voxel (edge in metres) and one of `times` equal parts of the window become one: mean position, mean
/// time, mean of the known colours. The result is in the order of the first point of each.
///
/// # Errors
/// When lengths differ, a coordinate or time is not usable, or `voxel` or `times` is out of range.
pub fn merge(points: &TimedPoints, voxel: f32, times: usize) -> Result<TimedPoints, FluxError> {
    check_range("the edge of the merging voxels", f64::from(voxel), [1e-3, 1e3], "1 mm to 1 km")?;
    check(points, times)?;
    Ok(merged(points, |_| (0, voxel), times))
}

/// Points of one edge, given with its number for each row, of one voxel and time become one.
fn merged(points: &TimedPoints, edge_of: impl Fn(usize) -> (u8, f32) + Sync, times: usize) -> TimedPoints {
    let key = |row: usize| {
        let (number, edge) = edge_of(row);
        let cell = points.points[row].map(|x| (f64::from(x) / f64::from(edge)).floor() as i32);
        let time = ((points.times[row] * times as f32) as usize).min(times - 1);
        (cell, number, time as u16)
    };
    let mut rows: Vec<_> = (0..points.points.len()).into_par_iter().map(|row| (key(row), row as u32)).collect();
    rows.par_sort_unstable();
    let mut groups: Vec<&[_]> = rows.chunk_by(|a, b| a.0 == b.0).collect();
    groups.par_sort_unstable_by_key(|group| group[0].1);
    let means: Vec<_> =
        groups.par_iter().map(|group| mean(points, group.iter().map(|(_, row)| *row as usize))).collect();
    let mut merged = TimedPoints::default();
    for (point, time, color) in means {
        merged.points.push(point);
        merged.times.push(time);
        merged.colors.push(color);
    }
    merged
}

fn check(points: &TimedPoints, times: usize) -> Result<(), FluxError> {
    check_points(&points.points)?;
    check_length("times", points.points.len(), points.times.len())?;
    check_length("colours", points.points.len(), points.colors.len())?;
    check_range("the number of times kept apart", times as f64, [1.0, 4096.0], "1 to 4096")?;
    points.times.iter().try_for_each(|time| check_range("a point's time", f64::from(*time), [0.0, 1.0], "0 to 1"))
}

fn mean(points: &TimedPoints, rows: impl Iterator<Item = usize>) -> ([f32; 3], f32, Option<[f32; 3]>) {
    let (mut point, mut time, mut color) = ([0.0; 3], 0.0, [0.0; 3]);
    let (mut count, mut colored) = (0.0, 0.0);
    for row in rows {
        count += 1.0;
        time += f64::from(points.times[row]);
        (0..3).for_each(|axis| point[axis] += f64::from(points.points[row][axis]));
        if let Some(known) = points.colors[row] {
            colored += 1.0;
            (0..3).for_each(|channel| color[channel] += f64::from(known[channel]));
        }
    }
    let share = |sum: [f64; 3], of: f64| sum.map(|x| (x / of) as f32);
    (share(point, count), (time / count) as f32, (colored > 0.0).then(|| share(color, colored)))
}
