//! Writing files atomically, so that a reader never meets half a file.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::FileError;

/// Writes `bytes` to a temporary file beside `path`, then renames it over `path`: whoever opens `path` finds the old
/// file or the whole new one. Parent folders are made.
///
/// # Errors
/// When the folder or file cannot be written (a full disk, for one); the temporary file is then removed.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_atomic_with(path, |file| file.write_all(bytes))
}

/// [`write_atomic`] of what `content` writes.
///
/// # Errors
/// As [`write_atomic`].
pub fn write_atomic_with(path: &Path, content: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), FileError> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    fs::create_dir_all(folder).map_err(|error| FileError::write(folder, error))?;
    let partial = PartialFile::beside(path);
    let written =
        File::create(partial.temporary()).and_then(|mut file| content(&mut file)).and_then(|()| partial.finish());
    written.map_err(|error| FileError::write(path, error))
}

/// A file that is being written under a temporary name beside its own. Dropped before [`finish`](Self::finish), it is
/// removed.
#[derive(Debug)]
pub struct PartialFile {
    temporary: PathBuf,
    path: PathBuf,
}

impl PartialFile {
    /// The name of a file that will be `path`; nothing is made yet. No other thread or process uses the name.
    pub fn beside(path: &Path) -> Self {
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        let name = temporary_begin(path).unwrap_or_default();
        let unique = COUNTER.fetch_add(1, Ordering::Relaxed);
        let temporary = path.with_file_name(format!(".{name}.{}.{unique}.tmp", std::process::id()));
        Self::named(temporary, path)
    }

    /// A file that will be `path`, under a temporary name in the same folder that the caller knows to be free.
    pub fn named(temporary: PathBuf, path: &Path) -> Self {
        Self { temporary, path: path.to_path_buf() }
    }

    /// The temporary name.
    pub fn temporary(&self) -> &Path {
        &self.temporary
    }

    /// Gives the file its name, when all its bytes are on the disk.
    ///
    /// # Errors
    /// When the system refuses; then the file is removed, and `path` is as it was before.
    pub fn finish(self) -> io::Result<()> {
        // Opened for writing: elsewhere than on Unix a file that is only read cannot be synchronised.
        File::options().write(true).open(&self.temporary)?.sync_all()?;
        fs::rename(&self.temporary, &self.path)
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        // After a rename there is none. The failure before is the one to report; one here adds nothing to it.
        let _ = fs::remove_file(&self.temporary);
    }
}

/// The begin of a file's name with which the names of its half files begin, behind a dot. All of the name and the rest
/// may be longer than a name can be.
pub fn temporary_begin(path: &Path) -> Option<String> {
    const KEPT: usize = 32;
    path.file_name().map(|name| name.to_string_lossy().chars().take(KEPT).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("new/file.txt");
        write_atomic(&path, b"before").expect("written");
        let error = write_atomic_with(&path, |file| {
            file.write_all(b"half")?;
            Err(io::Error::other("the disk is full"))
        });
        assert!(error.expect_err("refused").to_string().contains("the disk is full"));
        assert_eq!(fs::read(&path).expect("read"), b"before");
        assert_eq!(fs::read_dir(folder.path().join("new")).expect("listed").count(), 1);
    }
}
