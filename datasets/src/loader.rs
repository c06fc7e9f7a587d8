//! [`load`]: describe a data set, then decode every frame of it in parallel.

use std::path::Path;
use std::sync::Arc;

use gs_base::statistics::range;
use gs_base::{clause, counted};
use rayon::prelude::*;

use crate::camera_path;
use crate::convention::PoseConvention;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::formats;
use crate::frame::{CameraPose, View};
use crate::log::Log;
use crate::names::some_names;
use crate::notes::{ViewNote, ViewsWithNotes, few_levels, off_photo_warning, say_depth, suspicion};
use crate::on_demand;
use crate::one_color;
use crate::options::LoadOptions;
use crate::priors::summary::{self, Noted};
use crate::scene::{Scene, Split};

/// Loads a scene: a folder with transforms.json or transforms_{train,val,test}.json, such a file itself, a folder with
/// a COLMAP model and its images, with train_meta.json (Panoptic), or with poses_bounds.npy (LLFF, N3DV).
///
/// Lens distortion is removed (keeping focal lengths and principal point; pixels that the photo does not show are
/// masked out), fisheye photos and panoramas become pinhole views, transparency is composited, images are downscaled to
/// `options.max_width` with an area filter, and the views are split; all views of a photo are in one split. Images
/// that do not exist are left out with a warning. Priors and truth beside the photos are loaded at the photos' training
/// size; one that is missing, broken or of another shape is left out with a warning.
///
/// Of a set larger than `options.memory` the headers are read, and at most 128 photos are decoded and checked
/// ([`surveyed`](crate::surveyed)). An error of another photo is a warning when it is asked for.
///
/// # Errors
/// When a file is missing, unreadable, cut off or contradicts its format; when a pose, point or intrinsic is not finite
/// or a pose is not rigid; when an image's proportions contradict its intrinsics; when a camera model is none of
/// those that are read, or folds inside the photo; when two views with different poses share a photo; when all training
/// photos have one colour; when no training view is left.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, DatasetError> {
    let (log, mut findings) = Log::describe(path, options)?;
    let log = Arc::new(log);
    let (mut views, notes) = match options.memory.filter(|bound| log.bytes() > *bound) {
        Some(bound) => on_demand::views(&log, bound)?,
        None => decoded(&log)?,
    };
    let trains: Vec<bool> = notes.iter().map(|(index, _)| log.frames()[*index].split == Split::TRAIN).collect();
    let notes: Vec<ViewNote> = notes.into_iter().map(|(_, note)| note).collect();
    let of_training = notes.iter().zip(&trains).filter(|(_, trains)| **trains);
    one_color::refuse(path, of_training.map(|(note, _)| note.one_color))?;
    summarise(path, &notes, &mut findings);
    findings.warn_all(few_levels(path, &notes, options.levels));
    say_depth(path, &notes, &mut findings);
    let noted: Vec<Noted> = notes
        .iter()
        .zip(&trains)
        .map(|(note, trains)| Noted { name: &note.name, trains: *trains, notes: &note.sides })
        .collect();
    summary::warn(path, &noted, &mut findings);
    findings.warn_all(log.disagreements());
    if summary::no_mask_marks_anything(&noted) {
        views.iter_mut().for_each(|view| view.priors.moving = None);
    }
    findings.log();
    let time_range = range(views.iter().filter_map(|view| view.time));
    let mut views = views.into_iter();
    let mut splits = log
        .splits()
        .map(|(name, frames)| Split { name: name.to_string(), views: views.by_ref().take(frames.len()).collect() });
    let train = splits.next().map_or_else(Vec::new, |split| split.views);
    let held_out = splits.collect();
    Ok(Scene {
        train,
        held_out,
        points: log.points().cloned(),
        origin: log.origin(),
        format: log.format(),
        poses: options.poses.unwrap_or(PoseConvention::of(log.format())),
        warnings: findings.take_warnings(),
        time_range,
    })
}

/// Reads cameras for rendering; images need not exist where the sizes are given.
///
/// Of a transforms.json file, in file order; in a folder, the first of transforms_render.json, transforms.json,
/// transforms_test.json and transforms_train.json. Of a folder with a COLMAP model, by name. Of a JSON file of key
/// frames, the path through them (see [`camera_path`]); of Inria's cameras.json and nerfstudio's camera_path.json,
/// their cameras.
///
/// # Errors
/// As [`load`], and when a frame has neither `w` and `h` nor an image to take the size from.
pub fn load_cameras(path: &Path) -> Result<Vec<CameraPose>, DatasetError> {
    load_cameras_by(path, None)
}

/// [`load_cameras`] of a file of a data set whose poses are read by a convention: those of transforms.json and of
/// COLMAP are read so too, and files of a camera path by their own.
///
/// # Errors
/// As [`load_cameras`].
pub fn load_cameras_by(path: &Path, poses: Option<PoseConvention>) -> Result<Vec<CameraPose>, DatasetError> {
    if path.is_dir()
        && formats::transforms::cameras_in(path).is_none()
        && let Some(files) = formats::colmap::find(path)
    {
        return formats::colmap::cameras(&files, poses);
    }
    if !path.is_dir()
        && let Some(cameras) = camera_path::in_file(path)?
    {
        return Ok(cameras);
    }
    formats::transforms::read_cameras(path, poses)
}

/// All views of a log, and their notes with their indices.
fn decoded(log: &Log) -> Result<ViewsWithNotes, DatasetError> {
    let decoded: Vec<Result<(View, ViewNote), DatasetError>> =
        (0..log.frames().len()).into_par_iter().map(|index| log.decode_noted(index, None)).collect();
    // Collected before looking for errors, so that the first one by name is reported and not the first by chance.
    let (views, notes): (Vec<View>, Vec<ViewNote>) =
        decoded.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    Ok((views, notes.into_iter().enumerate().collect()))
}

fn summarise(path: &Path, notes: &[ViewNote], findings: &mut Findings) {
    let rescaled: Vec<&ViewNote> = notes.iter().filter(|note| note.rescaled.is_some()).collect();
    if let Some(ViewNote { name, rescaled: Some(declared), size: actual, .. }) = rescaled.first() {
        findings.warn(format!(
            "{}: {} images of another size than their intrinsics, which were rescaled ({name}: declared {} x {}, \
             found {} x {})",
            path.display(),
            clause(rescaled.len(), "view", "has", "have"),
            declared.0,
            declared.1,
            actual.0,
            actual.1
        ));
    }
    findings.warn_all(off_photo_warning(path, notes));
    let blank: Vec<&str> = notes.iter().filter(|note| note.is_blank).map(|note| note.name.as_str()).collect();
    if !blank.is_empty() {
        findings.warn(format!(
            "{}: no pixel counts in {}, by their masks or their lens distortion ({})",
            path.display(),
            counted(blank.len(), "view"),
            some_names(&blank)
        ));
    }
    findings.warn_all(suspicion(path, notes));
}
