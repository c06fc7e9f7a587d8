//! The frames that train, those that are held out, and under which name.

mod sparse_views;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use gs_base::counted;

use crate::consistency;
use crate::error::DatasetError;
use crate::options::{DEFAULT_HOLDOUT, Holdout, LoadOptions, SplitUse};
use crate::raw::{RawFrame, SplitName};
use crate::scene::{self, Split};

pub(crate) use self::sparse_views::hidden_points;
pub use self::sparse_views::{ViewKind, view_kind};

/// Frames by purpose, as indices in the order given.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SplitPlan {
    /// Never empty. All lists rise.
    pub train: Vec<usize>,
    /// Lists of held-out frames with their names. None of them is empty, and no frame is in two.
    pub held_out: Vec<(String, Vec<usize>)>,
    /// How the split was made, in words.
    pub rule: String,
}

impl SplitPlan {
    fn of(train: Vec<usize>, test: Vec<usize>, rule: String) -> Self {
        let held_out = if test.is_empty() { Vec::new() } else { vec![(Split::TEST.to_string(), test)] };
        Self { train, held_out, rule }
    }

    /// The indices of all held-out frames, list by list.
    pub fn held_out_frames(&self) -> impl Iterator<Item = usize> {
        self.held_out.iter().flat_map(|(_, list)| list.iter().copied())
    }

    /// Whether the frame at `index` trains; `None` where it is left out.
    pub fn trains(&self, index: usize) -> Option<bool> {
        let is_listed = |list: &[usize]| list.binary_search(&index).is_ok();
        if is_listed(&self.train) {
            return Some(true);
        }
        self.held_out.iter().any(|(_, list)| is_listed(list)).then_some(false)
    }

    fn keep_reported(&mut self) {
        let kept = scene::reported(self.held_out.iter().map(|(name, _)| name.as_str()));
        let mut index = 0;
        self.held_out.retain(|(name, list)| {
            let is_kept = Some(index) == kept;
            index += 1;
            if !is_kept {
                self.rule = format!("{}; {} left out", self.rule, counted(list.len(), &format!("{name} view")));
            }
            is_kept
        });
    }
}

/// "3 test, 4 validation", of names of splits and their numbers of views; "none" without any.
pub(crate) fn counts<'a>(splits: impl Iterator<Item = (&'a str, usize)>) -> String {
    let counts: Vec<String> = splits.map(|(name, count)| format!("{count} {name}")).collect();
    if counts.is_empty() { "none".to_string() } else { counts.join(", ") }
}

/// Splits frames that are sorted by name. They are photos: all views of one are in one split.
pub(crate) fn plan(frames: &[RawFrame], options: &LoadOptions, scene: &Path) -> Result<SplitPlan, DatasetError> {
    let mut plan = match &options.sparse {
        Some(sparse) => sparse_views::plan(frames, sparse, scene)?,
        None => by_holdout(frames, &options.holdout, scene)?,
    };
    if plan.train.is_empty() {
        return Err(DatasetError::NoTrainingViews {
            path: scene.to_path_buf(),
            found: format!(
                "{} ({}); to train on all views: --set data.holdout=none",
                counted(plan.held_out_frames().count(), "held-out view"),
                plan.rule
            ),
        });
    }
    if options.splits == SplitUse::Reported {
        plan.keep_reported();
    }
    Ok(plan)
}

fn by_holdout(frames: &[RawFrame], holdout: &Holdout, scene: &Path) -> Result<SplitPlan, DatasetError> {
    let bad = |expected: &str, found: String| DatasetError::Option {
        path: scene.to_path_buf(),
        option: "holdout",
        expected: expected.to_string(),
        found,
    };
    Ok(match holdout {
        Holdout::None => SplitPlan::of((0..frames.len()).collect(), Vec::new(), "all views train".to_string()),
        Holdout::Every(0) => return Err(bad("every n-th view with n of at least 1", "0".to_string())),
        Holdout::Every(n) => every(frames, *n, "data.holdout_every"),
        Holdout::Dataset if frames.iter().any(|frame| frame.split.is_some()) => own(frames),
        Holdout::Dataset => match held_out_cameras(frames) {
            Some(cameras) => without_cameras(frames, &cameras),
            None => every(frames, DEFAULT_HOLDOUT, "data.holdout"),
        },
        Holdout::Names(names) => {
            for name in names {
                if !frames.iter().any(|frame| is_named(frame, name)) {
                    return Err(bad("names of views in the scene", format!("{name:?}, which no view has")));
                }
            }
            let is_held = |index: &usize| names.iter().any(|name| is_named(&frames[*index], name));
            let (test, train) = (0..frames.len()).partition(is_held);
            SplitPlan::of(train, test, format!("{} held out by name", counted(names.len(), "view")))
        }
    })
}

/// Every `n`-th frame by name is held out; `key` says otherwise.
fn every(frames: &[RawFrame], n: usize, key: &str) -> SplitPlan {
    let (test, train) = (0..frames.len()).partition(|index| index % n == 0);
    SplitPlan::of(train, test, format!("one in {n} held out, by name ({key})"))
}

/// Fewest cameras of which one can be spared.
const CAMERAS_MIN: usize = 3;

/// Whether the camera at `index` of `count`, in their order, is held out: one in [`DEFAULT_HOLDOUT`], the first of them
/// inside the row, since from its ends there is nothing to look at from both sides.
pub(crate) fn is_held_out(index: usize, count: usize) -> bool {
    count >= CAMERAS_MIN && index % DEFAULT_HOLDOUT == (DEFAULT_HOLDOUT / 2).min(count / 2)
}

/// The held-out cameras of video from several static cameras: a training camera shows each state one frame before and
/// after, so whole cameras are held out. `None` for any other set.
fn held_out_cameras(frames: &[RawFrame]) -> Option<Vec<String>> {
    let (several, still) = consistency::static_cameras(frames)?;
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

fn without_cameras(frames: &[RawFrame], held: &[String]) -> SplitPlan {
    let is_held = |index: &usize| frames[*index].camera_id.as_ref().is_some_and(|id| held.contains(id));
    let (test, train) = (0..frames.len()).partition(is_held);
    SplitPlan::of(train, test, format!("all frames of camera {} held out (data.holdout)", held.join(", ")))
}

/// The data set's own split. Nothing but its training list trains: figures of a scene that learned from validation
/// views could not be compared with anyone else's.
fn own(frames: &[RawFrame]) -> SplitPlan {
    let mut train = Vec::new();
    let mut lists: BTreeMap<&SplitName, Vec<usize>> = BTreeMap::new();
    for (index, frame) in frames.iter().enumerate() {
        match &frame.split {
            Some(SplitName::Train) | None => train.push(index),
            Some(name) => lists.entry(name).or_default().push(index),
        }
    }
    let held_out = lists.into_iter().map(|(name, list)| (name.name().to_string(), list)).collect();
    SplitPlan { train, held_out, rule: "the data set's own split".to_string() }
}

fn is_named(frame: &RawFrame, name: &str) -> bool {
    frame.name == name || frame.name.rsplit('/').next() == Some(name)
}
