//! Training and held-out views, once they are told apart: times and exposures that do not go together.

use std::path::Path;

use gs_base::statistics::range;
use gs_base::{agree, clause, counted, median};

use super::timing::interval_of;
use crate::names::some_names;
use crate::raw::{RawFrame, SplitName};
use crate::side_files::Kind;

/// Exposures within this share of each other are one: the ends of a blur of 50 pixels then differ by half a pixel.
const SAME_EXPOSURE: f64 = 0.01;

/// Frame intervals outside the training times that are still inside: of a single camera's video the first and the last
/// frame may be held out.
const REACH: f64 = 1.5;

/// Contradictions between training and held-out frames, in sentences. Later held-out frames are none if the future is
/// held out on purpose (`predicts`).
pub(crate) fn compare_splits(train: &[&RawFrame], held_out: &[&RawFrame], predicts: bool, scene: &Path) -> Vec<String> {
    [
        timeless(train, held_out),
        (!predicts).then(|| outside(train, held_out, scene)).flatten(),
        differing_exposures(train, scene),
        blurry_truth(held_out, scene),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Views without a time among others that have one.
pub(crate) fn without_time<'a>(train: &[&'a RawFrame], held_out: &[&'a RawFrame]) -> Vec<&'a str> {
    let views = || train.iter().chain(held_out);
    if views().all(|frame| frame.time.is_none()) {
        return Vec::new();
    }
    views().filter(|frame| frame.time.is_none()).map(|frame| frame.name.as_str()).collect()
}

fn timeless(train: &[&RawFrame], held_out: &[&RawFrame]) -> Option<String> {
    let names = without_time(train, held_out);
    (!names.is_empty()).then(|| {
        let (views, have) = (counted(names.len(), "view"), agree(names.len(), "has", "have"));
        format!("{views} {have} no time although others do ({})", some_names(&names))
    })
}

/// Paths are fitted to training times; away from them they go anywhere.
fn outside(train: &[&RawFrame], held_out: &[&RawFrame], scene: &Path) -> Option<String> {
    let (low, high) = range(train.iter().filter_map(|frame| frame.time))?;
    let reach = REACH * interval_of(train.iter().copied()).unwrap_or(0.0);
    let is_outside = |time: f64| time < low - reach || time > high + reach;
    let names: Vec<&str> =
        held_out.iter().filter(|frame| frame.time.is_some_and(is_outside)).map(|frame| frame.name.as_str()).collect();
    if names.is_empty() {
        return None;
    }
    let (first, last) = range(held_out.iter().filter_map(|frame| frame.time))?;
    Some(format!(
        "{}: {} taken outside the times of the training views ({}; held out from {first} to {last}, \
         training from {low} to {high}); what moves is not known there, and figures on them will be low",
        scene.display(),
        clause(names.len(), "held-out view", "was", "were"),
        some_names(&names)
    ))
}

/// Held-out photos of a set without a split of its own are as blurry as its training photos.
fn blurry_truth(held_out: &[&RawFrame], scene: &Path) -> Option<String> {
    let is_blurry = |frame: &&&RawFrame| {
        SplitName::trains(frame.split.as_ref())
            && frame.exposure.is_some_and(|e| e > 0.0)
            && !frame.sides.lists(Kind::TrueSharp)
    };
    let count = held_out.iter().filter(is_blurry).count();
    (count > 0).then(|| {
        format!(
            "{}: {} as blurry as those that train, and no sharp image of them is there; figures on them say how \
             blurry a rendering is, not how sharp",
            scene.display(),
            clause(count, "held-out photo", "is", "are")
        )
    })
}

/// One exposure is learned for all photos, beginning with the median.
fn differing_exposures(train: &[&RawFrame], scene: &Path) -> Option<String> {
    let mut values: Vec<f64> = train.iter().filter_map(|frame| frame.exposure).collect();
    let (low, high) = range(values.iter().copied())?;
    if high <= low * (1.0 + SAME_EXPOSURE) {
        return None;
    }
    let taken = median(values.clone())?;
    values.sort_by(f64::total_cmp);
    values.dedup();
    Some(format!(
        "{}: the training views have {} different exposures, from {low} to {high}, but one is used for all of them: \
         their median, {taken}, unless the configuration says another",
        scene.display(),
        values.len()
    ))
}
