//! [`load`]: read the description, split, then decode, undistort and resize every photo in parallel.

use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;

use crate::consistency;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::formats;
use crate::frame::{CameraPose, RgbImage8, View};
use crate::lens::off_photo_warning;
use crate::mask::{self, Mask};
use crate::names::{self, some_names};
use crate::options::{LoadOptions, RECENTRE_DISTANCE};
use crate::pixels::{self, Behind};
use crate::priors::attach::{self, attach};
use crate::priors::summary::{self, Noted};
use crate::raw::{RawFrame, RawPoints};
use crate::resample::resample;
use crate::resize::target_size;
use crate::scene::{PointCloud, Scene, Split};
use crate::split;
use crate::statistics::{mean, range};
use crate::undistort::Undistortion;

/// Loads a scene: a folder with transforms.json or transforms_{train,val,test}.json, such a file itself, a folder with a
/// COLMAP model and its images, with train_meta.json (Panoptic), or with poses_bounds.npy (LLFF, N3DV).
///
/// Lens distortion is removed (keeping focal lengths and principal point; pixels that the photo does not show are masked
/// out), transparency is composited, images are downscaled to `options.max_width` with an area filter, and the views
/// are split. Images that do not exist are left out with a warning. Priors and truth beside the photos are loaded at the
/// photos' training size; one that is missing, broken or of another shape is left out with a warning.
///
/// # Errors
/// When a file is missing, unreadable, cut off or contradicts its format; when a pose, point or intrinsic is not finite
/// or a pose is not rigid; when an image's proportions contradict its intrinsics; when a camera model is not a pinhole
/// with radial and tangential distortion; when no training view is left.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, DatasetError> {
    check_options(path, options)?;
    let mut findings = Findings::default();
    let raw = formats::read(path, options, &mut findings)?;
    let frames = sort_and_name(raw.frames, &mut findings);
    let mut frames = consistency::settle(frames, path, options, &mut findings);
    let origin = origin(&frames, options);
    let behind = behind(&frames, options);
    let plan = split::plan(&frames, &options.holdout, options.splits, path)?;
    if !plan.held_out.is_empty() && !options.training_truth {
        for index in &plan.train {
            frames[*index].sides.files.retain(|file| file.kind.is_prior());
        }
    }
    let train: Vec<&RawFrame> = plan.train.iter().map(|index| &frames[*index]).collect();
    let held_out: Vec<&RawFrame> = plan.held_out_frames().map(|index| &frames[index]).collect();
    let parting = consistency::compare_parts(&train, &held_out, path);
    let (mut train, mut notes) = load_views(&train, options, behind, origin)?;
    let (mut views, more) = load_views(&held_out, options, behind, origin)?;
    tracing::info!("{}: {} training views, held out: {} ({})", path.display(), train.len(), plan.counts(), plan.rule);
    let trains = notes.len();
    notes.extend(more);
    summarise(path, &notes, &mut findings);
    let noted: Vec<Noted> = notes
        .iter()
        .enumerate()
        .map(|(i, note)| Noted { name: &note.name, trains: i < trains, notes: &note.sides })
        .collect();
    summary::warn(path, &noted, &mut findings);
    findings.warnings.extend(parting);
    if summary::no_mask_marks_anything(&noted) {
        train.iter_mut().chain(&mut views).for_each(|view| view.priors.moving = None);
    }
    for fact in &findings.facts {
        tracing::info!("{fact}");
    }
    views.iter_mut().for_each(compare_with_sharp);
    let time_range = range(train.iter().chain(&views).filter_map(|view| view.time));
    for warning in &findings.warnings {
        tracing::warn!("{warning}");
    }
    let mut views = views.into_iter();
    let held_out = plan
        .held_out
        .into_iter()
        .map(|(name, list)| Split { name, views: views.by_ref().take(list.len()).collect() })
        .collect();
    Ok(Scene {
        train,
        held_out,
        points: raw.points.map(|points| point_cloud(&points, origin)).filter(|points| !points.is_empty()),
        origin,
        format: raw.format,
        warnings: findings.warnings,
        time_range,
    })
}

