//! Ranges of options.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::Path;

use gs_datasets::DatasetError;

/// Fails unless every option is in its range, which NaN never is.
pub(crate) fn check_ranges<T: PartialOrd + Display>(
    dir: &Path,
    options: &[(&'static str, T, RangeInclusive<T>)],
) -> Result<(), DatasetError> {
    match options.iter().find(|(_, value, range)| !range.contains(value)) {
        None => Ok(()),
        Some((option, value, range)) => Err(DatasetError::Option {
            path: dir.to_path_buf(),
            option,
            expected: format!("{} to {}", range.start(), range.end()),
            found: value.to_string(),
        }),
    }
}
