//! [`import`]: the output of a feed-forward reconstructor (VGGT, OmniVGGT) as priors of a calibrated data set.
//!
//! ```text
//! arrays.rs        .npz archives and folders of .npy files      texts.rs     their arrays of names
//! prediction.rs    the dictionary: cameras, depth, confidence      given.rs     the same from texts and a depth for each photo
//! naming.rs        which view of the data set each predicted view is
//! window.rs        processed pixels and photo pixels            view.rs      a prediction on its photo
//! similarity.rs    predicted cameras to known ones
//! pairs.rs         pixels of one view in others
//! align.rs         scale and shift of each view's depth         solve.rs     normal equations
//! write.rs         side folders, or a new folder                points.rs    the union of points
//! descriptions.rs  the JSON in a new folder                     report.rs    what was done
//! ```
//!
//! Predicted cameras give the scale and are then thrown away: depth is placed by the known intrinsics and poses.

mod align;
mod arrays;
mod descriptions;
mod given;
mod naming;
mod pairs;
mod points;
mod prediction;
mod report;
mod similarity;
mod solve;
mod texts;
mod view;
mod window;
mod write;

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use glam::DVec3;
use gs_base::{guarded, median};
use rayon::prelude::*;

use self::align::{Alignment, align};
use self::pairs::Pairs;
use self::prediction::Prediction;
use self::similarity::{Placed, Similarity};
use self::view::{MappedView, Photo};
use self::write::{Target, Written};
use crate::description::Description;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::formats::{self, Layout};
use crate::options::LoadOptions;
use crate::raw::RawFrame;

pub use report::{ImportReport, ImportedView};
pub use similarity::CameraResidual;
pub use window::Fit;

/// Median angle between predicted and known orientations, degrees, from which views are taken to be in another order: networks are
/// right to a few degrees, and two neighbours of five cameras around an object are 72 degrees apart.
const ANGLE_MAX: f64 = 30.0;

/// Options of [`import`].
#[derive(Debug, Clone, PartialEq)]
pub struct ImportOptions {
    /// Names of the data set's views, or of their cameras at the first time, in the order of the prediction. Empty: those in the archive,
    /// else the training views of the first time.
    pub views: Vec<String>,
    /// A text file with one name or path a line, instead of `views`.
    pub images: Option<PathBuf>,
    /// A new folder for priors and a copy of the description; `None` writes beside the photos.
    pub out: Option<PathBuf>,
    /// How photos were fitted into the processed size.
    pub fit: Fit,
    /// Share of the pixels, those of the highest confidence, that become points; above 0 and at most 1.
    pub keep: f64,
    /// Most points, at least 1.
    pub max_points: usize,
    /// Whether depth is also fitted to the points of a set that is no COLMAP model. They may be an earlier prediction.
    pub use_points: bool,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self {
            views: Vec::new(),
            images: None,
            out: None,
            fit: Fit::Auto,
            keep: 0.8,
            max_points: 200_000,
            use_points: false,
        }
    }
}

/// A data set's frames and what is known about their depth.
struct Known {
    layout: Layout,
    frames: Vec<RawFrame>,
    points: Vec<DVec3>,
}

/// Writes depth, confidence and points of a reconstruction as priors of the data set at `dataset`. `reconstruction` is a `.npz` archive or
/// a folder of `.npy` files with the keys of VGGT: `extrinsic` or `pose_enc`, `depth` or `world_points`, and if present `intrinsic`,
/// `depth_conf`, `image_names`; or a folder with `cameras/NAME.txt` and `depths/NAME.npy` beside `images`, as OmniVGGT takes it.
///
/// # Errors
/// When the reconstruction or the data set cannot be read, when views cannot be told, when known or predicted cameras give no scale, and
/// when a file cannot be written.
pub fn import(reconstruction: &Path, dataset: &Path, options: &ImportOptions) -> Result<ImportReport, DatasetError> {
    check(dataset, options)?;
    let mut findings = Findings::default();
    let known = describe(dataset, options, &mut findings)?;
    let target = Target::check(options.out.as_deref(), dataset, &known.layout, &known.frames)?;
    let prediction = match given::find(reconstruction) {
        Some(texts) => given::read(&texts, &mut findings)?,
        None => prediction::read(reconstruction, &mut findings)?,
    };
    let names = names(&prediction, options)?;
    let assigned = naming::assign(names.as_deref(), prediction.views.len(), &known.frames, dataset)?;
    let mut views = mapped(&prediction, &assigned, &known.frames, options, reconstruction)?;
    let cameras: Vec<Placed> =
        prediction.views.iter().map(|view| Placed { rotation: view.rotation, centre: view.centre }).collect();
    drop(prediction);
    let (similarity, residuals) = placed(&cameras, &views, reconstruction)?;
    let pairs = Pairs::new(&views);
    let anchors = pairs.anchors(&known.points);
    let aligned = align(&pairs, similarity.scale, &anchors);
    apply(&mut views, &aligned);
    let share = (options.keep, options.max_points);
    let written = target.write(&views, &assigned, &known.frames, &known.layout, share)?;
    let warnings = findings.take_warnings();
    Ok(report(&similarity, &residuals, &views, &aligned, anchors.len(), written, warnings))
}

