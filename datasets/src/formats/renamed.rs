//! Photos that lie under other names than a description says: with another extension, in another folder, or with the
//! folder in the name. Programs that undistort, convert or copy photos leave the description as it was.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use gs_base::agree;

use super::masks::FOLDERS;
use super::unicode::{outline, same_but_for_form};
use crate::folder::{entries, file_name};
use crate::foreign::{CONVERT, Foreign, is_photo};
use crate::names::{some_names, with_slashes};

/// Folders below the images' own that are looked into. Deeper trees are not one data set.
const DEPTH_MAX: usize = 4;

/// Most files that are listed: a folder that somebody gave by mistake may be a whole disk.
const FILES_MAX: usize = 200_000;

/// The photos of a folder by what their names have in common with those of a description.
pub(super) struct Renamed {
    folder: PathBuf,
    /// By [`key`](keys); of several the first, and how many there are.
    photos: HashMap<String, (PathBuf, usize)>,
    /// Photos in containers that are not read, likewise.
    foreign: HashMap<String, (PathBuf, usize)>,
}

/// A photo that a name can mean.
pub(super) struct Found {
    pub path: PathBuf,
    /// The two names are in different Unicode forms.
    pub is_other_form: bool,
}

impl Renamed {
    /// Lists a folder.
    pub fn of(folder: &Path) -> Self {
        let mut found = Self { folder: folder.to_owned(), photos: HashMap::new(), foreign: HashMap::new() };
        let mut left = FILES_MAX;
        walk(folder, DEPTH_MAX, &mut left, &mut |path| {
            let Some(relative) = path.strip_prefix(folder).ok().and_then(Path::to_str) else { return };
            let map = if is_photo(path) { &mut found.photos } else { &mut found.foreign };
            let mut keys = [keys(relative).to_vec(), outlines(relative)].concat();
            keys.sort();
            keys.dedup();
            for key in keys {
                map.entry(key).or_insert_with(|| (path.to_owned(), 0)).1 += 1;
            }
        });
        found
    }

    /// The one photo that `written` can mean; `None` where there is none or more than one.
    pub fn find(&self, written: &str) -> Option<Found> {
        keys(written).iter().find_map(|key| self.only(key)).map(named).or_else(|| self.find_form(written))
    }

    /// The photo in the place that `written` names, with another extension or in another Unicode form.
    pub fn find_in_place(&self, written: &str) -> Option<Found> {
        let [whole, ..] = keys(written);
        self.only(&whole).map(named).or_else(|| self.find_form(written))
    }

    fn only(&self, key: &str) -> Option<PathBuf> {
        self.photos.get(key).filter(|(_, count)| *count == 1).map(|(path, _)| path.clone())
    }

    fn find_form(&self, written: &str) -> Option<Found> {
        let wanted = stem_of(&with_slashes(written).to_lowercase()).to_string();
        let path = outlines(written).iter().find_map(|key| self.only(key))?;
        let there = stem_of(&path.strip_prefix(&self.folder).ok()?.to_str()?.to_lowercase()).to_string();
        // By the whole path, or by the last part alone.
        let alike = same_but_for_form(&wanted, &there) || same_but_for_form(last_of(&wanted), last_of(&there));
        alike.then_some(Found { path, is_other_form: true })
    }

    /// Another place that has the first of these names, as `images_4` for `images` has; the end of a sentence.
    pub fn other_place(&self, missing: &[String]) -> String {
        let place = missing.iter().find_map(|name| Some((name, self.find(name)?.path)));
        place.map_or_else(String::new, |(name, path)| {
            format!("; {name} is there as {}: rename its folder, or change `file_path`", self.shown(&path))
        })
    }

