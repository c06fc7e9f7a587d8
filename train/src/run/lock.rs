//! One writer for a folder.
//!
//! The operating system holds the lock for as long as the process lives, so that a lock left by a killed process is
//! free.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

/// The file that is locked; it holds the number of the process that writes the folder.
pub const FILE: &str = ".lock";

/// Longest number of a process that is read back, bytes.
const NUMBER_MAX: u64 = 20;

/// Tries to lock a file that another process removes at the same time, each time a new one.
const TRIES: usize = 10;

/// A folder that no other process may write.
#[derive(Debug)]
pub struct Lock {
    file: File,
    /// The file, where it goes with the lock, and the folder, where it was made for the lock and is still empty then.
    passing: Option<(PathBuf, bool)>,
}

impl Drop for Lock {
    fn drop(&mut self) {
        if let Some((path, made)) = &self.passing {
            // What cannot be removed is in nobody's way: an unlocked file is taken by the next command.
            let _ = fs::remove_file(path);
            if let Some(folder) = path.parent().filter(|_| *made) {
                let _ = fs::remove_dir(folder);
            }
        }
        // Closing is not enough: a program that another thread is just starting shares the open file, and with it the
        // lock, until it runs.
        if let Err(error) = self.file.unlock() {
            tracing::debug!("a folder's lock was not freed before its file was closed: {error}");
        }
    }
}

impl Lock {
    /// Takes the lock of an existing run folder, whose file stays there.
    ///
    /// # Errors
    /// A sentence that names the other process where one writes the folder, or the file that cannot be opened.
    pub fn take(folder: &Path) -> Result<Self> {
        Ok(Self { file: locked(folder)?, passing: None })
    }

    /// Takes the lock of a folder of results, which is made where it does not exist. The file is removed with the lock,
    /// and a folder that was made and is empty again too.
    ///
    /// # Errors
    /// As [`take`](Self::take), and when the folder cannot be made.
    pub fn of_results(folder: &Path) -> Result<Self> {
        let made = !folder.exists();
        fs::create_dir_all(folder).with_context(|| format!("{}: cannot make the folder", folder.display()))?;
        Ok(Self { file: locked(folder)?, passing: Some((folder.join(FILE), made)) })
    }

    /// The lock of a folder of results that has the file of a lock: another process writes it, or was killed.
    ///
    /// # Errors
    /// As [`take`](Self::take).
    pub fn of_begun(folder: &Path) -> Result<Option<Self>> {
        is_lock(&folder.join(FILE)).then(|| Self::of_results(folder)).transpose()
    }
}

/// Whether a file is one that is locked here: the number of a process, or nothing yet.
pub fn is_lock(path: &Path) -> bool {
    let mut text = String::new();
    let read =
        path.is_file() && File::open(path).and_then(|file| file.take(NUMBER_MAX).read_to_string(&mut text)).is_ok();
    read && path.ends_with(FILE) && text.trim().chars().all(|c| c.is_ascii_digit())
}

/// The file of a folder's lock, locked.
fn locked(folder: &Path) -> Result<File> {
    let path = folder.join(FILE);
    for _ in 0..TRIES {
        let file = locked_once(folder, &path)?;
        if is_at(&file, &path) {
            return Ok(file);
        }
    }
    bail!("{}: other processes begin and end here all the time; choose another folder", folder.display())
}

fn locked_once(folder: &Path, path: &Path) -> Result<File> {
    let cannot = || format!("{}: cannot open", path.display());
    let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
    let mut file = options.with_context(cannot)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let mut number = String::new();
            // Without its number the sentence is still true.
            let _ = file.take(NUMBER_MAX).read_to_string(&mut number);
            let process = number.trim().parse::<u32>().map_or("another process".into(), |n| format!("process {n}"));
            bail!("{}: {process} is writing this folder; wait for it, or choose another one", folder.display());
        }
        Err(TryLockError::Error(error)) => {
            tracing::warn!("{}: this disk has no locks ({error}); nothing keeps a second writer away", path.display());
        }
    }
    file.set_len(0).and_then(|()| file.rewind()).with_context(cannot)?;
    writeln!(file, "{}", std::process::id()).with_context(cannot)?;
    Ok(file)
}

/// Whether an open file is still the one at a path: the process that had the lock before may have removed it in
/// between.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let place = |data: fs::Metadata| (data.dev(), data.ino());
    file.metadata().map(place).ok().zip(fs::metadata(path).map(place).ok()).is_some_and(|(open, there)| open == there)
}

/// A file that is open cannot be removed here.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
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

    #[test]
    fn a_lock_of_results_leaves_nothing() {
        let temporary = tempfile::tempdir().expect("a folder");
        let out = temporary.path().join("out");
        let first = Lock::of_results(&out).expect("free");
        assert!(Lock::of_results(&out).is_err() && Lock::of_begun(&out).is_err());
        drop(first);
        assert!(!out.exists());
        // A killed process leaves the file; results, and a folder that was there before, stay.
        fs::create_dir(&out).expect("made");
        assert!(Lock::of_begun(&out).expect("nothing").is_none());
        drop(Lock::take(&out).expect("free"));
        drop(Lock::of_begun(&out).expect("free").expect("begun"));
        assert!(out.is_dir() && !out.join(FILE).exists());
        // The file of another program is not written over.
        fs::write(out.join(FILE), "held by a package manager").expect("written");
        assert!(Lock::of_begun(&out).expect("not ours").is_none());
    }
}
