//! LLFF's poses_bounds.npy, with frames of several static cameras (N3DV) or with photos.
//!
//! ```text
//! poses_bounds.npy                    [cameras, 17]: 3 x 5 rows [R | t | (height, width, focal)], then near and far
//! cam00/0000.png  cam01/images/0000.png   frames of each camera, in its folder or in `images` below it
//! images/0000.png                     or, in a static scene, one photo a row
//! ```
//!
//! R's columns are the camera's down, right and back axes in the world. Rows go with camera folders (or photos) in the
//! [order](rows) of their names. As in N3DV, the first camera is held out; time is the index among all frame names over
//! the last index, 0 to 1.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};
use gs_base::sentence::number;
use gs_base::{counted, guarded, npy, printable};

use super::rows;
use crate::distortion::Distortion;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::folder::{entries, file_name, folder_of, has_extension, stem};
use crate::foreign::{CONVERT, Foreign, is_photo};
use crate::lens::Lens;
use crate::options::{LoadOptions, MaskUse};
use crate::order::natural;
use crate::priors::sources;
use crate::raw::{RawFrame, RawScene, SplitName};
use crate::scene::SceneFormat;
use crate::side_files::{DepthMeaning, Kind, SideFiles};
use crate::{names, pose};

const POSE_FILE: &str = "poses_bounds.npy";

/// Numbers in a row of the file.
const ROW: usize = 17;

/// How folders of cameras are called.
const CAMERA_PREFIX: &str = "cam";

/// Videos that would have to be taken apart first.
const VIDEOS: [&str; 3] = ["mp4", "mov", "avi"];

/// A pose file and what lies beside it.
#[derive(Clone)]
pub(crate) struct PoseFile {
    pub path: PathBuf,
    folder: PathBuf,
    /// Folders of frames, sorted by name as text.
    cameras: Vec<PathBuf>,
    has_videos: bool,
}

impl PoseFile {
    /// Whether there are frames of cameras, rather than photos.
    pub fn has_cameras(&self) -> bool {
        !self.cameras.is_empty() || self.has_videos
    }
}

/// The pose file in a folder, or given itself.
pub(crate) fn find(path: &Path) -> Option<PoseFile> {
    let (file, folder) = if path.is_dir() {
        (path.join(POSE_FILE), path.to_path_buf())
    } else {
        (path.to_path_buf(), folder_of(path).to_path_buf())
    };
    if file.file_name()? != POSE_FILE || !file.exists() {
        return None;
    }
    let is_camera = |path: &Path| file_name(path).to_ascii_lowercase().starts_with(CAMERA_PREFIX);
    let entries = entries(&folder);
    let cameras = entries.iter().filter(|path| is_camera(path) && path.is_dir()).cloned().collect();
    let has_videos = entries.iter().any(|path| is_camera(path) && has_extension(path, &VIDEOS));
    Some(PoseFile { path: file, folder, cameras, has_videos })
}

