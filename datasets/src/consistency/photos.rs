//! A photo serves one view: two poses of one file are a mistake, and nothing says which of them is right.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use gs_base::counted;

use super::cameras::{same_pose, spread};
use crate::error::DatasetError;
use crate::raw::RawFrame;

/// Refuses frames of different poses that have one file. Frames of one pose are told apart by their times, or are one
/// frame listed twice.
pub(crate) fn one_view_a_photo(frames: &[RawFrame], scene: &Path) -> Result<(), DatasetError> {
    let spread = spread(frames);
    // One file may be written in several ways, and links lead to one.
    let file = |frame: &RawFrame| frame.image_path.canonicalize().unwrap_or_else(|_| frame.image_path.clone());
    let mut first: HashMap<PathBuf, &RawFrame> = HashMap::new();
    let mut pairs = Vec::new();
    for frame in frames {
        let earlier = *first.entry(file(frame)).or_insert(frame);
        if !same_pose(earlier, frame, spread) {
            pairs.push((earlier, frame));
        }
    }
    let Some((a, b)) = pairs.first() else { return Ok(()) };
    let file = a.image_path.strip_prefix(scene).unwrap_or(&a.image_path).display();
    let views =
        if a.name == b.name { format!("two views named {}", a.name) } else { format!("{} and {}", a.name, b.name) };
    let found =
        format!("{} whose photo has another pose already ({views} are both {file})", counted(pairs.len(), "view"));
    let expected = "a photo of its own for each view, in the folder that its name says";
    Err(DatasetError::malformed(scene, "photos", expected, found))
}
