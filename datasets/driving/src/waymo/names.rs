//! Recognising a segment by its path.
//!
//! A segment of version 2 is a file of any component (`vehicle_pose/NAME.parquet`), or the folder above the components
//! where it holds one segment. A segment of version 1 is a `.tfrecord` file.

use std::path::Path;

/// The component that every segment has, and that decides which segments a folder holds.
pub(crate) const VEHICLE_POSE: &str = "vehicle_pose";

/// Components whose files stand for their segment.
const COMPONENTS: [&str; 8] = [
    VEHICLE_POSE,
    "camera_image",
    "camera_calibration",
    "lidar",
    "lidar_calibration",
    "lidar_pose",
    "lidar_box",
    "lidar_camera_synced_box",
];

/// The end of a file's name.
pub(crate) const PARQUET: &str = ".parquet";
pub(crate) const RECORDS: &str = ".tfrecord";

/// Whether a path looks like a segment, or like a folder of components.
pub(crate) fn is_segment(path: &Path) -> bool {
    let ends = |end: &str| path.file_name().is_some_and(|name| name.to_string_lossy().ends_with(end));
    if path.is_dir() {
        !segments(path).is_empty()
    } else {
        (ends(RECORDS) || ends(PARQUET) && component(path).is_some()) && path.exists()
    }
}

/// The component of a file, by its folder.
fn component(file: &Path) -> Option<&'static str> {
    let folder = file.parent()?.file_name()?;
    COMPONENTS.into_iter().find(|name| folder == *name)
}

/// Names of the segments below a folder of components, ascending.
pub(crate) fn segments(root: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(root.join(VEHICLE_POSE)).into_iter().flatten().filter_map(Result::ok);
    let stem =
        |entry: std::fs::DirEntry| Some(entry.file_name().into_string().ok()?.strip_suffix(PARQUET)?.to_string());
    let mut names: Vec<String> = entries.filter_map(stem).collect();
    names.sort_unstable();
    names
}