    /// A path for a sentence: below the folder.
    pub fn shown<'a>(&self, path: &'a Path) -> std::borrow::Cow<'a, str> {
        path.strip_prefix(&self.folder).unwrap_or(path).to_string_lossy()
    }

    /// The photos of these names in containers that are not read, and names that several photos could have; the end of
    /// a sentence.
    pub fn hint(&self, missing: &[String]) -> String {
        let of_keys = |map: &HashMap<String, (PathBuf, usize)>, name: &str| {
            keys(name).iter().find_map(|key| map.get(key)).map(|(path, count)| (path.clone(), *count))
        };
        let foreign: Vec<PathBuf> =
            missing.iter().filter_map(|name| of_keys(&self.foreign, name)).map(|(path, _)| path).collect();
        let mut hint = String::new();
        if let Some(path) = foreign.first()
            && let Some(Foreign::Photo(kind)) = Foreign::of_extension(path)
        {
            let (count, are) = (foreign.len(), agree(foreign.len(), "is", "are"));
            hint = format!("; {count} of them {are} there as {kind} ({}): {CONVERT}", self.shown(path));
        }
        let several = |name: &String| of_keys(&self.photos, name).is_some_and(|(_, count)| count > 1);
        let several: Vec<&String> = missing.iter().filter(|name| several(name)).collect();
        if !several.is_empty() {
            let (count, are) = (several.len(), agree(several.len(), "is the name", "are names"));
            hint += &format!("; {count} of them {are} of more than one file there ({})", some_names(&several));
        }
        hint
    }
}

fn named(path: PathBuf) -> Found {
    Found { path, is_other_form: false }
}

/// The names that a photo may be known by, the surest first: its whole path without extension, the path in one word
/// (`left/a` and `left_a`), and the last part. Case is no difference.
fn keys(written: &str) -> [String; 3] {
    let path = with_slashes(written).trim_start_matches("./").to_lowercase();
    let stem = stem_of(&path);
    [format!("path {stem}"), format!("word {}", stem.replace('/', "_")), format!("last {}", last_of(stem))]
}

/// The outlines of a name that is not ASCII, whole and of its last part.
fn outlines(written: &str) -> Vec<String> {
    let path = with_slashes(written).trim_start_matches("./").to_lowercase();
    let stem = stem_of(&path);
    let last = last_of(stem);
    let parts = [("outline", stem), ("last outline", last)];
    parts.iter().filter(|(_, part)| !part.is_ascii()).map(|(kind, part)| format!("{kind} {}", outline(part))).collect()
}

fn stem_of(path: &str) -> &str {
    match path.rsplit_once('.') {
        Some((stem, extension)) if !extension.contains('/') => stem,
        _ => path,
    }
}

fn last_of(stem: &str) -> &str {
    stem.rsplit('/').next().unwrap_or(stem)
}

/// The photos below a folder that are read.
pub(super) fn photos_below(folder: &Path, with_folders: bool) -> Vec<PathBuf> {
    let (mut photos, mut left) = (Vec::new(), FILES_MAX);
    let depth = if with_folders { DEPTH_MAX } else { 0 };
    walk(folder, depth, &mut left, &mut |path| photos.extend(is_photo(path).then(|| path.to_owned())));
    photos
}

/// Lists photos, also those in containers that are not read.
fn walk(folder: &Path, depth: usize, left: &mut usize, list: &mut impl FnMut(&Path)) {
    for path in entries(folder) {
        if *left == 0 {
            return;
        }
        *left -= 1;
        let is_listed = is_photo(&path) || matches!(Foreign::of_extension(&path), Some(Foreign::Photo(_)));
        if is_listed && path.is_file() {
            list(&path);
        } else if depth > 0 && path.is_dir() && !holds_maps(&path) {
            walk(&path, depth - 1, left, list);
        }
    }
}

/// Folders of masks and maps hold images of the same names; they are no photos.
fn holds_maps(path: &Path) -> bool {
    let name = file_name(path).to_lowercase();
    ["depth", "depths", "normals"].contains(&name.as_str()) || FOLDERS.contains(&name.as_str())
}
