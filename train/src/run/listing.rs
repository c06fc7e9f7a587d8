//! The files of a folder of results, by which the next result knows them.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result, bail};
use gs_base::{guarded, write_atomic};
use serde::{Deserialize, Serialize};

use super::outputs::{MARK, check_one};

/// The list in a folder of results.
pub const FILE: &str = ".files.json";

/// Longest list, bytes: a file takes some 100, and a log has some thousand images.
const LISTING_MAX: u64 = 64 << 20;

/// Bytes that are read at once for a checksum.
const BLOCK: usize = 1 << 16;

/// Files with their length and checksum, so that one that somebody else has put in the place of ours is told from it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Listing {
    program: String,
    /// By path from the folder on.
    files: BTreeMap<PathBuf, Content>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Content {
    bytes: u64,
    crc32: u32,
}

impl Listing {
    /// All files below a folder but those called `without` in the folder itself.
    ///
    /// # Errors
    /// When one cannot be read.
    pub fn of(folder: &Path, without: &str) -> Result<Self> {
        let mut files = BTreeMap::new();
        let mut left = vec![PathBuf::new()];
        while let Some(below) = left.pop() {
            let path = folder.join(&below);
            let cannot = || format!("{}: cannot read the folder", path.display());
            for entry in fs::read_dir(&path).with_context(cannot)? {
                let name = below.join(entry.with_context(cannot)?.file_name());
                let path = folder.join(&name);
                if path.is_dir() {
                    left.push(name);
                } else if name != Path::new(without) {
                    let content = content(&path).with_context(|| format!("{}: cannot read", path.display()))?;
                    files.insert(name, content);
                }
            }
        }
        Ok(Self { program: MARK.into(), files })
    }

    /// The list of an earlier result; `None` where there is none of this program that names files inside the folder
    /// alone.
    pub fn read(folder: &Path) -> Option<Self> {
        let text = guarded::read_to_string(&folder.join(FILE), LISTING_MAX).ok()?;
        let listing: Self = serde_json::from_str(&text).ok()?;
        let is_inside = |path: &PathBuf| path.components().all(|part| matches!(part, Component::Normal(_)));
        (listing.program == MARK && listing.files.keys().all(is_inside)).then_some(listing)
    }

    /// Writes the list into a folder.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let text = serde_json::to_string(self).context("a file has a name that is not UTF-8")?;
        Ok(write_atomic(&folder.join(FILE), (text + "\n").as_bytes())?)
    }

    /// Checks that in `folder` no file of somebody else is in the way of these, where it holds an earlier result with a
    /// list. Before there were lists, a result's files without a mark cannot be told from others.
    ///
    /// # Errors
    /// A sentence with the first such file.
    pub fn check(&self, folder: &Path, before: Option<&Self>) -> Result<()> {
        let Some(before) = before else { return Ok(()) };
        let in_the_way = |name: &&PathBuf| {
            let path = folder.join(name);
            path.exists() && !before.is_whole(name, &path) && check_one(&path).is_err()
        };
        match self.files.keys().find(in_the_way) {
            Some(name) => bail!(
                "{}: expected no file, or one that gsburn wrote, found another; choose another --out",
                folder.join(name).display()
            ),
            None => Ok(()),
        }
    }

    /// Removes the files from `folder` that are still as they were written, the one called `first` before all others,
    /// and the folders that are empty then.
    ///
    /// # Errors
    /// When one cannot be removed.
    pub fn remove(&self, folder: &Path, first: &str) -> Result<()> {
        let is_first = |name: &&PathBuf| name.as_path() == Path::new(first);
        let all = self.files.keys();
        for name in all.clone().filter(is_first).chain(all.filter(|name| !is_first(name))) {
            let path = folder.join(name);
            if self.is_whole(name, &path) {
                fs::remove_file(&path).with_context(|| format!("{}: cannot remove", path.display()))?;
            }
            // A folder with files is left.
            name.ancestors().skip(1).filter(|name| *name != Path::new("")).for_each(|name| {
                let _ = fs::remove_dir(folder.join(name));
            });
        }
        Ok(())
    }

    fn is_whole(&self, name: &Path, path: &Path) -> bool {
        self.files.get(name).is_some_and(|listed| path.is_file() && content(path).is_ok_and(|found| found == *listed))
    }
}

fn content(path: &Path) -> std::io::Result<Content> {
    let (mut file, mut hasher, mut bytes) = (File::open(path)?, crc32fast::Hasher::new(), 0);
    let mut block = vec![0; BLOCK];
    loop {
        match file.read(&mut block)? {
            0 => return Ok(Content { bytes, crc32: hasher.finalize() }),
            count => {
                hasher.update(&block[..count]);
                bytes += count as u64;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_others_are_neither_removed_nor_written_over() {
        let temporary = tempfile::tempdir().expect("a folder");
        let (out, new) = (temporary.path().join("out"), temporary.path().join("new"));
        let write = |folder: &Path, name: &str, text: &str| {
            let path = folder.join(name);
            fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            fs::write(path, text).expect("written");
        };
        for name in ["a.npy", "images/b.npy", "images/c.npy", "deep/er/d.npy"] {
            write(&out, name, "ours");
        }
        let before = Listing::of(&out, "README.txt").expect("read");
        before.write(&out).expect("written");
        assert_eq!(Listing::read(&out).as_ref(), Some(&before));
        write(&out, "images/c.npy", "changed by the user");
        write(&out, "images/mine.txt", "of the user");
        write(&new, "images/b.npy", "of the next");
        write(&new, "README.txt", "a note");
        let next = Listing::of(&new, "README.txt").expect("read");
        next.check(&out, Some(&before)).expect("nothing in the way");
        write(&new, "images/c.npy", "of the next");
        let next = Listing::of(&new, "README.txt").expect("read");
        let said = next.check(&out, Some(&before)).expect_err("in the way").to_string();
        assert!(said.contains("c.npy") && said.contains("found another"), "{said}");
        before.remove(&out, "a.npy").expect("removed");
        let mut left: Vec<PathBuf> = Listing::of(&out, FILE).expect("read").files.into_keys().collect();
        left.sort();
        assert_eq!(left, ["images/c.npy", "images/mine.txt"].map(PathBuf::from));
        assert!(!out.join("deep").exists());
    }

    #[test]
    fn a_list_that_leads_out_of_its_folder_is_none() {
        let temporary = tempfile::tempdir().expect("a folder");
        for name in ["../a", "/etc/passwd", "x/../../a"] {
            let files = BTreeMap::from([(PathBuf::from(name), Content { bytes: 0, crc32: 0 })]);
            Listing { program: MARK.into(), files }.write(temporary.path()).expect("written");
            assert_eq!(Listing::read(temporary.path()), None, "{name}");
        }
    }
}
