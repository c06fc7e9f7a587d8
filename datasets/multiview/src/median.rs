//! The median.

use std::cmp::Ordering;

/// The median of `values`, the upper of the two middle ones; `None` if there are none. Reorders `values`.
pub(crate) fn median<T: Copy>(values: &mut [T], order: impl FnMut(&T, &T) -> Ordering) -> Option<T> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, order).1)
}