/// Reads the cameras of a transforms.json file for rendering, in file order; images need not exist if the file gives
/// `w` and `h`. In a folder, the first of transforms_render.json, transforms.json, transforms_test.json and
/// transforms_train.json is read.
///
/// # Errors
/// As [`load`], and when a frame has neither `w` and `h` nor an image to take the size from.
pub fn load_cameras(path: &Path) -> Result<Vec<CameraPose>, DatasetError> {
    formats::transforms::read_cameras(path)
}

pub(crate) fn check_options(path: &Path, options: &LoadOptions) -> Result<(), DatasetError> {
    let wrong = |option: &'static str, expected: &str, found: String| {
        Err(DatasetError::Option { path: path.to_path_buf(), option, expected: expected.to_string(), found })
    };
    if options.max_width == Some(0) {
        return wrong("max_width", "a width of at least 1 pixel", "0".to_string());
    }
    if let Some(exposure) = options.exposure
        && !(exposure > 0.0 && exposure.is_finite())
    {
        return wrong("exposure", "a duration above 0, in the unit of time", exposure.to_string());
    }
    if options.background.iter().any(|value| !(0.0..=1.0).contains(value)) {
        return wrong("background", "values from 0 to 1", format!("{:?}", options.background));
    }
    Ok(())
}

/// Sorts by name as every published split does, drops repeated frames and makes names unique.
pub(crate) fn sort_and_name(mut frames: Vec<RawFrame>, findings: &mut Findings) -> Vec<RawFrame> {
    frames.sort_by(|a, b| a.name.cmp(&b.name).then_with(|| a.image_path.cmp(&b.image_path)));
    let mut repeated = Vec::new();
    frames.dedup_by(|later, first| {
        let same = later.image_path == first.image_path && later.time == first.time;
        if same {
            repeated.push(later.name.clone());
            first.part = std::cmp::min(first.part.take(), later.part.take());
        }
        same
    });
    if !repeated.is_empty() {
        findings.warn(format!(
            "{} frames are listed more than once; the first of each was kept ({})",
            repeated.len(),
            some_names(&repeated)
        ));
    }
    names::make_unique(frames.iter_mut().map(|frame| &mut frame.name));
    frames
}

pub(crate) fn origin(frames: &[RawFrame], options: &LoadOptions) -> DVec3 {
    let centres: Vec<DVec3> = frames.iter().map(|frame| frame.c2w.w_axis.truncate()).collect();
    match mean(&centres) {
        Some(mean) if options.recentre && mean.length() > RECENTRE_DISTANCE => mean,
        _ => DVec3::ZERO,
    }
}

/// What is behind transparent pixels; of a set with exposures all are shares of light, of its sharp photos too.
pub(crate) fn behind(frames: &[RawFrame], options: &LoadOptions) -> Behind {
    Behind { color: options.background, is_light: frames.iter().any(|frame| frame.exposure.is_some_and(|e| e > 0.0)) }
}

fn point_cloud(points: &RawPoints, origin: DVec3) -> PointCloud {
    PointCloud {
        positions: points.positions.iter().map(|position| (*position - origin).as_vec3().to_array()).collect(),
        colors: points.colors.clone(),
    }
}

/// What loading one view found, for warnings about many.
struct Note {
    name: String,
    /// Declared and actual size, where intrinsics were rescaled.
    rescaled: Option<((f64, f64), (usize, usize))>,
    /// Share of the photo that mask files ignore; `None` without one.
    masked: Option<f64>,
    off_photo: bool,
    /// No pixel of the view counts.
    is_blank: bool,
    sides: attach::Notes,
}

