//! Bytes of files: bounded reading, and writing that is whole or not at all.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::Path;

use crate::FormatError;

/// Longest file that is read, bytes: 67 million Gaussians of degree 3 as glTF take 16 GB, and nobody passes such files on. A limit
/// also ends the reading of what grows meanwhile.
const FILE_MAX: u64 = 8 << 30;

/// The bytes of a regular file.
///
/// # Errors
/// When it is no regular file, is longer than 8 GiB, or cannot be read.
pub fn read_file(path: &Path) -> Result<Vec<u8>, FormatError> {
    let io = |source| FormatError::Io { path: path.to_owned(), source };
    let wrong = |message: String| FormatError::Wrong { path: path.to_owned(), message };
    // Asked before it is opened: a pipe without a writer would be waited for.
    let metadata = fs::metadata(path).map_err(io)?;
    if !metadata.is_file() {
        let found = if metadata.is_dir() { "a folder" } else { "a device or a pipe" };
        return Err(wrong(format!("expected a file, found {found}")));
    }
    if metadata.len() > FILE_MAX {
        return Err(wrong(format!("expected at most {FILE_MAX} bytes, found {}", metadata.len())));
    }
    let mut bytes = Vec::new();
    File::open(path).and_then(|file| file.take(FILE_MAX).read_to_end(&mut bytes)).map_err(io)?;
    Ok(bytes)
}

/// Writes a file under a temporary name and renames it, so it is complete or does not exist.
///
/// # Errors
/// When the file system refuses; then nothing is left.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), FormatError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let partial = path.with_file_name(format!(".{name}.{}.partial", std::process::id()));
    let written = File::create(&partial).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    let written = written.and_then(|()| fs::rename(&partial, path));
    written.map_err(|source| {
        // The error at hand is more useful than one about the temporary file.
        let _ = fs::remove_file(&partial);
        FormatError::Io { path: path.to_owned(), source }
    })
}
