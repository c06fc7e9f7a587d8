//! A folder of results that appears whole, and has one writer.
//!
//! Files are made in a folder inside it and moved up at the end. An interrupted command so leaves nothing that looks
//! finished, and the same command again takes its folder as it was before. The files of an earlier result go when
//! another one takes their place; files of others stay.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use gs_base::write_atomic;

use super::listing::Listing;
use super::lock::{self, Lock};
use super::outputs::{MARK, check_one};

/// Where files are until all are there.
const UNFINISHED: &str = "unfinished";
/// Says what [`UNFINISHED`] is; by it an interrupted command is known.
const NOTE: &str = "README.txt";

/// A folder whose results are being made.
#[derive(Debug)]
pub struct Results {
    out: PathBuf,
    /// The file by which a finished folder is known.
    summary: &'static str,
    /// Dropped after everything that [`Drop`] removes.
    _lock: Lock,
}

impl Results {
    /// Begins results in `out`, which is made. `summary` is the file that is moved last and by which an earlier result
    /// of the same command is known; it has the mark of [`outputs`](super::outputs).
    ///
    /// # Errors
    /// One sentence when `out` is a file, has files of somebody else, is being written by another process, or cannot be
    /// written. Nothing was written then.
    pub fn begin(out: &Path, summary: &'static str) -> Result<Self> {
        // First, because the files of another process look like those of somebody else.
        let begun = Lock::of_begun(out)?;
        vacant(out, summary)?;
        let lock = begun.map_or_else(|| Lock::of_results(out), Ok)?;
        let results = Self { out: out.to_path_buf(), summary, _lock: lock };
        let folder = results.folder();
        if folder.exists() {
            fs::remove_dir_all(&folder).with_context(|| format!("{}: cannot remove the folder", folder.display()))?;
        }
        fs::create_dir_all(&folder).with_context(|| format!("{}: cannot make the folder", folder.display()))?;
        let note = format!(
            "{MARK}\nThese results are not complete. The same command makes them anew; the folder may be removed.\n"
        );
        write_atomic(&folder.join(NOTE), note.as_bytes())?;
        Ok(results)
    }

    /// The folder for all files, the summary included, until [`finish`](Self::finish).
    pub fn folder(&self) -> PathBuf {
        Self::unfinished(&self.out)
    }

    /// The [`folder`](Self::folder) of results in `out`.
    pub fn unfinished(out: &Path) -> PathBuf {
        out.join(UNFINISHED)
    }

    /// Moves the files to their place, the summary last; the files of an earlier result are removed before.
    ///
    /// # Errors
    /// One sentence when a file of somebody else is in the way, or one cannot be moved; what was moved stays.
    pub fn finish(self) -> Result<()> {
        let folder = self.folder();
        let (before, new) = (Listing::read(&self.out), Listing::of(&folder, NOTE)?);
        new.check(&self.out, before.as_ref())?;
        if let Some(before) = before {
            before.remove(&self.out, self.summary)?;
        }
        // Before any file, so that those of a command that is killed from here on are known.
        new.write(&self.out)?;
        let late = |path: &PathBuf| path.file_name().is_some_and(|name| name == NOTE || name == self.summary);
        for entry in entries(&folder)?.into_iter().filter(|path| !late(path)) {
            moved(&entry, &self.out)?;
        }
        moved(&folder.join(self.summary), &self.out)?;
        fs::remove_dir_all(&folder).with_context(|| format!("{}: cannot remove the folder", folder.display()))
    }
}

impl Drop for Results {
    /// A command that failed before its first file leaves nothing.
    fn drop(&mut self) {
        let folder = self.folder();
        if entries(&folder).is_ok_and(|paths| paths == [folder.join(NOTE)]) {
            // What cannot be removed is in nobody's way: the next command takes it for its own.
            let _ = fs::remove_dir_all(&folder);
        }
    }
}

/// Checks that nothing of the user is written over.
fn vacant(out: &Path, summary: &str) -> Result<()> {
    if out.exists() && !out.is_dir() {
        bail!("{}: expected a folder or nothing, found a file", out.display());
    }
    let is_ours = |path: &Path| path.is_file() && check_one(path).is_ok();
    let unfinished = out.join(UNFINISHED);
    let is_left = is_ours(&unfinished.join(NOTE)) || is_empty(&unfinished);
    let is_foreign = unfinished.exists() && !is_left;
    if is_foreign || out.exists() && !is_empty(out) && !is_left && !is_ours(&out.join(summary)) {
        bail!(
            "{}: expected an empty folder, none, or an earlier result of this command; choose another --out",
            out.display()
        );
    }
    Ok(())
}

/// Whether a folder holds nothing but perhaps a lock; false where there is none.
pub fn is_empty(folder: &Path) -> bool {
    entries(folder).is_ok_and(|paths| paths.iter().all(|path| lock::is_lock(path)))
}

