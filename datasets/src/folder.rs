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

/// The folder that a file lies in.
pub(crate) fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether the name ends with one of the extensions, which are in lower case, in any case.
pub(crate) fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    extensions.contains(&extension(path).as_str())
}

/// The extension in lower case.
pub(crate) fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

/// The last part of a path without its extension, as text.
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The last part of a path as text.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