fn load_views(
    frames: &[&RawFrame],
    options: &LoadOptions,
    behind: Behind,
    origin: DVec3,
) -> Result<(Vec<View>, Vec<Note>), DatasetError> {
    let loaded: Vec<Result<(View, Note), DatasetError>> =
        frames.par_iter().map(|frame| load_view(frame, options, behind, origin)).collect();
    // Collected before looking for errors, so that the first one by name is reported and not the first by chance.
    loaded.into_iter().collect::<Result<Vec<_>, _>>().map(|pairs| pairs.into_iter().unzip())
}

fn load_view(
    frame: &RawFrame,
    options: &LoadOptions,
    behind: Behind,
    origin: DVec3,
) -> Result<(View, Note), DatasetError> {
    let photo = pixels::open(&frame.image_path, behind)?;
    let size = photo.size();
    let resolved = frame.lens.resolve((size.0 as u32, size.1 as u32), &frame.image_path, &frame.file)?;
    let masks: Vec<Mask> = frame.masks.iter().map(|file| Mask::open(file, size)).collect::<Result<_, _>>()?;
    let undistortion = Undistortion::new(frame.lens.distortion, resolved.intrinsics, size);
    let target = target_size(size, options.max_width);
    let masked = (!masks.is_empty()).then(|| mask::ignored_share(&masks, size));
    let (data, mask) = resample(photo, &masks, undistortion.as_ref(), target);
    let (scale_x, scale_y) = (target.0 as f64 / size.0 as f64, target.1 as f64 / size.1 as f64);
    let mut c2w = frame.c2w;
    c2w.w_axis -= origin.extend(0.0);
    let image = RgbImage8 { width: target.0, height: target.1, data };
    let photo = attach::Photo { size, target, undistorted: undistortion.is_some(), behind };
    let sides = attach(&frame.sides, &photo);
    let is_blank = mask.as_ref().is_some_and(|mask| mask.iter().all(|keep| *keep == 0));
    let view = View {
        name: frame.name.clone(),
        image_path: frame.image_path.clone(),
        time: frame.time,
        camera_id: frame.camera_id.clone(),
        mask,
        exposure: frame.exposure,
        priors: sides.priors,
        truth: sides.truth,
        ..View::new(c2w, resolved.intrinsics.scaled(scale_x, scale_y), image)
    };
    let rescaled = resolved.rescaled_from.map(|declared| (declared, size));
    Ok((
        view,
        Note {
            name: frame.name.clone(),
            rescaled,
            off_photo: resolved.off_photo,
            masked,
            is_blank,
            sides: sides.notes,
        },
    ))
}

/// Where a held-out view is blurry and the sharp truth of it is known, that is what a sharp scene is measured against.
fn compare_with_sharp(view: &mut View) {
    if let Some(sharp) = view.truth.sharp.take() {
        let blurry = std::mem::replace(&mut view.image, sharp);
        view.truth.blurry.get_or_insert(blurry);
    }
}

fn summarise(path: &Path, notes: &[Note], findings: &mut Findings) {
    let rescaled: Vec<&Note> = notes.iter().filter(|note| note.rescaled.is_some()).collect();
    if let Some(Note { name, rescaled: Some((declared, actual)), .. }) = rescaled.first() {
        findings.warn(format!(
            "{}: the images of {} views have another size than their intrinsics, which were rescaled \
             ({name}: declared {} x {}, found {} x {})",
            path.display(),
            rescaled.len(),
            declared.0,
            declared.1,
            actual.0,
            actual.1
        ));
    }
    let off_photo: Vec<&str> = notes.iter().filter(|note| note.off_photo).map(|note| note.name.as_str()).collect();
    findings.warnings.extend(off_photo_warning(path, &off_photo));
    let blank: Vec<&str> = notes.iter().filter(|note| note.is_blank).map(|note| note.name.as_str()).collect();
    if !blank.is_empty() {
        findings.warn(format!(
            "{}: no pixel counts in {} views, by their masks or their lens distortion ({})",
            path.display(),
            blank.len(),
            some_names(&blank)
        ));
    }
    let masked = notes.iter().filter_map(|note| note.masked).collect();
    findings.warnings.extend(mask::suspicion(path, masked));
}
