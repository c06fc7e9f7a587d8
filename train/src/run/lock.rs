//! One writer for a run folder.
//!
//! The operating system holds the lock for as long as the process lives, so that a lock left by a killed process is free.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::Path;

use anyhow::{Context, Result, bail};

/// The file that is locked; it holds the number of the process that writes the run.
pub const FILE: &str = ".lock";

/// Longest number of a process that is read back, bytes.
const NUMBER_MAX: u64 = 20;

/// A run folder that no other process may write.
#[derive(Debug)]
pub struct Lock {
    file: File,
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Closing is not enough: a program that another thread is just starting shares the open file, and with it the lock, until it runs.
        if let Err(error) = self.file.unlock() {
            tracing::debug!("a run's lock was not freed before its file was closed: {error}");
        }
    }
}

impl Lock {
    /// Takes the lock of an existing folder.
    ///
    /// # Errors
    /// A sentence that names the other process where one writes the folder, or the file that cannot be opened.
    pub fn take(folder: &Path) -> Result<Self> {
        let path = folder.join(FILE);
        let cannot = || format!("{}: cannot open", path.display());
        let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
        let mut file = options.with_context(cannot)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut number = String::new();
                // Without its number the sentence is still true.
                let _ = file.take(NUMBER_MAX).read_to_string(&mut number);
                let process = number.trim().parse::<u32>().map_or("another process".into(), |n| format!("process {n}"));
                bail!("{}: {process} is writing this run; wait for it, or choose another folder", folder.display());
            }
            Err(TryLockError::Error(error)) => {
                tracing::warn!("{}: this disk has no locks ({error}); nothing keeps a second run away", path.display());
            }
        }
        file.set_len(0).and_then(|()| file.rewind()).with_context(cannot)?;
        writeln!(file, "{}", std::process::id()).with_context(cannot)?;
        Ok(Self { file })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_writer_is_told_of_the_first() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = Lock::take(folder.path()).expect("free");
        let message = Lock::take(folder.path()).expect_err("taken").to_string();
        assert!(message.contains(&format!("process {}", std::process::id())), "{message}");
        drop(first);
        // The file stays, as a killed process leaves it, and is no obstacle.
        assert!(folder.path().join(FILE).is_file());
        Lock::take(folder.path()).expect("free again");
    }
}