fn check(dataset: &Path, options: &ImportOptions) -> Result<(), DatasetError> {
    let wrong = |option: &'static str, expected: &str, found: String| {
        Err(DatasetError::Option { path: dataset.to_path_buf(), option, expected: expected.to_string(), found })
    };
    if !(options.keep > 0.0 && options.keep <= 1.0) {
        return wrong("keep", "a share above 0 and at most 1", options.keep.to_string());
    }
    if options.max_points == 0 {
        return wrong("max_points", "at least 1 point", "0".to_string());
    }
    if !options.views.is_empty() && options.images.is_some() {
        return wrong("views", "either names or a file of names (images)", "both".to_string());
    }
    Ok(())
}

fn describe(dataset: &Path, options: &ImportOptions, findings: &mut Findings) -> Result<Known, DatasetError> {
    let load = LoadOptions { recentre: false, ..LoadOptions::default() };
    let layout = formats::detect(dataset)?;
    let raw = formats::read(dataset, &load, findings)?;
    let description = Description::of(raw, dataset, &load, findings)?;
    let is_measured = options.use_points || matches!(layout, Layout::Colmap(_));
    let points = description.points.filter(|_| is_measured).map_or_else(Vec::new, |points| points.positions);
    Ok(Known { layout, frames: description.frames, points })
}

/// The names of predicted views: the user's, else the archive's.
fn names(prediction: &Prediction, options: &ImportOptions) -> Result<Option<Vec<String>>, DatasetError> {
    if let Some(file) = &options.images {
        let text = guarded::read_to_string(file, guarded::DESCRIPTION_MAX)?;
        let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
        return Ok(Some(lines.map(String::from).collect()));
    }
    let typed = (!options.views.is_empty()).then(|| options.views.clone());
    Ok(typed.or_else(|| prediction.names.clone()))
}

/// Every predicted view on its photo.
fn mapped(
    prediction: &Prediction,
    assigned: &[usize],
    frames: &[RawFrame],
    options: &ImportOptions,
    reconstruction: &Path,
) -> Result<Vec<MappedView>, DatasetError> {
    let one = |(view, frame): (&prediction::PredictedView, &usize)| {
        let frame = &frames[*frame];
        let photo = Photo::open(frame)?;
        let k = photo.intrinsics;
        let focal = view.focal.map(|(x, y)| (k.fx / x, k.fy / y));
        let window = window::window(options.fit, photo.size(), prediction.size, focal, reconstruction)?;
        Ok(MappedView::new(frame, &photo, view, prediction.size, window))
    };
    let views: Vec<Result<MappedView, DatasetError>> = prediction.views.par_iter().zip(assigned).map(one).collect();
    // Collected first, so that the error of the first view is reported and not of the fastest.
    views.into_iter().collect()
}

/// The similarity of the cameras, if they are those of the data set.
fn placed(
    predicted: &[Placed],
    views: &[MappedView],
    reconstruction: &Path,
) -> Result<(Similarity, Vec<CameraResidual>), DatasetError> {
    let known: Vec<Placed> = views.iter().map(|view| view.placed).collect();
    let wrong = |expected: &str, found: String| DatasetError::malformed(reconstruction, "cameras", expected, found);
    let found = similarity::fit(predicted, &known).ok_or_else(|| {
        let expected =
            "at least two views whose known and predicted centres differ in the same way, since they give the scale";
        wrong(expected, "others".to_string())
    })?;
    let angle = median(found.1.iter().map(|residual| residual.angle).collect()).unwrap_or(0.0);
    if angle > ANGLE_MAX {
        let expected = "views in the order that --views or --images says, or of the data set's names";
        return Err(wrong(expected, format!("orientations that differ by {angle:.0} degrees in the median view")));
    }
    Ok(found)
}

/// Brings all depths to scene units. What is then not in front of its camera is unknown.
fn apply(views: &mut [MappedView], aligned: &Alignment) {
    for (view, fit) in views.iter_mut().zip(&aligned.fits) {
        for (depth, confidence) in view.depth.iter_mut().zip(&mut view.confidence).filter(|(depth, _)| **depth > 0.0) {
            *depth = fit.apply(f64::from(*depth)).max(0.0) as f32;
            *confidence = if *depth > 0.0 { *confidence } else { 1.0 };
        }
    }
}

fn report(
    similarity: &Similarity,
    residuals: &[CameraResidual],
    views: &[MappedView],
    aligned: &Alignment,
    anchors: usize,
    written: Written,
    warnings: Vec<String>,
) -> ImportReport {
    let one = |((view, camera), fit): ((&MappedView, &CameraResidual), &pairs::DepthFit)| ImportedView {
        name: view.name.clone(),
        camera: *camera,
        scale: fit.scale / similarity.scale,
        shift: fit.shift,
        known: view.depth.iter().filter(|depth| **depth > 0.0).count() as f64 / view.depth.len().max(1) as f64,
    };
    let trace = similarity.rotation.x_axis.x + similarity.rotation.y_axis.y + similarity.rotation.z_axis.z;
    ImportReport {
        scale: similarity.scale,
        turn: (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos().to_degrees(),
        shift: similarity.shift.to_array(),
        factor: aligned.factor,
        views: views.iter().zip(residuals).zip(&aligned.fits).map(one).collect(),
        disagreement: aligned.before.zip(aligned.after),
        compared: aligned.matches,
        anchors,
        points: written.points,
        written: written.sentence,
        warnings,
    }
}
