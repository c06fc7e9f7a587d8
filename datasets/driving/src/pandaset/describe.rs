//! Frames, cameras and images of a sequence.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};
use gs_base::{agree, counted};
use gs_datasets::{DatasetError, photo_size};

use super::{json, names};
use crate::description::{Camera, Description, Frame, Shot, centred, folder_name, without};
use crate::options::LogOptions;

/// A camera as its folder describes it.
struct Filmed {
    camera: Camera,
    folder: PathBuf,
    times: Vec<f64>,
    poses: Vec<DMat4>,
    images: BTreeMap<usize, String>,
}

/// Describes the sequence in a folder.
pub(crate) fn describe(folder: &Path, options: &LogOptions) -> Result<Description, DatasetError> {
    let lidar = folder.join(names::LIDAR);
    let (times_file, poses_file) = (lidar.join("timestamps.json"), lidar.join("poses.json"));
    let (times, egos) = (json::timestamps(&times_file)?, json::poses(&poses_file)?);
    let sweeps: BTreeMap<usize, String> = names::pickles(&lidar).into_iter().collect();
    let mut warnings = Vec::new();
    let (mut filmed, mut empty) = (Vec::new(), Vec::new());
    for (name, ego_rows) in names::CAMERAS.into_iter().filter(|(name, _)| options.cameras.takes(name)) {
        match film(folder, name, ego_rows, options)? {
            Some(camera) => filmed.push(camera),
            // A log that was written or downloaded with fewer cameras has no such folder.
            None if names::has_camera(folder, name) => empty.push(name),
            None => {}
        }
    }
    warnings.extend(without("an image", "camera", &empty));
    let mut stems = sweeps.clone();
    filmed.iter().for_each(|camera| stems.extend(camera.images.iter().map(|(index, stem)| (*index, stem.clone()))));
    let Some((first, _)) = stems.first_key_value() else {
        let found = "no pickled sweep and no image".to_string();
        return Err(DatasetError::NoFrames { path: folder.to_path_buf(), found });
    };
    let short = |path: &Path, count: usize, index: usize| {
        let found = format!("{count} {}", agree(count, "entry", "entries"));
        DatasetError::malformed(path, "the list", format!("an entry {index} for the frame of that number"), found)
    };
    let last = stems.last_key_value().map_or(*first, |entry| *entry.0);
    for (path, count) in [(&times_file, times.len()), (&poses_file, egos.len())] {
        if last >= count {
            return Err(short(path, count, last));
        }
    }
    let indices: Vec<usize> = stems.keys().copied().collect();
    ascending(&times_file, &times, &indices)?;
    let origin = egos[*first].w_axis.truncate();
    for camera in &filmed {
        let used: Vec<usize> = camera.images.keys().copied().collect();
        ascending(&camera.folder.join("timestamps.json"), &camera.times, &used)?;
    }
    let frames = stems.iter().map(|(index, stem)| Frame {
        name: stem.clone(),
        time: times[*index],
        has_sweep: sweeps.contains_key(index),
        ego: centred(egos[*index], origin),
    });
    let shots = indices.iter().map(|index| filmed.iter().map(|camera| camera.shot(*index, origin)).collect());
    let silent: Vec<&str> =
        stems.iter().filter(|(index, _)| !sweeps.contains_key(index)).map(|(_, stem)| stem.as_str()).collect();
    warnings.extend(without("a sweep", "frame", &silent));
    Ok(Description {
        name: folder_name(folder),
        origin,
        frames: frames.collect(),
        shots: shots.collect(),
        cameras: filmed.into_iter().map(|filmed| filmed.camera).collect(),
        warnings,
    })
}

/// Fails unless the times at these places ascend.
fn ascending(path: &Path, times: &[f64], indices: &[usize]) -> Result<(), DatasetError> {
    for pair in indices.windows(2) {
        let (before, after) = (times.get(pair[0]), times.get(pair[1]));
        if let (Some(before), Some(after)) = (before, after)
            && after <= before
        {
            let expected = format!("a time after {before}, that of entry {}", pair[0]);
            return Err(DatasetError::malformed(path, format!("entry {}", pair[1]), expected, after.to_string()));
        }
    }
    Ok(())
}

/// Describes one camera; `None` where it has no image.
fn film(sequence: &Path, name: &str, ego_rows: usize, options: &LogOptions) -> Result<Option<Filmed>, DatasetError> {
    let folder = sequence.join(names::CAMERA).join(name);
    let images: BTreeMap<usize, String> = names::stems(&folder, &[".jpg", ".jpeg", ".png"]).into_iter().collect();
    let Some((_, first)) = images.first_key_value() else { return Ok(None) };
    let [(width, height), full] = photo_size(&image_file(&folder, first), options.max_width)?;
    let scale = (width as f64 / full.0 as f64, height as f64 / full.1 as f64);
    let intrinsics = json::intrinsics(&folder.join("intrinsics.json"))?.scaled(scale.0, scale.1);
    let camera = Camera {
        name: name.to_string(),
        width,
        height,
        intrinsics,
        ego_rows: (ego_rows * height).div_ceil(names::EGO_ROWS_OF),
    };
    let (times, poses) = (json::timestamps(&folder.join("timestamps.json"))?, json::poses(&folder.join("poses.json"))?);
    if let Some((last, _)) = images.last_key_value()
        && *last >= times.len().min(poses.len())
    {
        let found = format!("{} and {}", counted(times.len(), "time"), counted(poses.len(), "pose"));
        return Err(DatasetError::malformed(
            &folder,
            "timestamps.json and poses.json",
            format!("an entry {last} for the last image"),
            found,
        ));
    }
    Ok(Some(Filmed { camera, folder, times, poses, images }))
}

/// The image of a stem; a JPEG where none is found, so that the message about the missing file names it.
fn image_file(folder: &Path, stem: &str) -> PathBuf {
    let known = [".jpg", ".jpeg", ".png"].map(|end| folder.join(format!("{stem}{end}")));
    known.iter().find(|path| path.exists()).unwrap_or(&known[0]).clone()
}

impl Filmed {
    fn shot(&self, index: usize, origin: DVec3) -> Option<Shot> {
        let image = self.images.get(&index).map(|stem| image_file(&self.folder, stem));
        Some(Shot { time: *self.times.get(index)?, c2w: centred(*self.poses.get(index)?, origin), image })
    }
}