/// Checks that a folder holds nothing but a lock and paths that are `is_own`.
///
/// # Errors
/// A sentence with a name of something else.
pub fn check_own(folder: &Path, is_own: impl Fn(&Path) -> bool) -> Result<()> {
    if folder.exists() && !folder.is_dir() {
        bail!("{}: expected a folder or nothing, found a file", folder.display());
    }
    let present = if folder.is_dir() { entries(folder)? } else { Vec::new() };
    match present.into_iter().filter(|path| !lock::is_lock(path) && !is_own(path)).min() {
        None => Ok(()),
        Some(path) => bail!(
            "{}: expected an empty folder, none, or an earlier result of this command, found {:?} in it; choose another --out",
            folder.display(),
            path.file_name().unwrap_or_default()
        ),
    }
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let read = || -> std::io::Result<Vec<PathBuf>> {
        fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path())).collect()
    };
    read().with_context(|| format!("{}: cannot read the folder", folder.display()))
}

/// Moves a file or folder into `folder`; folders of the same name become one.
fn moved(from: &Path, folder: &Path) -> Result<()> {
    let to = folder.join(from.file_name().unwrap_or_default());
    if from.is_dir() {
        fs::create_dir_all(&to).with_context(|| format!("{}: cannot make the folder", to.display()))?;
        return entries(from)?.iter().try_for_each(|entry| moved(entry, &to));
    }
    fs::rename(from, &to).with_context(|| format!("{}: cannot move it to {}", from.display(), to.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::listing;

    const SUMMARY: &str = "summary.json";

    fn write(path: PathBuf, text: &str) {
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(path, text).expect("written");
    }

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = entries(folder)
            .expect("a folder")
            .iter()
            .map(|path| path.file_name().expect("a name").to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn results_appear_whole() {
        let temporary = tempfile::tempdir().expect("a folder");
        let out = temporary.path().join("out");
        // Interrupted in the middle: nothing is in place, and the next command begins anew.
        let first = Results::begin(&out, SUMMARY).expect("vacant");
        write(first.folder().join("images/a.png"), "of the first");
        drop(first);
        assert_eq!(names(&out), [UNFINISHED]);
        let second = Results::begin(&out, SUMMARY).expect("of this command");
        write(second.folder().join("images/b.png"), "of the second");
        write(second.folder().join(SUMMARY), MARK);
        second.finish().expect("moved");
        assert_eq!(
            (names(&out), names(&out.join("images"))),
            (vec![listing::FILE.into(), "images".into(), SUMMARY.into()], vec!["b.png".into()])
        );
        // Interrupted while files were moved over an earlier result.
        let third = Results::begin(&out, SUMMARY).expect("an earlier result");
        write(third.folder().join("images/b.png"), "of the third");
        moved(&third.folder().join("images"), &out).expect("moved");
        fs::remove_file(out.join(SUMMARY)).expect("removed");
        drop(third);
        Results::begin(&out, SUMMARY).expect("of this command");
        assert_eq!(fs::read_to_string(out.join("images/b.png")).expect("text"), "of the third");
    }

    #[test]
    fn an_earlier_result_goes_and_files_of_others_stay() {
        let temporary = tempfile::tempdir().expect("a folder");
        let out = temporary.path().join("out");
        let made = |name: &str| {
            let results = Results::begin(&out, SUMMARY).expect("vacant");
            write(results.folder().join("images").join(name), name);
            write(results.folder().join(SUMMARY), MARK);
            results.finish().expect("moved");
        };
        made("a.npy");
        write(out.join("images/mine.txt"), "mine");
        made("b.npy");
        assert_eq!(names(&out.join("images")), ["b.npy", "mine.txt"]);
    }

    #[test]
    fn one_folder_has_one_writer() {
        let temporary = tempfile::tempdir().expect("a folder");
        let out = temporary.path().join("out");
        let first = Results::begin(&out, SUMMARY).expect("vacant");
        let said = Results::begin(&out, SUMMARY).expect_err("taken").to_string();
        assert!(said.contains(&format!("process {} is writing this folder", std::process::id())), "{said}");
        drop(first);
        Results::begin(&out, SUMMARY).expect("free again");
        // A killed process leaves the file of its lock.
        std::fs::create_dir_all(&out).expect("made");
        write(out.join(lock::FILE), "123456789\n");
        Results::begin(&out, SUMMARY).expect("free");
    }

    #[test]
    fn folders_of_others_are_refused() {
        let temporary = tempfile::tempdir().expect("a folder");
        let refused =
            |name: &str| Results::begin(&temporary.path().join(name), SUMMARY).expect_err("refused").to_string();
        write(temporary.path().join("mine/a.txt"), "mine");
        assert!(refused("mine").contains("expected an empty folder"));
        assert_eq!(names(&temporary.path().join("mine")), ["a.txt"]);
        write(temporary.path().join("named").join(UNFINISHED).join("a.txt"), "mine");
        assert!(refused("named").contains("expected an empty folder"));
        write(temporary.path().join("file"), "mine");
        assert!(refused("file").contains("found a file"));
        // A command that fails at once leaves nothing.
        drop(Results::begin(&temporary.path().join("new"), SUMMARY).expect("vacant"));
        assert!(!temporary.path().join("new").exists());
    }
}
