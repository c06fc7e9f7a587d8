//! The description of a log, before any sweep or image is decoded.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};
use gs_base::{Intrinsics, counted};
use gs_datasets::some_names;

/// A frame: one sweep of the LiDAR and one image of each camera, as far as they are there.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// The name of the frame's files: "45" of `45.jpg` in PandaSet, the time stamp of the sweep in Argoverse 2 and
    /// Waymo.
    pub name: String,
    /// Unix seconds of the sweep. PandaSet: its end. Argoverse 2 and Waymo: its begin.
    pub time: f64,
    /// Whether there is a sweep.
    pub has_sweep: bool,
    /// Ego vehicle to centred world. PandaSet: x to the right, y ahead. Argoverse 2 and Waymo: x ahead, y to the left.
    /// z is up in all. That of Waymo is of about the middle of the sweep.
    pub ego: DMat4,
}

/// A camera of the rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// As the data set names it.
    pub name: String,
    /// Width of the images as they are decoded, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// At that size; the lens is a pinhole, and distortion is removed when an image is decoded.
    pub intrinsics: Intrinsics,
    /// Rows at the bottom in which the camera sees the ego vehicle itself; 0 for most.
    pub ego_rows: usize,
}

/// One image before it is decoded.
#[derive(Debug, Clone, PartialEq)]
pub struct Shot {
    /// Unix seconds.
    pub time: f64,
    /// Camera to centred world, OpenCV axes (x right, y down, z forward).
    pub c2w: DMat4,
    /// The file, or the file with all images of a Waymo segment; `None` where the pose is known and the image is
    /// missing.
    pub image: Option<PathBuf>,
}

/// A log, described.
#[derive(Debug)]
pub(crate) struct Description {
    pub name: String,
    /// Subtracted from all positions of the files, metres.
    pub origin: DVec3,
    pub frames: Vec<Frame>,
    pub cameras: Vec<Camera>,
    /// `[frames][cameras]`.
    pub shots: Vec<Vec<Option<Shot>>>,
    /// Omissions, in sentences.
    pub warnings: Vec<String>,
}

/// A pose with `origin` subtracted from its position.
pub(crate) fn centred(mut pose: DMat4, origin: DVec3) -> DMat4 {
    pose.w_axis -= origin.extend(0.0);
    pose
}

/// The name of a log by its folder.
pub(crate) fn folder_name(folder: &Path) -> String {
    folder.file_name().map_or_else(|| "log".to_string(), |name| name.to_string_lossy().into_owned())
}

/// "2 cameras without an image: a, b"; `None` where there are none.
pub(crate) fn without<S: AsRef<str>>(what: &str, noun: &str, names: &[S]) -> Option<String> {
    (!names.is_empty()).then(|| format!("{} without {what}: {}", counted(names.len(), noun), some_names(names)))
}
