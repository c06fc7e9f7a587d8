//! Times and exposures.

use std::collections::HashMap;
use std::path::Path;

use gs_base::{agree, counted, median};

use super::cameras::{same_pose, spread};
use crate::findings::Findings;
use crate::names::some_names;
use crate::options::LoadOptions;
use crate::order::natural;
use crate::raw::{RawFrame, SplitName};

/// An exposure may exceed the frame interval by this share before it is taken for a mistake: intervals are measured on
/// rounded times.
const INTERVAL_SLACK: f64 = 0.01;

/// Times closer than this share of their range are the same: well below the interval of a million frames.
const SAME_TIME: f64 = 1e-9;

/// The time between frames of one camera, in the unit of time: the median over all cameras. Where no camera has two
/// times (a hand-held camera in a world that moves), the median between the times of all frames. `None` with fewer than
/// two times. `frames` are cameras and times.
pub fn frame_interval<'a>(frames: impl IntoIterator<Item = (Option<&'a str>, f64)>) -> Option<f64> {
    let mut by_camera: HashMap<Option<&str>, Vec<f64>> = HashMap::new();
    for (camera, time) in frames {
        by_camera.entry(camera).or_default().push(time);
    }
    let all = by_camera.values().flatten().copied().collect();
    median(by_camera.into_values().flat_map(gaps).collect()).or_else(|| median(gaps(all)))
}

/// [`frame_interval`] of described frames.
pub(crate) fn interval_of<'a>(frames: impl IntoIterator<Item = &'a RawFrame>) -> Option<f64> {
    frame_interval(frames.into_iter().filter_map(|frame| Some((frame.camera_id.as_deref(), frame.time?))))
}

/// The distances between different times.
fn gaps(mut times: Vec<f64>) -> Vec<f64> {
    times.sort_by(f64::total_cmp);
    let span = times.last().copied().unwrap_or(0.0) - times.first().copied().unwrap_or(0.0);
    times.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > SAME_TIME * span).collect()
}

/// Leaves out later photos of the same camera, pose, time and split: two photos of one time can only
/// agree, or contradict each other.
pub(super) fn drop_repeats(frames: &mut Vec<RawFrame>, scene: &Path, findings: &mut Findings) {
    let mut first: HashMap<(&str, Option<&SplitName>, u64), usize> = HashMap::new();
    let (mut drop, mut pairs) = (vec![false; frames.len()], Vec::new());
    let spread = spread(frames);
    for (i, frame) in frames.iter().enumerate() {
        let (Some(time), Some(camera)) = (frame.time, &frame.camera_id) else { continue };
        // + 0.0 makes one zero of the two.
        let earlier = *first.entry((camera, frame.split.as_ref(), (time + 0.0).to_bits())).or_insert(i);
        if earlier != i && same_pose(&frames[earlier], frame, spread) {
            drop[i] = true;
            pairs.push(format!("{} after {}", frame.name, frames[earlier].name));
        }
    }
    let mut drop = drop.into_iter();
    frames.retain(|_| !drop.next().unwrap_or(false));
    let are = agree(pairs.len(), "is", "are");
    findings.warn_of(scene, &pairs, ["photo", "has", "have"], |have, names| {
        format!("times repeat: {have} the camera and time of an earlier one and {are} left out ({names})")
    });
}

/// Warns where a camera's times fall while its file names rise. Frames without a camera are in no order to speak of.
pub(super) fn find_backward(frames: &[RawFrame], scene: &Path, findings: &mut Findings) {
    type Track<'a> = (&'a str, Option<&'a SplitName>, &'a str);
    let mut tracks: HashMap<Track, Vec<(&str, f64)>> = HashMap::new();
    for frame in frames {
        let (Some(time), Some(camera)) = (frame.time, &frame.camera_id) else { continue };
        let folder = frame.name.rsplit_once('/').map_or("", |(folder, _)| folder);
        tracks.entry((camera.as_str(), frame.split.as_ref(), folder)).or_default().push((frame.name.as_str(), time));
    }
    let mut pairs = Vec::new();
    for track in tracks.values_mut() {
        track.sort_by(|a, b| natural(a.0, b.0));
        for pair in track.windows(2) {
            if pair[1].1 < pair[0].1 {
                pairs.push(format!("{} at {} after {} at {}", pair[1].0, pair[1].1, pair[0].0, pair[0].1));
            }
        }
    }
    if !pairs.is_empty() {
        pairs.sort_by(|a, b| natural(a, b));
        findings.warn(format!(
            "{}: times run backwards in {} although file names go on; they are used as written ({})",
            scene.display(),
            counted(pairs.len(), "place"),
            some_names(&pairs)
        ));
    }
}

/// Puts the user's exposure in place of the data set's, or leaves out impossible exposures: 0, and more than one
/// frame interval, in which the shutter would have to be open twice. The user's own is believed, with a warning.
pub(super) fn settle_exposures(frames: &mut [RawFrame], scene: &Path, options: &LoadOptions, findings: &mut Findings) {
    let interval = interval_of(&*frames);
    let limit = interval.map_or(f64::INFINITY, |interval| interval * (1.0 + INTERVAL_SLACK));
    if let Some(exposure) = options.exposure {
        frames.iter_mut().filter(|frame| frame.time.is_some()).for_each(|frame| frame.exposure = Some(exposure));
        if exposure > limit {
            findings.warn(format!(
                "{}: the given exposure of {exposure} is longer than one frame interval ({}); it is used as given",
                scene.display(),
                interval.unwrap_or(0.0)
            ));
        }
        return;
    }
    let (mut zero, mut long) = (Vec::new(), Vec::new());
    let mut longest: f64 = 0.0;
    for frame in frames {
        let Some(exposure) = frame.exposure else { continue };
        if exposure == 0.0 {
            zero.push(frame.name.clone());
        } else if exposure > limit {
            longest = longest.max(exposure);
            long.push(frame.name.clone());
        } else {
            continue;
        }
        frame.exposure = None;
    }
    let sentences = [
        (zero, "is 0, in which no light is gathered".to_string()),
        (
            long,
            format!(
                "is longer than one frame interval ({longest} against {}; is it in the unit of `time`?)",
                interval.unwrap_or(0.0)
            ),
        ),
    ];
    for (names, why) in sentences.into_iter().filter(|(names, _)| !names.is_empty()) {
        findings.warn(format!(
            "{}: the exposure of {} {why}; it is left out and counts as unknown ({})",
            scene.display(),
            counted(names.len(), "view"),
            some_names(&names)
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cameras that start a millisecond apart still take a frame every half second.
    #[test]
    fn intervals_are_those_of_a_camera() {
        let start = [("a", 0.0), ("b", 0.001), ("c", 0.0)];
        let frames =
            start.into_iter().flat_map(|(name, start)| (0..4).map(move |i| (Some(name), start + 0.5 * f64::from(i))));
        assert!((frame_interval(frames).expect("an interval") - 0.5).abs() < 1e-12);
        let wandering = (0..4).map(|i| (None, f64::from(i)));
        assert_eq!(frame_interval(wandering), Some(1.0));
        assert_eq!(frame_interval([(Some("a"), 1.0), (Some("b"), 1.0)]), None);
    }
}
