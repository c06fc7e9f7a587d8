//! Paths as data sets write them, the view names made from them, and lists of names in messages.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use gs_base::sentence::is_steering;
use gs_base::{guarded, printable};

use crate::error::DatasetError;

/// Endings that are an image's extension rather than a part of its name.
const EXTENSIONS: [&str; 10] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "bmp", "exr", "hdr", "gif"];

/// Tried, in this order, where a data set leaves the extension out.
const TRIED: [&str; 11] = ["png", "jpg", "jpeg", "PNG", "JPG", "JPEG", "webp", "tif", "tiff", "exr", "hdr"];

/// The path with `/` for separators: data sets exported on Windows have backslashes.
pub(crate) fn with_slashes(written: &str) -> String {
    written.replace('\\', "/")
}

/// Whether `written` is a path of another machine or of another place, and not there: an absolute one of Linux, macOS
/// or Windows, or one that leaves its folder.
pub(crate) fn is_elsewhere(root: &Path, written: &str) -> bool {
    let path = with_slashes(written);
    let is_drive = path.as_bytes().get(1..3) == Some(b":/") && path.as_bytes()[0].is_ascii_alphabetic();
    (path.starts_with(['/', '~']) || path.starts_with("../") || is_drive) && find_image(root, written).is_none()
}

/// The path below `root` that the [path of another machine](is_elsewhere) ends with: its longest end with a file.
/// `None` for other paths, and without such a file.
pub(crate) fn moved_here(root: &Path, written: &str) -> Option<String> {
    if !is_elsewhere(root, written) {
        return None;
    }
    let path = with_slashes(written);
    let ends =
        path.match_indices('/').map(|(at, _)| &path[at + 1..]).filter(|end| !end.is_empty() && !end.starts_with('/'));
    ends.take(PARTS_MAX).find(|end| find_image(root, end).is_some()).map(str::to_string)
}

/// Most parts of a path that are looked at; a file system allows paths of some thousand bytes, and a description any.
const PARTS_MAX: usize = 64;

/// The file that `written` names relative to `root`, trying extensions if it has none. `None` if there is none. What is
/// there and is no file, a folder `a.png` or a pipe, is found too, to be refused when it is read.
pub(crate) fn find_image(root: &Path, written: &str) -> Option<PathBuf> {
    let path = root.join(with_slashes(written));
    if guarded::is_there(&path) || has_image_extension(written) && path.exists() {
        return Some(path);
    }
    if has_image_extension(written) { None } else { with_extension(&path, &TRIED) }
}

/// The first file that is there of `path` with each of the extensions appended.
pub(crate) fn with_extension(path: &Path, extensions: &[&str]) -> Option<PathBuf> {
    let appended = |extension: &&str| {
        let mut name = path.as_os_str().to_owned();
        name.push(".");
        name.push(extension);
        PathBuf::from(name)
    };
    extensions.iter().map(appended).find(|path| guarded::is_there(path))
}

fn has_image_extension(written: &str) -> bool {
    Path::new(written)
        .extension()
        .and_then(|extension| extension.to_str())
        .is_some_and(|extension| EXTENSIONS.contains(&extension.to_ascii_lowercase().as_str()))
}

/// A view's name from the path the data set writes: relative to `root`, without extension, and without `.`, `..`, drive
/// letters and characters that steer a terminal (`_` in place of each), since output files are named after it.
pub(crate) fn view_name(root: &Path, written: &str) -> String {
    let slashed = with_slashes(written);
    let relative = match Path::new(&slashed).strip_prefix(root) {
        Ok(relative) => relative.to_string_lossy().into_owned(),
        Err(_) => slashed,
    };
    let parts: Vec<&str> = relative
        .split('/')
        .filter(|part| !matches!(*part, "" | "." | "..") && !part.ends_with(':') && !part.contains('\0'))
        .collect();
    let joined = parts.join("/");
    let stem =
        if has_image_extension(&joined) { joined.rsplit_once('.').map_or("", |(stem, _)| stem) } else { &joined };
    if stem.is_empty() || stem.ends_with('/') {
        return "unnamed".to_string();
    }
    stem.chars().map(|c| if is_steering(c) { '_' } else { c }).collect()
}

