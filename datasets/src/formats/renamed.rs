//! Photos that lie under other names than a description says: with another extension, in another folder, or with the folder in
//! the name. Programs that undistort, convert or copy photos leave the description as it was.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::foreign::is_photo;
use crate::names::with_slashes;

/// Folders below the images' own that are looked into. Deeper trees are not one data set.
const DEPTH_MAX: usize = 4;

/// Most files that are listed: a folder that somebody gave by mistake may be a whole disk.
const FILES_MAX: usize = 200_000;

/// The photos of a folder by what their names have in common with those of a description.
pub(crate) struct Renamed {
    folder: PathBuf,
    /// By [`key`]; of several the first, and how many there are.
    by_key: HashMap<String, (PathBuf, usize)>,
}

impl Renamed {
    /// Lists a folder.
    pub fn of(folder: &Path) -> Self {
        let mut by_key: HashMap<String, (PathBuf, usize)> = HashMap::new();
        let mut left = FILES_MAX;
        let mut list = |path: &Path| {
            let Some(relative) = path.strip_prefix(folder).ok().and_then(Path::to_str) else { return };
            let mut keys = keys(relative);
            keys.sort();
            keys.dedup();
            for key in keys {
                by_key.entry(key).or_insert_with(|| (path.to_owned(), 0)).1 += 1;
            }
        };
        walk(folder, DEPTH_MAX, &mut left, &mut list);
        Self { folder: folder.to_owned(), by_key }
    }

    /// The one photo that `written` can mean; `None` where there is none or more than one.
    pub fn find(&self, written: &str) -> Option<PathBuf> {
        let found = |key: &String| self.by_key.get(key).filter(|(_, count)| *count == 1).map(|(path, _)| path.clone());
        keys(written).iter().find_map(found)
    }

    /// A path for a sentence: below the folder.
    pub fn shown<'a>(&self, path: &'a Path) -> std::borrow::Cow<'a, str> {
        path.strip_prefix(&self.folder).unwrap_or(path).to_string_lossy()
    }
}

/// What a name may be known by, the surest first: its whole path without extension, the path in one word (`left/a` and `left_a`), and
/// the last part. Case is no difference.
fn keys(written: &str) -> Vec<String> {
    let path = with_slashes(written).to_lowercase();
    let stem = match path.rsplit_once('.') {
        Some((stem, extension)) if !extension.contains('/') => stem,
        _ => path.as_str(),
    };
    let last = stem.rsplit('/').next().unwrap_or(stem);
    vec![format!("path {stem}"), format!("word {}", stem.replace('/', "_")), format!("last {last}")]
}

fn walk(folder: &Path, depth: usize, left: &mut usize, list: &mut impl FnMut(&Path)) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    for path in paths {
        if *left == 0 {
            return;
        }
        *left -= 1;
        if is_photo(&path) && path.is_file() {
            list(&path);
        } else if depth > 0 && path.is_dir() && !is_hidden(&path) {
            walk(&path, depth - 1, left, list);
        }
    }
}

/// Folders of masks and maps hold images of the same names; they are no photos.
fn is_hidden(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    name.starts_with('.') || ["masks", "mask", "depth", "depths", "normals"].contains(&name.as_str())
}
