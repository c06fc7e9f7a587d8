//! Names of folders and files in a sequence of PandaSet.

use std::path::{Path, PathBuf};

/// The cameras, and the rows at the bottom that show the ego vehicle in an image of `EGO_ROWS_OF` rows.
pub const CAMERAS: [(&str, usize); 6] = [
    ("front_camera", 0),
    ("front_left_camera", 0),
    ("front_right_camera", 0),
    ("left_camera", 0),
    ("right_camera", 0),
    ("back_camera", 260),
];

/// The height of images to which the rows in [`CAMERAS`] belong.
pub(crate) const EGO_ROWS_OF: usize = 1080;

/// The folder of sweeps.
pub const LIDAR: &str = "lidar";
/// The folder of images, one folder a camera.
pub const CAMERA: &str = "camera";
/// The folder of boxes.
pub const CUBOIDS: &str = "annotations/cuboids";
/// The folder of the points' classes.
pub const SEMSEG: &str = "annotations/semseg";
/// The folder of exact labels of points, which synthetic streets have.
pub const TRUTH_POINTS: &str = "truth/points";
/// The folder of exact values of pixels, which synthetic streets have.
pub const TRUTH_IMAGES: &str = "truth/images";

/// Ends of pickled files, compressed or not.
const PICKLES: [&str; 2] = [".pkl.gz", ".pkl"];

/// Whether a folder looks like a sequence.
pub(crate) fn is_sequence(folder: &Path) -> bool {
    folder.join(LIDAR).join("timestamps.json").is_file() || folder.join(LIDAR).join("poses.json").is_file()
}

/// Whether a sequence has the folder of a camera.
pub(crate) fn has_camera(sequence: &Path, name: &str) -> bool {
    sequence.join(CAMERA).join(name).exists()
}

/// The pickle of a frame in a folder.
pub(crate) fn pickle(folder: &Path, stem: &str) -> Option<PathBuf> {
    PICKLES.iter().map(|end| folder.join(format!("{stem}{end}"))).find(|path| path.exists())
}

/// Places in the JSON lists of the files of a folder that end with one of `ends`, with their stems, ascending.
pub(crate) fn stems(folder: &Path, ends: &[&str]) -> Vec<(usize, String)> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let mut found: Vec<(usize, String)> = entries
        .filter_map(|entry| {
            let name = entry.file_name().into_string().ok()?;
            let stem = ends.iter().find_map(|end| name.strip_suffix(end))?;
            // "045" and "45" would be one place; PandaSet writes two digits.
            Some((stem.parse().ok()?, stem.to_string()))
        })
        .collect();
    found.sort_unstable();
    found.dedup_by_key(|entry| entry.0);
    found
}

/// Stems of pickles.
pub(crate) fn pickles(folder: &Path) -> Vec<(usize, String)> {
    stems(folder, &PICKLES)
}