/// Longest part of a view's name between slashes, bytes. File systems allow 255 (NAME_MAX of Linux, macOS and Windows),
/// and output files append to it: at most `_4294967295_depth_color.png`, 27 bytes, after the number that tells equal
/// names apart.
const PART_MAX: usize = 215;

/// The [`view_name`] of a frame that `file` describes, if output files can be named after it. It is asked for before
/// the image is looked for: one of a longer name cannot exist, and would be counted among those that are missing.
pub(crate) fn output_name(root: &Path, written: &str, file: &Path) -> Result<String, DatasetError> {
    let name = view_name(root, written);
    let Some(long) = name.split('/').find(|part| part.len() > PART_MAX) else { return Ok(name) };
    let start: String = long.chars().take(40).collect();
    let expected =
        format!("a name of at most {PART_MAX} bytes between slashes, since rendered images are named after it");
    Err(DatasetError::malformed(file, format!("frame {:?}", start + "..."), expected, format!("{} bytes", long.len())))
}

/// A path below `root` as text, which names are. Other bytes are refused: names with the same text instead of them
/// would be one.
pub(crate) fn text_below<'a>(root: &Path, path: &'a Path) -> Result<&'a str, DatasetError> {
    path.strip_prefix(root).unwrap_or(path).to_str().ok_or_else(|| {
        DatasetError::malformed(
            path,
            "its name",
            "a file name in UTF-8",
            "other bytes; please rename the file or folder",
        )
    })
}

/// Makes names unique by appending `_2`, `_3`, ... to later ones.
pub(crate) fn make_unique<'a>(names: impl Iterator<Item = &'a mut String>) {
    // The number to try next: thousands of frames may show one photo at different times.
    let mut seen: HashMap<String, u64> = HashMap::new();
    for name in names {
        let Some(&next) = seen.get(name.as_str()) else {
            seen.insert(name.clone(), 2);
            continue;
        };
        let free = (next..).map(|n| (n, format!("{name}_{n}"))).find(|(_, candidate)| !seen.contains_key(candidate));
        if let Some((n, free)) = free {
            seen.insert(std::mem::replace(name, free.clone()), n + 1);
            seen.insert(free, 2);
        }
    }
}

/// "a, b, c, ...": at most three names, [`printable`], for sentences about many.
pub fn some_names<S: AsRef<str>>(names: &[S]) -> String {
    let shown: Vec<Cow<str>> = names.iter().take(3).map(|name| printable(name.as_ref())).collect();
    let more = if names.len() > shown.len() { ", ..." } else { "" };
    format!("{}{more}", shown.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_relative_and_cannot_leave_a_folder() {
        let root = Path::new("/data/scene");
        assert_eq!(view_name(root, "./train/r_000"), "train/r_000");
        assert_eq!(view_name(root, "images\\a b.JPG"), "images/a b");
        assert_eq!(view_name(root, "/data/scene/images/1.png"), "images/1");
        assert_eq!(view_name(root, "../../etc/passwd"), "etc/passwd");
        assert_eq!(view_name(root, "C:\\photos\\v1.5"), "photos/v1.5");
        assert_eq!(view_name(root, ".."), "unnamed");
        assert_eq!(view_name(root, "images/.png"), "images/.png");
    }

    #[test]
    fn equal_names_get_numbers() {
        let mut names = ["a".to_string(), "a_2".to_string(), "a".to_string(), "a".to_string()];
        make_unique(names.iter_mut());
        assert_eq!(names, ["a", "a_2", "a_3", "a_4"]);
    }
}
