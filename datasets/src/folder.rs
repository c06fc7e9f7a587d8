//! Files that a reader looks for by itself.

use std::path::{Path, PathBuf};

/// The paths in a folder by the bytes of their names, the order of Python's `sorted`; none where it cannot be listed.
/// [Dot files](is_dot_file) are passed over.
pub(crate) fn entries(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> =
        entries.flatten().map(|entry| entry.path()).filter(|path| !is_dot_file(path)).collect();
    paths.sort();
    paths
}

/// Whether a name begins with a dot. Such files are hidden, and macOS writes `._NAME` beside every NAME on disks of
/// other systems.
fn is_dot_file(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."))
}

/// The last part of a path as text.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
