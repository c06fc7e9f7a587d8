//! Which views train and which are held out.

use std::collections::HashSet;
use std::path::Path;

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
        Holdout::Dataset => every(frames, DEFAULT_HOLDOUT),
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
