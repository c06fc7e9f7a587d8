//! One mistake of a whole data set is found in every frame: it is said once.

use std::collections::HashMap;

use gs_base::sentence::shown;
use gs_base::{FileError, printable};

use crate::error::DatasetError;
use crate::names::some_names;

/// An error without the name of what it is about.
pub struct Common {
    /// Equal for errors of one kind.
    pub kind: String,
    /// The sentence without the name.
    pub text: String,
    /// The name of the frame or file that it is about.
    pub name: String,
}

/// Sentences about errors in the order found; those of one kind, as `apart` tells them, are one sentence with the
/// text of the first, `times` of their count, and some names.
pub fn said_once(
    errors: &[DatasetError],
    apart: impl Fn(&DatasetError) -> Option<Common>,
    times: impl Fn(usize) -> String,
) -> Vec<String> {
    // The sentence of the first, what they have in common, and what each is about.
    let mut groups: Vec<(String, String, Vec<String>)> = Vec::new();
    let mut places: HashMap<String, usize> = HashMap::new();
    for error in errors {
        let Some(Common { kind, text, name }) = apart(error) else {
            groups.push((error.to_string(), String::new(), Vec::new()));
            continue;
        };
        let place = *places.entry(kind).or_insert(groups.len());
        if place == groups.len() {
            groups.push((error.to_string(), text, Vec::new()));
        }
        groups[place].2.push(name);
    }
    let said = |(whole, common, names): (String, String, Vec<String>)| match names.len() {
        0 | 1 => whole,
        count => format!("{common} ({}: {})", times(count), some_names(&names)),
    };
    groups.into_iter().map(said).map(|sentence| printable(&sentence).into_owned()).collect()
}

/// The errors in the order found; those that differ only in the frame or image they are about are one sentence.
pub(super) fn sentences(errors: &[DatasetError]) -> Vec<String> {
    let common = |error: &DatasetError| apart(error).map(|(text, name)| Common { kind: text.clone(), text, name });
    said_once(errors, common, |count| format!("{count} times"))
}

/// An error without the frame or image it is about, and that.
fn apart(error: &DatasetError) -> Option<(String, String)> {
    match error {
        DatasetError::File(error) => file_apart(error),
        DatasetError::Pose { path, frame, expected, found } => {
            Some((format!("{}: pose: expected {expected}, found {found}", shown(path)), frame.clone()))
        }
        DatasetError::SizeMismatch { path, declared_in, declared, actual, hint } => {
            let common = format!(
                "expected images of {} x {} pixels (or the same proportions) as {} declares, found {} x {}{hint}",
                declared.0,
                declared.1,
                shown(declared_in),
                actual.0,
                actual.1
            );
            Some((common, shown(path)))
        }
        DatasetError::MaskShape { path, photo, found } => {
            let common = format!(
                "expected masks of their photos' proportions, {} x {} pixels, found {} x {}",
                photo.0, photo.1, found.0, found.1
            );
            Some((common, shown(path)))
        }
        DatasetError::Image { path, found } => {
            Some((format!("expected readable PNG or JPEG images, found: {found}"), shown(path)))
        }
        DatasetError::Unsupported { path, what, expected } => {
            let (what, frame) = what.strip_suffix(')')?.rsplit_once(" (frame ")?;
            let common = format!("{}: {what} is not supported: expected {expected}", shown(path));
            Some((common, frame.trim_matches('"').to_string()))
        }
        _ => None,
    }
}

fn file_apart(error: &FileError) -> Option<(String, String)> {
    match error {
        FileError::Malformed { path, location, expected, found } => {
            let (name, place) = frame_of(location).or_else(|| numbered(location))?;
            let place = if place.is_empty() { "a frame" } else { place };
            Some((format!("{}: {place}: expected {expected}, found {found}", shown(path)), name))
        }
        FileError::Io { path, action, source } => Some((format!("cannot {action}: {source}"), shown(path))),
        FileError::Wrong { .. } => None,
        FileError::NotAFile { path, found } => Some((format!("expected files, found {found}"), shown(path))),
        FileError::TooLarge { path, limit, found } => {
            Some((format!("expected files of at most {limit}, found {found}"), shown(path)))
        }
    }
}

/// `frame "images/00.png", key `w`` -> the frame's name and the rest.
fn frame_of(location: &str) -> Option<(String, &str)> {
    let quoted = location.strip_prefix("frame \"")?;
    let (name, rest) = match quoted.split_once("\", ") {
        Some((name, rest)) => (name, rest),
        None => (quoted.strip_suffix('"')?, ""),
    };
    Some((name.to_string(), rest))
}

/// `line 12, column f` or `row 3` -> the line and the rest.
fn numbered(location: &str) -> Option<(String, &str)> {
    let (name, rest) = location.split_once(", ").unwrap_or((location, ""));
    let (word, number) = name.split_once(' ')?;
    let is_place = ["line", "row"].contains(&word) && number.bytes().all(|byte| byte.is_ascii_digit());
    is_place.then(|| (name.to_string(), if rest.is_empty() { word } else { rest }))
}
