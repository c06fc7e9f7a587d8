//! A photo's side files at training size.

use std::path::Path;

use super::depth;
use crate::behind::Behind;
use crate::error::DatasetError;
use crate::frame::{DepthPrior, DepthSpace, Priors, RgbImage8, Truth};
use crate::map::{Map, same_shape};
use crate::options::DepthKind;
use crate::pixels;
use crate::resample::resample;
use crate::side_files::{DepthMeaning, Kind, SideFile, SideFiles};

/// Size and treatment of the photo that the files belong to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PhotoShape {
    /// Width and height of the file, pixels.
    pub size: (usize, usize),
    /// Width and height to load at.
    pub target: (usize, usize),
    /// Its lens distortion is removed, or pinhole views are made of it.
    pub undistorted: bool,
    pub behind: Behind,
}

/// Why a file was not used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Reason {
    /// There is none.
    Missing,
    /// Its proportions, or too few pixels; the sizes in words.
    Size(String),
    /// It cannot be read.
    Broken(String),
    /// The photo's lens distortion is removed, or it is resampled to pinhole views; the file is not.
    Distorted,
    /// A depth map without two values that differ.
    Flat,
}

/// Files that were used and left out, for sentences about many photos.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct SideNotes {
    pub used: Vec<Kind>,
    pub left_out: Vec<(Kind, Reason)>,
    /// Kinds whose size was not the photo's.
    pub resampled: Vec<Kind>,
    /// Space and metric of the depth prior, and whether both were guessed.
    pub depth: Option<(DepthSpace, bool, bool)>,
    /// Share of the photo that the mask of moving objects marks.
    pub moving_share: Option<f64>,
}

/// Everything beside one photo.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Attached {
    pub priors: Priors,
    pub truth: Truth,
    pub notes: SideNotes,
}

/// Loads all side files of a photo. Depth, velocity and masks take the nearest pixel, images an area mean.
pub(crate) fn attach(files: &SideFiles, photo: &PhotoShape) -> Attached {
    let mut attached = Attached::default();
    for file in &files.files {
        match load(file, files.depth, photo, &mut attached) {
            Ok(()) => attached.notes.used.push(file.kind),
            Err(reason) => attached.notes.left_out.push((file.kind, reason)),
        }
    }
    attached
}

fn load(file: &SideFile, meaning: DepthMeaning, photo: &PhotoShape, into: &mut Attached) -> Result<(), Reason> {
    let path = file.path.as_deref().filter(|path| path.exists()).ok_or(Reason::Missing)?;
    if photo.undistorted {
        return Err(Reason::Distorted);
    }
    let (priors, truth) = (&mut into.priors, &mut into.truth);
    match file.kind {
        Kind::Depth => {
            let depth = depth::depth(path, meaning).map_err(broken)?;
            into.notes.depth = Some((depth.space, depth.metric, depth.guessed));
            let values = fit(depth.map, file.kind, photo, &mut into.notes)?;
            if is_flat(&values) {
                return Err(Reason::Flat);
            }
            priors.depth = Some(DepthPrior { values, space: depth.space, metric: depth.metric });
        }
        Kind::Confidence => {
            let map = depth::confidence(path).map_err(broken)?;
            priors.confidence = Some(fit(map, file.kind, photo, &mut into.notes)?);
        }
        Kind::Moving => {
            let map = depth::objects(path).map_err(broken)?;
            let moving = fit(map, file.kind, photo, &mut into.notes)?;
            let marked = moving.iter().filter(|value| **value > 0).count();
            into.notes.moving_share = Some(marked as f64 / moving.len().max(1) as f64);
            priors.moving = Some(moving);
        }
        Kind::Sharp => priors.sharp = Some(picture(path, photo)?),
        Kind::TrueSharp => truth.sharp = Some(picture(path, photo)?),
        Kind::TrueBlurry => truth.blurry = Some(picture(path, photo)?),
        Kind::TrueDepth => {
            let exact = DepthMeaning { kind: Some(DepthKind::MetricZ), ..meaning };
            let map = depth::depth(path, exact).map_err(broken)?.map;
            truth.depth = Some(fit(map, file.kind, photo, &mut into.notes)?);
        }
        Kind::TrueVelocity => {
            let map = depth::vectors(path).map_err(broken)?;
            truth.velocity = Some(fit(map, file.kind, photo, &mut into.notes)?);
        }
        Kind::TrueMoving | Kind::TrueMovingUnion => {
            let map = depth::objects(path).map_err(broken)?;
            let to = if file.kind == Kind::TrueMoving { &mut truth.moving } else { &mut truth.moving_union };
            *to = Some(fit(map, file.kind, photo, &mut into.notes)?);
        }
    }
    Ok(())
}

/// Whether a depth prior says nothing: its known values (finite, above 0) are one, or none.
fn is_flat(values: &[f32]) -> bool {
    let mut known = values.iter().filter(|value| value.is_finite() && **value > 0.0);
    let Some(first) = known.next() else { return true };
    known.all(|value| value == first)
}

fn broken(error: DatasetError) -> Reason {
    Reason::Broken(error.to_string())
}

/// A map at training size; an error when it is no picture of the photo's view.
fn fit<T: Copy>(map: Map<T>, kind: Kind, photo: &PhotoShape, notes: &mut SideNotes) -> Result<Vec<T>, Reason> {
    if !same_shape(map.size(), photo.size) {
        return Err(wrong_size(map.size(), photo.size));
    }
    if map.size() != photo.size {
        notes.resampled.push(kind);
    }
    Ok(map.nearest(photo.target))
}

/// An image at training size. It may be smaller than the photo's file but not than the training image: enlarged, it
/// would be blurred by the enlargement, and how sharp it is is all it is there for.
fn picture(path: &Path, photo: &PhotoShape) -> Result<RgbImage8, Reason> {
    let image = pixels::open(path, photo.behind).map_err(broken)?;
    let size = image.size();
    let (width, height) = photo.target;
    if !same_shape(size, photo.size) || size.0 < width || size.1 < height {
        return Err(wrong_size(size, photo.size));
    }
    let (data, ..) = resample(image, &[], None, photo.target);
    Ok(RgbImage8 { width, height, data })
}

fn wrong_size(found: (usize, usize), photo: (usize, usize)) -> Reason {
    Reason::Size(format!("{} x {} pixels beside a photo of {} x {}", found.0, found.1, photo.0, photo.1))
}
