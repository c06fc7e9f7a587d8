//! Which views train and which are held out.

use std::collections::{BTreeSet, HashSet};
use std::path::Path;

use crate::consistency;
use crate::error::DatasetError;
use crate::options::{DEFAULT_HOLDOUT, Holdout};
use crate::raw::{Part, RawFrame};

/// Frames by purpose, each in the order given.
pub(crate) struct Split {
    pub train: Vec<RawFrame>,
    pub test: Vec<RawFrame>,
    /// How the split was made, in words.
    pub rule: String,
}

/// Splits frames that are sorted by name.
pub(crate) fn split(frames: Vec<RawFrame>, holdout: &Holdout, scene: &Path) -> Result<Split, DatasetError> {
    let bad = |expected: &str, found: String| DatasetError::Option {
        path: scene.to_path_buf(),
        option: "holdout",
        expected: expected.to_string(),
        found,
    };
    let split = match holdout {
        Holdout::None => Split { train: frames, test: Vec::new(), rule: "all views train".to_string() },
        Holdout::Every(0) => return Err(bad("every n-th view with n of at least 1", "0".to_string())),
        Holdout::Every(n) => every(frames, *n),
        Holdout::Dataset if frames.iter().any(|frame| frame.part.is_some()) => own(frames),
        Holdout::Dataset => match held_out_cameras(&frames) {
            Some(cameras) => without_cameras(frames, &cameras),
            None => every(frames, DEFAULT_HOLDOUT),
        },
        Holdout::Names(names) => {
            for name in names {
                if !frames.iter().any(|frame| is_named(frame, name)) {
                    return Err(bad("names of views in the scene", format!("{name:?}, which no view has")));
                }
            }
            let rule = format!("{} views held out by name", names.len());
            let (test, train) = frames.into_iter().partition(|frame| names.iter().any(|name| is_named(frame, name)));
            Split { train, test, rule }
        }
    };
    if split.train.is_empty() {
        return Err(DatasetError::NoTrainingViews {
            path: scene.to_path_buf(),
            found: format!("{} held-out views ({})", split.test.len(), split.rule),
        });
    }
    Ok(split)
}

fn every(frames: Vec<RawFrame>, n: usize) -> Split {
    let mut split = Split { train: Vec::new(), test: Vec::new(), rule: format!("one in {n} held out, by name") };
    for (index, frame) in frames.into_iter().enumerate() {
        if index % n == 0 { split.test.push(frame) } else { split.train.push(frame) }
    }
    split
}

/// Fewest cameras of which one can be spared.
const CAMERAS_MIN: usize = 3;

/// Whether the camera at `index` of `count`, in their order, is held out: one in [`DEFAULT_HOLDOUT`], the first of them inside the
/// row, since from its ends there is nothing to look at from both sides.
pub(crate) fn is_held_out(index: usize, count: usize) -> bool {
    count >= CAMERAS_MIN && index % DEFAULT_HOLDOUT == (DEFAULT_HOLDOUT / 2).min(count / 2)
}

/// Of video from several standing cameras whole cameras are held out: a frame of a camera that trains is seen a moment before and
/// after. `None` of any other set.
fn held_out_cameras(frames: &[RawFrame]) -> Option<Vec<String>> {
    let (several, still) = consistency::standing(frames)?;
    // By length first: "2" before "10".
    let names: BTreeSet<(usize, &str)> =
        frames.iter().filter_map(|frame| frame.camera_id.as_deref()).map(|id| (id.len(), id)).collect();
    if several != names.len() || still != several || frames.iter().any(|frame| frame.camera_id.is_none()) {
        return None;
    }
    let count = names.len();
    let held = names.into_iter().enumerate().filter(|(index, _)| is_held_out(*index, count));
    let held: Vec<String> = held.map(|(_, (_, id))| id.to_string()).collect();
    (!held.is_empty()).then_some(held)
}

fn without_cameras(frames: Vec<RawFrame>, held: &[String]) -> Split {
    let rule = format!("all frames of camera {} held out", held.join(", "));
    let is_held = |frame: &RawFrame| frame.camera_id.as_ref().is_some_and(|id| held.contains(id));
    let (test, train) = frames.into_iter().partition(is_held);
    Split { train, test, rule }
}

/// The data set's own split. Validation views stand in where there are no test views and are left out otherwise:
/// training on them would make numbers incomparable with everyone else's.
fn own(frames: Vec<RawFrame>) -> Split {
    let parts: HashSet<Part> = frames.iter().filter_map(|frame| frame.part).collect();
    let held = if parts.contains(&Part::Test) { Part::Test } else { Part::Val };
    let unused = frames.iter().filter(|frame| frame.part == Some(Part::Val)).count();
    let rule = match held {
        Part::Test if unused > 0 => format!("the data set's own test views, {unused} validation views left out"),
        Part::Test => "the data set's own test views".to_string(),
        _ => "the data set's own validation views".to_string(),
    };
    let mut split = Split { train: Vec::new(), test: Vec::new(), rule };
    for frame in frames {
        match frame.part {
            Some(Part::Train) | None => split.train.push(frame),
            Some(part) if part == held => split.test.push(frame),
            Some(_) => {}
        }
    }
    split
}

fn is_named(frame: &RawFrame, name: &str) -> bool {
    frame.name == name || frame.name.rsplit('/').next() == Some(name)
}