/// Reads the description of a scene.
pub(crate) fn read(poses: &PoseFile, options: &LoadOptions, findings: &mut Findings) -> Result<RawScene, DatasetError> {
    let rows = npy::read(&poses.path)?;
    if rows.shape.len() != 2 || rows.shape[1] != ROW {
        let found = format!("{:?}", rows.shape);
        return Err(DatasetError::malformed(&poses.path, "shape", "(cameras, 17)", found));
    }
    let rows: Vec<&[f64]> = rows.values.chunks_exact(ROW).collect();
    let positions: Vec<DVec3> = rows.iter().map(|row| DVec3::new(row[3], row[8], row[13])).collect();
    let photos = if poses.has_cameras() {
        camera_frames(poses, &positions, options, findings)?
    } else {
        still_photos(poses, &positions, options, findings)?
    };
    let mut frames = Vec::new();
    for (index, row) in rows.iter().enumerate() {
        let camera = camera(row, &poses.path, index);
        let Some((c2w, lens)) = findings.take_posed(camera)? else { continue };
        for photo in photos.iter().filter(|photo| photo.row == index) {
            let depth = DepthMeaning { kind: options.depth_kind, ..DepthMeaning::default() };
            let name = names::text_below(&poses.folder, &photo.path)
                .and_then(|written| names::output_name(&poses.folder, written, &poses.path));
            let Some(name) = findings.take(name)? else { continue };
            frames.push(RawFrame {
                time: photo.time,
                camera_id: photo.camera.clone(),
                sides: SideFiles { files: Vec::new(), depth },
                split: photo.split.clone(),
                ..RawFrame::posed(name, photo.path.clone(), c2w, lens.clone(), poses.path.clone())
            });
        }
    }
    findings.need_frames(&frames, &poses.folder, || format!("none for {}", counted(rows.len(), "pose")))?;
    // Which masks a folder holds is not said anywhere; in a set of frames over time they mark what moves.
    let mut kinds = vec![Kind::Depth, Kind::Confidence, Kind::Sharp];
    if matches!(options.masks, MaskUse::Auto | MaskUse::Moving) {
        kinds.push(Kind::Moving);
    }
    if poses.has_cameras() {
        sources::search(&mut frames, &poses.folder, &poses.path, &kinds, options.priors, findings);
        sources::note_gaps(&mut frames);
    } else {
        sources::search_depth(&mut frames, &poses.folder, options, findings);
    }
    Ok(RawScene { format: SceneFormat::Llff, frames, points: None })
}

/// A frame as the folders show it.
struct FrameFile {
    path: PathBuf,
    /// Of the pose file.
    row: usize,
    time: Option<f64>,
    camera: Option<String>,
    split: Option<SplitName>,
}

/// Frames of all cameras. Cameras that lack frames keep the others' times: time goes by the name.
fn camera_frames(
    poses: &PoseFile,
    positions: &[DVec3],
    options: &LoadOptions,
    findings: &mut Findings,
) -> Result<Vec<FrameFile>, DatasetError> {
    let rows = positions.len();
    let cameras = rows::in_order(poses.cameras.clone(), positions, &poses.path, options.row_order, findings);
    let found: Vec<Vec<PathBuf>> = cameras.iter().map(|folder| frames_of(folder)).collect();
    if found.iter().all(Vec::is_empty) {
        let what = if poses.has_videos { VIDEOS_ONLY } else { foreign_photos(poses).unwrap_or("empty folders") };
        let (path, found) = (poses.folder.clone(), what.to_string());
        return Err(DatasetError::NoFrames { path, found });
    }
    if poses.cameras.len() != rows {
        let found = format!("{} named {CAMERA_PREFIX}*", counted(poses.cameras.len(), "folder"));
        let expected = format!("one camera folder for each of {}", counted(rows, "pose"));
        return Err(DatasetError::malformed(&poses.path, "rows", expected, found));
    }
    let times = TimeLine::of(found.iter().flatten());
    let mut photos = Vec::new();
    for (row, paths) in found.into_iter().enumerate() {
        for path in paths {
            let split = if row == 0 { SplitName::Test } else { SplitName::Train };
            photos.push(FrameFile {
                time: times.time(&path),
                path,
                row,
                camera: Some(printable(&file_name(&cameras[row])).into_owned()),
                split: (rows > 1).then_some(split),
            });
        }
    }
    Ok(photos)
}

/// The sentence about cameras with videos and no frames.
const VIDEOS_ONLY: &str = "videos, which have to be taken apart into frames first (`ffmpeg -i cam00.mp4 \
    cam00/%04d.png`, for each camera)";

/// The next step with the photos of folders that hold none that are read.
fn foreign_photos(poses: &PoseFile) -> Option<&'static str> {
    let is_foreign = |path: &PathBuf| matches!(Foreign::of_extension(path), Some(Foreign::Photo(_)));
    let mut folders = poses.cameras.iter().flat_map(|folder| [folder.clone(), folder.join("images")]);
    folders.any(|folder| entries(&folder).iter().any(is_foreign)).then_some(CONVERT)
}

/// The names of frames over time, in order.
pub(super) struct TimeLine(Vec<String>);

