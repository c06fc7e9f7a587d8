//! Which view of a data set each predicted view is.

use std::path::Path;

use gs_base::counted;

use crate::error::DatasetError;
use crate::names::{some_names, with_slashes};
use crate::raw::{RawFrame, SplitName};

/// The frame of each predicted view. `names` are what the user or the archive calls them, in the order of the prediction.
///
/// A name fits a frame when it is the frame's name, or its last part without extension, or, last, its camera at the first time. Without
/// names the frames are the training views of the first time, sorted by name, if there are as many of them as predicted views.
///
/// # Errors
/// When a name fits no frame or several, when two views are the same frame, and when there are no names and the counts differ.
pub(super) fn assign(
    names: Option<&[String]>,
    count: usize,
    frames: &[RawFrame],
    dataset: &Path,
) -> Result<Vec<usize>, DatasetError> {
    let wrong = |expected: String, found: String| {
        Err(DatasetError::Option { path: dataset.to_path_buf(), option: "views", expected, found })
    };
    let first = first_time(frames);
    let Some(names) = names else {
        let training: Vec<usize> = (0..frames.len())
            .filter(|index| SplitName::trains(frames[*index].split.as_ref()) && frames[*index].time == first)
            .collect();
        if training.len() == count {
            return Ok(training);
        }
        return wrong(
            format!("names of the {} in order (--views a,b,c or --images FILE)", counted(count, "predicted view")),
            format!("none, and {} of the first time", counted(training.len(), "training view")),
        );
    };
    if names.len() != count {
        let found = format!("{} ({})", names.len(), some_names(names));
        return wrong(format!("one name for each of {}", counted(count, "predicted view")), found);
    }
    let mut assigned = Vec::with_capacity(count);
    for name in names {
        let fitting = fitting(name, frames, first);
        match *fitting.as_slice() {
            [index] if assigned.contains(&index) => {
                return wrong("each view once".to_string(), format!("{:?} twice", frames[index].name));
            }
            [index] => assigned.push(index),
            [] => {
                let known: Vec<&str> = frames.iter().map(|frame| frame.name.as_str()).collect();
                return wrong(format!("a view of the data set ({})", some_names(&known)), format!("{name:?}"));
            }
            _ => {
                let several: Vec<&str> = fitting.iter().map(|index| frames[*index].name.as_str()).collect();
                return wrong(
                    "a name of one view".to_string(),
                    format!("{name:?}, which fits {}", some_names(&several)),
                );
            }
        }
    }
    Ok(assigned)
}

/// The smallest time of a training frame; `None` in a set without times.
fn first_time(frames: &[RawFrame]) -> Option<f64> {
    let training = frames.iter().filter(|frame| SplitName::trains(frame.split.as_ref()));
    training.filter_map(|frame| frame.time).min_by(f64::total_cmp)
}

/// The frames that a name fits best.
fn fitting(name: &str, frames: &[RawFrame], first: Option<f64>) -> Vec<usize> {
    let whole = with_slashes(name);
    let stem = match whole.rsplit_once('.') {
        Some((stem, end)) if !end.contains('/') && end.len() <= 4 => stem,
        _ => &whole,
    };
    let parts =
        |path: &str| -> Vec<String> { path.rsplit('/').filter(|part| *part != ".").map(String::from).collect() };
    let (asked, written) = (parts(stem), parts(&whole));
    // How many parts of two paths agree, counted from the file.
    let depth = |frame: &RawFrame| {
        let own = parts(&frame.name);
        let common = |asked: &[String]| own.iter().zip(asked).take_while(|(a, b)| a == b).count();
        common(&asked).max(common(&written))
    };
    let depths: Vec<usize> = frames.iter().map(depth).collect();
    let deepest = depths.iter().copied().max().unwrap_or(0);
    if deepest > 0 {
        return (0..frames.len()).filter(|index| depths[*index] == deepest).collect();
    }
    let is_camera = |frame: &RawFrame| frame.camera_id.as_deref() == Some(&whole) && frame.time == first;
    (0..frames.len()).filter(|index| is_camera(&frames[*index])).collect()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use glam::DMat4;

    use super::*;
    use crate::distortion::Distortion;
    use crate::lens::Lens;

    fn frame(name: &str, camera: &str, time: f64, split: SplitName) -> RawFrame {
        let lens = Lens {
            focal_x: None,
            focal_y: None,
            cx: None,
            cy: None,
            width: None,
            height: None,
            distortion: Distortion::default(),
        };
        let image_path = PathBuf::from(format!("{name}.png"));
        RawFrame {
            time: Some(time),
            camera_id: Some(camera.to_string()),
            split: Some(split),
            ..RawFrame::posed(name.to_string(), image_path, DMat4::IDENTITY, lens, PathBuf::new())
        }
    }

    fn frames() -> Vec<RawFrame> {
        vec![
            frame("train/cam00/0000", "cam00", 0.0, SplitName::Train),
            frame("train/cam00/0001", "cam00", 0.1, SplitName::Train),
            frame("train/cam01/0000", "cam01", 0.0, SplitName::Train),
            frame("val/cam02/0000", "cam02", 0.0, SplitName::Validation),
        ]
    }

    fn found(names: Option<&[&str]>, count: usize) -> Result<Vec<usize>, String> {
        let names: Option<Vec<String>> = names.map(|names| names.iter().map(|name| name.to_string()).collect());
        assign(names.as_deref(), count, &frames(), Path::new("set")).map_err(|error| error.to_string())
    }

    #[test]
    fn views_are_named_by_path_or_camera_or_not_at_all() {
        assert_eq!(found(None, 2), Ok(vec![0, 2]));
        assert_eq!(found(Some(&["cam02", "cam00"]), 2), Ok(vec![3, 0]));
        assert_eq!(found(Some(&["/data/set/train/cam00/0001.png", "cam01\\0000.png"]), 2), Ok(vec![1, 2]));
        assert_eq!(found(Some(&["0001"]), 1), Ok(vec![1]));
    }

    #[test]
    fn names_that_fit_none_or_several_are_refused() {
        let refused = |names, count, expected: &str| {
            let error = found(names, count).expect_err("refused");
            assert!(error.contains(expected), "{error}");
        };
        refused(None, 3, "--views a,b,c");
        refused(Some(&["cam00"]), 2, "one name for each");
        refused(Some(&["0000"]), 1, "which fits train/cam00/0000");
        refused(Some(&["cam09"]), 1, "a view of the data set");
        refused(Some(&["cam00", "train/cam00/0000.png"]), 2, "twice");
    }
}
