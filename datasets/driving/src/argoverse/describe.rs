//! Frames, cameras and images of a log.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use gs_datasets::{DatasetError, photo_size};

use super::poses::{CAMERAS, Calibrated, Track, cameras};
use crate::description::{Camera, Description, Frame, Shot, centred, folder_name, without};
use crate::options::LogOptions;

/// Farthest an image may be from its sweep, nanoseconds. Cameras take 20 images a second, so the nearest is within half
/// of that.
const PAIR_MAX: u64 = 50_000_000;

/// Cameras that see the ego vehicle, the rows at the bottom that show it, and the rows of their images.
const EGO_ROWS: [(&str, usize, usize); 3] =
    [("ring_front_center", 250, 2048), ("ring_rear_left", 250, 1550), ("ring_rear_right", 250, 1550)];

/// The folder of the sweeps.
pub(crate) const LIDAR: &str = "sensors/lidar";

/// Seconds of a time stamp.
pub(crate) fn seconds(nanoseconds: i64) -> f64 {
    nanoseconds as f64 * 1e-9
}

/// Files of a folder by the time stamps that name them.
fn stamped(folder: &Path, end: &str) -> BTreeMap<i64, PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let stamp = |entry: std::fs::DirEntry| {
        let name = entry.file_name().into_string().ok()?;
        Some((name.strip_suffix(end)?.parse().ok()?, entry.path()))
    };
    entries.filter_map(stamp).collect()
}

/// Describes the log in a folder.
pub(crate) fn describe(log: &Path, options: &LogOptions) -> Result<Description, DatasetError> {
    let track = Track::read(log)?;
    let sweeps = stamped(&log.join(LIDAR), ".feather");
    let Some((first, _)) = sweeps.first_key_value() else {
        return Err(no_sweep(&log.join(LIDAR)));
    };
    let origin = track.at(log, *first)?.w_axis.truncate();
    let mut silent = Vec::new();
    let mut filmed = Vec::new();
    for calibrated in cameras(log)?.into_iter().filter(|camera| options.cameras.takes(&camera.name)) {
        let images = stamped(&log.join(CAMERAS).join(&calibrated.name), ".jpg");
        match images.first_key_value() {
            Some((_, image)) => filmed.push((camera(&calibrated, image, options)?, calibrated.pose, images)),
            None => silent.push(calibrated.name),
        }
    }
    let (mut frames, mut shots) = (Vec::new(), Vec::new());
    for stamp in sweeps.keys() {
        let ego = centred(track.at(log, *stamp)?, origin);
        frames.push(Frame { name: stamp.to_string(), time: seconds(*stamp), has_sweep: true, ego });
        let nearest = |images: &BTreeMap<i64, PathBuf>| {
            let near = images.range(..=*stamp).next_back().into_iter().chain(images.range(stamp..).next());
            let near = near.min_by_key(|entry| entry.0.abs_diff(*stamp))?;
            (near.0.abs_diff(*stamp) <= PAIR_MAX).then(|| (*near.0, near.1.clone()))
        };
        let mut row = Vec::new();
        for (_, pose, images) in &filmed {
            let shot = |(time, image)| {
                let c2w = centred(track.at(log, time)? * *pose, origin);
                Ok::<_, DatasetError>(Shot { time: seconds(time), c2w, image: Some(image) })
            };
            row.push(nearest(images).map(shot).transpose()?);
        }
        shots.push(row);
    }
    let warnings = without("an image", "camera", &silent).into_iter().collect();
    let cameras = filmed.into_iter().map(|(camera, ..)| camera).collect();
    Ok(Description { name: folder_name(log), origin, frames, cameras, shots, warnings })
}

/// The frames of this layout are its sweeps.
fn no_sweep(folder: &Path) -> DatasetError {
    DatasetError::UnknownFormat {
        path: folder.to_path_buf(),
        expected:
            "LiDAR sweeps (TIME.feather), whose times are those of the frames; a log without LiDAR cannot be used"
                .to_string(),
        found: if folder.is_dir() { "a folder without any" } else { "no such folder" }.to_string(),
    }
}

fn camera(calibrated: &Calibrated, image: &Path, options: &LogOptions) -> Result<Camera, DatasetError> {
    let [(width, height), _] = photo_size(image, options.max_width)?;
    let (x, y) = (width as f64 / calibrated.size.0, height as f64 / calibrated.size.1);
    let seen = EGO_ROWS.iter().find(|(name, ..)| *name == calibrated.name);
    Ok(Camera {
        name: calibrated.name.clone(),
        width,
        height,
        intrinsics: calibrated.intrinsics.scaled(x, y),
        ego_rows: seen.map_or(0, |(_, rows, of)| (rows * height).div_ceil(*of)),
    })
}