impl TimeLine {
    /// The names of all `frames`.
    pub fn of<'a>(frames: impl Iterator<Item = &'a PathBuf>) -> Self {
        let mut stems: Vec<String> = frames.map(|path| stem(path)).collect();
        stems.sort_by(|a, b| natural(a, b));
        stems.dedup();
        Self(stems)
    }

    /// The time of a frame: the index of its name over the last index, 0 to 1; none where all have one name.
    pub fn time(&self, path: &Path) -> Option<f64> {
        let Self(stems) = self;
        let index = stems.binary_search_by(|other| natural(other, &stem(path))).unwrap_or(0);
        (stems.len() > 1).then(|| index as f64 / (stems.len() - 1) as f64)
    }
}

/// The photos of a camera, in its folder or in `images` below it.
pub(super) fn frames_of(folder: &Path) -> Vec<PathBuf> {
    let images = |folder: &Path| -> Vec<PathBuf> {
        entries(folder).into_iter().filter(|path| is_photo(path) && guarded::is_there(path)).collect()
    };
    let found = images(folder);
    if found.is_empty() { images(&folder.join("images")) } else { found }
}

/// The photos of a folder, a row for each.
fn still_photos(
    poses: &PoseFile,
    positions: &[DVec3],
    options: &LoadOptions,
    findings: &mut Findings,
) -> Result<Vec<FrameFile>, DatasetError> {
    let rows = positions.len();
    let folder = poses.folder.join(options.images.as_deref().unwrap_or(Path::new("images")));
    let photos_in =
        |folder: &Path| -> Vec<PathBuf> { entries(folder).into_iter().filter(|path| is_photo(path)).collect() };
    let found = photos_in(&folder);
    if found.len() != rows {
        let others = entries(&poses.folder).into_iter().filter(|other| *other != folder && other.is_dir());
        let other = others.map(|other| (photos_in(&other).len(), file_name(&other))).find(|(count, _)| *count == rows);
        let hint =
            other.map_or_else(String::new, |(count, name)| format!("; {name} holds {count}: --set data.images={name}"));
        let count = format!("{} in {}{hint}", counted(found.len(), "image"), folder.display());
        let expected = format!("folders {CAMERA_PREFIX}00 and on, or one image for each of {}", counted(rows, "pose"));
        return Err(DatasetError::malformed(&poses.path, "rows", expected, count));
    }
    let photo = |(row, path)| FrameFile { path, row, time: None, camera: None, split: None };
    let found = rows::in_order(found, positions, &poses.path, options.row_order, findings);
    Ok(found.into_iter().enumerate().map(photo).collect())
}

/// Pose and lens of one row.
fn camera(row: &[f64], file: &Path, index: usize) -> Result<(DMat4, Lens), DatasetError> {
    let label = format!("row {index}");
    let at = |line: usize, column: usize| row[5 * line + column];
    let (height, width, focal) = (at(0, 4), at(1, 4), at(2, 4));
    let sound = [height, width].iter().all(|side| (1.0..=1e6).contains(side)) && focal > 0.0 && focal.is_finite();
    if !sound {
        let found = format!("height {}, width {}, focal length {}", number(height), number(width), number(focal));
        return Err(DatasetError::malformed(file, label, "an image size and a focal length in pixels", found));
    }
    // OpenCV's right, down and forward are LLFF's second, first and negated third column.
    let mut matrix = [[0.0, 0.0, 0.0, 0.0], [0.0; 4], [0.0; 4], [0.0, 0.0, 0.0, 1.0]];
    for (line, out) in matrix.iter_mut().take(3).enumerate() {
        *out = [at(line, 1), at(line, 0), -at(line, 2), at(line, 3)];
    }
    let c2w = pose::orthonormal(&matrix, file, &label)?.c2w;
    // The principal point is the middle of the photo, whatever its own size is.
    let lens = Lens::of([focal, focal, 0.0, 0.0], (width, height), Distortion::default());
    Ok((c2w, Lens { cx: None, cy: None, ..lens }))
}
