//! The folder that OmniVGGT takes: a text with the camera of each photo, and its depth as `depths/NAME.npy`. A network's own depth is often saved
//! in the same layout, with the cameras that it was given.

use std::path::{Path, PathBuf};

use glam::DMat3;
use gs_base::{counted, guarded, npy};

use super::prediction::{PredictedView, Prediction, VIEWS_MAX, known, unsaid};
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::formats::camera_texts::{self, CameraTexts, stem};
use crate::names::some_names;

/// The texts of a folder that holds depths too.
pub(super) fn find(path: &Path) -> Option<CameraTexts> {
    path.join("depths").is_dir().then(|| camera_texts::find(path)).flatten()
}

/// Reads every camera that has a depth; the others are left out with a warning. Depth is camera z in the unit of the cameras' positions.
///
/// # Errors
/// When a file cannot be read, when no camera has a depth, and when depths differ in size.
pub(super) fn read(texts: &CameraTexts, findings: &mut Findings) -> Result<Prediction, DatasetError> {
    let folder = texts.folder.join("depths");
    let depth_of = |file: &Path| folder.join(format!("{}.npy", stem(file)));
    let (with, without): (Vec<&PathBuf>, Vec<&PathBuf>) = texts.files.iter().partition(|file| depth_of(file).is_file());
    if !without.is_empty() {
        let names: Vec<String> = without.iter().map(|file| stem(file)).collect();
        let count = counted(names.len(), "camera");
        findings.warn(format!("{}: {count} without a depth left out ({})", folder.display(), some_names(&names)));
    }
    if !(1..=VIEWS_MAX).contains(&with.len()) {
        let expected = format!("depths (NAME.npy) of 1 to {VIEWS_MAX} cameras");
        return Err(DatasetError::malformed(&folder, "content", expected, with.len().to_string()));
    }
    let (mut views, mut size) = (Vec::with_capacity(with.len()), None);
    for file in &with {
        let path = depth_of(file);
        let array = npy::parse(&path, &guarded::read(&path, guarded::IMAGE_MAX)?)?;
        let shape = array.shape.clone();
        let wrong = |expected: String| DatasetError::malformed(&path, "shape", expected, format!("{shape:?}"));
        let (height, width) = match *array.shape.as_slice() {
            [height, width] | [1, height, width] | [height, width, 1] if height > 1 && width > 1 => (height, width),
            _ => return Err(wrong("one depth for each pixel, (H, W)".into())),
        };
        let (first_width, first_height) = *size.get_or_insert((width, height));
        if (width, height) != (first_width, first_height) {
            return Err(wrong(format!("({first_height}, {first_width}), as the first depth has")));
        }
        let camera = camera_texts::camera(file)?;
        let depth: Vec<f32> = array.values.iter().map(known).collect();
        views.push(PredictedView {
            rotation: DMat3::from_mat4(camera.c2w),
            centre: camera.c2w.w_axis.truncate(),
            // The intrinsics are of the photo, and no crop has to be guessed: a depth has the photo's proportions.
            focal: None,
            confidence: unsaid(&depth),
            depth,
        });
    }
    let names = with.iter().map(|file| stem(file)).collect();
    Ok(Prediction { views, size: size.unwrap_or((0, 0)), names: Some(names) })
}
