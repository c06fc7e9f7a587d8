//! A folder of results that appears whole.
//!
//! Files are made in a folder inside it and moved up at the end. An interrupted command so leaves nothing that looks finished, and the
//! same command again takes its folder as it was before.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use gs_datasets::image_io::write_atomic;

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
}

impl Results {
    /// Begins results in `out`, which is made. `summary` is the file that is moved last and by which an earlier result of the same
    /// command is known; it has the mark of [`outputs`](super::outputs).
    ///
    /// # Errors
    /// One sentence when `out` is a file or has files of somebody else, or cannot be written. Nothing was written then.
    pub fn begin(out: &Path, summary: &'static str) -> Result<Self> {
        vacant(out, summary)?;
        let results = Self { out: out.to_path_buf(), summary };
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
        self.out.join(UNFINISHED)
    }

    /// Moves the files to their place, over those of an earlier result, the summary last.
    ///
    /// # Errors
    /// One sentence when a file cannot be moved; what was moved stays.
    pub fn finish(self) -> Result<()> {
        let folder = self.folder();
        let late = |name: &std::ffi::OsStr| name == NOTE || name == self.summary;
        for entry in entries(&folder)?.into_iter().filter(|path| !path.file_name().is_some_and(late)) {
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
            let _ = fs::remove_dir(&self.out);
        }
    }
}

/// That nothing of the user is written over.
fn vacant(out: &Path, summary: &str) -> Result<()> {
    if out.exists() && !out.is_dir() {
        bail!("{}: expected a folder or nothing, found a file", out.display());
    }
    let is_ours = |path: &Path| path.is_file() && check_one(path).is_ok();
    let has_entry = |folder: &Path| fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    let unfinished = out.join(UNFINISHED);
    let is_left = is_ours(&unfinished.join(NOTE)) || unfinished.is_dir() && !has_entry(&unfinished);
    let is_foreign = unfinished.exists() && !is_left;
    if is_foreign || has_entry(out) && !is_left && !is_ours(&out.join(summary)) {
        bail!(
            "{}: expected an empty folder, none, or an earlier result of this command; choose another --out",
            out.display()
        );
    }
    Ok(())
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
            (vec!["images".into(), SUMMARY.into()], vec!["b.png".into()])
        );
        // Interrupted while files were moved over an earlier result.
        let third = Results::begin(&out, SUMMARY).expect("an earlier result");
        write(third.folder().join("images/b.png"), "of the third");
        moved(&third.folder().join("images"), &out).expect("moved");
        fs::remove_file(out.join(SUMMARY)).expect("removed");
        std::mem::forget(third);
        Results::begin(&out, SUMMARY).expect("of this command");
        assert_eq!(fs::read_to_string(out.join("images/b.png")).expect("text"), "of the third");
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
