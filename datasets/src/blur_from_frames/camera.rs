//! The frames of one static camera, and the windows that they make.

use std::collections::BTreeMap;
use std::path::Path;

use gs_base::{counted, median};

use super::BlurFromFrames;
use crate::error::DatasetError;
use crate::names;
use crate::raw::{RawFrame, SplitName};
use crate::split::is_held_out;

/// Poses of one camera may differ by this much (rotation entries; translations likewise, relative to 1 scene unit)
/// before it counts as moving: room for numbers printed with six digits.
const STATIC_TOLERANCE: f64 = 1e-5;

/// Frames follow each other when the time between them is within this share of the camera's usual one.
const SPACING_TOLERANCE: f64 = 0.1;

/// A static camera, its frames in order of time.
pub(super) struct StaticCamera {
    pub id: String,
    /// A name for folders.
    pub folder: String,
    pub is_test: bool,
    pub frames: Vec<RawFrame>,
    /// Usual time between frames.
    pub spacing: f64,
}

/// The first frames of windows.
pub(super) struct Windows {
    pub starts: Vec<usize>,
    pub skipped: usize,
}

/// Groups frames by camera and checks that each camera is static.
pub(super) fn cameras(source: &Path, frames: Vec<RawFrame>) -> Result<Vec<StaticCamera>, DatasetError> {
    let mut groups: BTreeMap<(usize, String), Vec<RawFrame>> = BTreeMap::new();
    for frame in frames {
        // Without a name a camera is known by its position.
        let id = frame.camera_id.clone().unwrap_or_else(|| format!("at {}", frame.c2w.w_axis.truncate()));
        // By length first: "2" before "10".
        groups.entry((id.len(), id)).or_default().push(frame);
    }
    if groups.len() > 1 && groups.values().all(|frames| frames.len() == 1) {
        let expected = "static cameras with several frames each";
        let found = format!("{} frames from as many positions, as a moving camera takes them", groups.len());
        return Err(DatasetError::malformed(source, "cameras", expected, found));
    }
    let has_split = groups.values().flatten().any(|frame| frame.split == Some(SplitName::Test));
    let is_mixed = |frames: &Vec<RawFrame>| frames.iter().any(|frame| frame.split != Some(SplitName::Test));
    let by_time = has_split && groups.values().all(is_mixed);
    let count = groups.len();
    let mut cameras = Vec::new();
    for (index, ((_, id), frames)) in groups.into_iter().enumerate() {
        let is_test = match has_split {
            true => frames.iter().any(|frame| frame.split == Some(SplitName::Test)),
            false => is_held_out(index, count),
        };
        let folder = match id.parse::<usize>() {
            Ok(number) => format!("cam{number:02}"),
            Err(_) if id.starts_with("at ") => format!("cam{index:02}"),
            Err(_) => names::view_name(Path::new(""), &id).replace(['/', ' '], "_"),
        };
        cameras.push(still(source, id, folder, is_test, frames)?);
    }
    names::make_unique(cameras.iter_mut().map(|camera| &mut camera.folder));
    if cameras.iter().all(|camera| camera.is_test) {
        let cameras = counted(cameras.len(), "camera");
        let found = match by_time {
            true => format!(
                "{cameras} with later frames that are held out; a camera is for training or held out as a whole"
            ),
            false => format!("{cameras}, held out"),
        };
        return Err(DatasetError::NoTrainingViews { path: source.to_path_buf(), found });
    }
    Ok(cameras)
}

fn still(
    source: &Path,
    id: String,
    folder: String,
    is_test: bool,
    mut frames: Vec<RawFrame>,
) -> Result<StaticCamera, DatasetError> {
    let timeless = |frame: &&RawFrame| !frame.time.is_some_and(f64::is_finite);
    if let Some(frame) = frames.iter().find(timeless) {
        let location = format!("frame {:?}", frame.name);
        return Err(DatasetError::malformed(&frame.file, location, "a time in every frame", "none"));
    }
    let time = |frame: &RawFrame| frame.time.unwrap_or(f64::NAN);
    frames.sort_by(|a, b| time(a).total_cmp(&time(b)));
    let first = &frames[0];
    for pair in frames.windows(2) {
        let (before, frame) = (&pair[0], &pair[1]);
        let wrong = |expected: &str, found: String| {
            DatasetError::malformed(&frame.file, format!("frame {:?} of camera {id}", frame.name), expected, found)
        };
        if time(frame) == time(before) {
            return Err(wrong("one frame at a time", format!("the time of {:?} again", before.name)));
        }
        let moved = (frame.c2w - first.c2w).to_cols_array().iter().fold(0.0_f64, |most, d| most.max(d.abs()));
        if moved > STATIC_TOLERANCE {
            let expected = "a static camera (the frames of a moving one cannot be averaged)";
            return Err(wrong(expected, format!("a pose that differs by {moved:.2e} from {:?}", first.name)));
        }
        if frame.lens != first.lens {
            return Err(wrong("one lens per camera", format!("another than that of {:?}", first.name)));
        }
    }
    let gaps = frames.windows(2).map(|pair| time(&pair[1]) - time(&pair[0])).collect();
    let spacing = median(gaps).ok_or_else(|| {
        let (location, expected) = (format!("camera {id}"), "video, that is several frames with different times");
        DatasetError::malformed(source, location, expected, "one frame")
    })?;
    Ok(StaticCamera { id, folder, is_test, frames, spacing })
}

impl StaticCamera {
    /// Windows of frames that follow each other without gaps.
    pub fn windows(&self, options: &BlurFromFrames) -> Windows {
        let mut windows = Windows { starts: Vec::new(), skipped: 0 };
        let mut start = 0;
        while start + options.window <= self.frames.len() {
            let times = self.frames[start..start + options.window].iter().map(|frame| frame.time.unwrap_or(f64::NAN));
            let times: Vec<f64> = times.collect();
            let is_even = |pair: &[f64]| ((pair[1] - pair[0]) / self.spacing - 1.0).abs() <= SPACING_TOLERANCE;
            if times.windows(2).all(is_even) {
                windows.starts.push(start)
            } else {
                windows.skipped += 1
            }
            start += options.stride;
        }
        windows
    }
}
