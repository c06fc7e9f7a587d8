//! Mean, median and range.

use std::cmp::Ordering;

use glam::DVec3;

/// The mean of points; `None` when there are none.
pub fn mean(points: &[DVec3]) -> Option<DVec3> {
    (!points.is_empty()).then(|| points.iter().sum::<DVec3>() / points.len() as f64)
}

/// The median, the upper of the two in the middle; `None` of an empty list.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    median_by(&mut values, f64::total_cmp)
}

/// [`median`] in any order. Reorders `values`.
pub fn median_by<T: Copy>(values: &mut [T], order: impl FnMut(&T, &T) -> Ordering) -> Option<T> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, order).1)
}

/// The smallest and the largest; `None` of an empty list.
pub fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |range, value| match range {
        Some((low, high)) => Some((value.min(low), value.max(high))),
        None => Some((value, value)),
    })
}
