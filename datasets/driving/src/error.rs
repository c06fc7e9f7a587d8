//! Errors of this crate: those of `gs-datasets`, made from here.

use std::path::Path;

use gs_datasets::DatasetError;

/// A file's content breaks the rules of its format.
pub(crate) fn malformed(
    path: &Path,
    location: impl Into<String>,
    expected: impl Into<String>,
    found: impl Into<String>,
) -> DatasetError {
    DatasetError::Malformed {
        path: path.to_path_buf(),
        location: location.into(),
        expected: expected.into(),
        found: found.into(),
    }
}
