//! Fewer points where they add nothing: points of one voxel and one time become their mean.

use rayon::prelude::*;

use super::error::{FluxError, check_length, check_points, check_range};

/// Shortest edge of merging voxels, metres: below it a LiDAR's own noise (2 cm) decides which voxel a point is in.
pub const EDGE_MIN: f32 = 0.03;

/// Longest edge of merging voxels, metres: a car is one point or two.
pub const EDGE_MAX: f32 = 4.0;

/// Steps of the ladder in which an edge doubles. Points on surfaces become a fourth when the edge doubles, so at least
/// 0.84 of a budget is used where the points are dense (measured: 0.88 to 0.98 on a street of 128 beams).
const STEPS_PER_DOUBLING: i32 = 8;

/// Edges of merging voxels, metres, from [`EDGE_MIN`] to [`EDGE_MAX`].
pub fn ladder() -> Vec<f32> {
    let edge = |step: i32| EDGE_MIN * (f64::from(step) / f64::from(STEPS_PER_DOUBLING)).exp2() as f32;
    (0..).map(edge).take_while(|edge| *edge < EDGE_MAX).chain([EDGE_MAX]).collect()
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

/// How points are merged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MergeConfig {
    /// The largest number of points that is wanted.
    pub budget: usize,
    /// The window is cut into this many equal times, 1 to 4096, and points of different times stay apart: merging two
    /// times of a moving object would erase its motion. The number of input sweeps is right.
    pub times: usize,
}

/// Result of [`merge_to_budget`].
#[derive(Debug, Clone, PartialEq)]
pub struct Merged {
    /// The points that are left of each part.
    pub parts: Vec<TimedPoints>,
    /// Edge of the voxels, metres; `None` if nothing had to be merged.
    pub voxel: Option<f32>,
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
        return Ok(Merged { parts, voxel: None });
    }
    let at = |edge: f32| parts.iter().map(|part| merge(part, edge, config.times)).collect::<Result<Vec<_>, _>>();
    let edges = ladder();
    let (mut from, mut to) = (0, edges.len() - 1);
    let mut best = None;
    while from < to {
        let middle = (from + to) / 2;
        let merged = at(edges[middle])?;
        if count(&merged) <= config.budget {
            (to, best) = (middle, Some(merged));
        } else {
            from = middle + 1;
        }
    }
    // The last edge is never tried by halving.
    let parts = best.map_or_else(|| at(edges[to]), Ok)?;
    Ok(Merged { parts, voxel: Some(edges[to]) })
}

fn count(parts: &[TimedPoints]) -> usize {
    parts.iter().map(|part| part.points.len()).sum()
}

/// Points of one voxel (edge in metres) and one of `times` equal parts of the window become one: mean position, mean
/// time, mean of the known colours. The result is in the order of the first point of each.
///
/// # Errors
/// When lengths differ, a coordinate or time is not usable, or `voxel` or `times` is out of range.
pub fn merge(points: &TimedPoints, voxel: f32, times: usize) -> Result<TimedPoints, FluxError> {
    check(points, voxel, times)?;
    let key = |row: usize| {
        let cell = points.points[row].map(|x| (f64::from(x) / f64::from(voxel)).floor() as i32);
        let time = ((points.times[row] * times as f32) as usize).min(times - 1);
        (cell, time as u16)
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
    Ok(merged)
}

fn check(points: &TimedPoints, voxel: f32, times: usize) -> Result<(), FluxError> {
    check_points(&points.points)?;
    check_length("times", points.points.len(), points.times.len())?;
    check_length("colours", points.points.len(), points.colors.len())?;
    check_range("the edge of the merging voxels", f64::from(voxel), [1e-3, 1e3], "1 mm to 1 km")?;
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
