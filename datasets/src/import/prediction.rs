//! The dictionary of VGGT and OmniVGGT: predicted cameras, depth and confidence of some views. [`given`](super::given) reads the same from
//! texts.

use std::path::Path;

use glam::{DMat3, DQuat, DVec3};
use gs_base::npy::Array;

use super::arrays::Arrays;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::priors::depth::SKY;

/// Keys under which users save the photos' names, best first. The reconstructors themselves write none.
const NAME_KEYS: [&str; 6] = ["image_names", "image_paths", "images_paths", "image_files", "names", "paths"];

/// Most views of one reconstruction: their depth takes nearly the 2^26 values that an array may have.
pub(super) const VIEWS_MAX: usize = 512;

/// Views as a feed-forward reconstructor gives them.
#[derive(Debug, Clone)]
pub(super) struct Prediction {
    pub views: Vec<PredictedView>,
    /// Width and height of the processed images, pixels.
    pub size: (usize, usize),
    /// Names or paths of the photos, where they were saved.
    pub names: Option<Vec<String>>,
}

/// One view. Its world is the reconstructor's own, of unknown scale.
#[derive(Debug, Clone)]
pub(super) struct PredictedView {
    /// Rotation from camera (OpenCV axes) to world.
    pub rotation: DMat3,
    pub centre: DVec3,
    /// Horizontal and vertical focal length, pixels of the processed image; `None` where none was saved.
    pub focal: Option<(f64, f64)>,
    /// `[height, width]` camera z; 0 where unknown.
    pub depth: Vec<f32>,
    /// `[height, width]`, at least 1. Without an array of confidences, 2 where there is a depth.
    pub confidence: Vec<f32>,
}

/// Confidence of a depth where none was saved. Any value above 1 says that something is known; equal values give equal weights.
const UNSAID: f32 = 2.0;

/// Reads the dictionary.
///
/// # Errors
/// When cameras or depth are missing, or when shapes contradict each other.
pub(super) fn read(path: &Path, findings: &mut Findings) -> Result<Prediction, DatasetError> {
    let mut arrays = Arrays::open(path, findings)?;
    let cameras = cameras(&mut arrays)?;
    let (size, depth) = depth(&mut arrays, &cameras)?;
    let focal = focal(&mut arrays, cameras.len(), size)?;
    let confidence = confidence(&mut arrays, cameras.len(), size)?;
    let mut names = None;
    for key in NAME_KEYS {
        names = names.or(arrays.texts(key)?);
    }
    let pixels = size.0 * size.1;
    let views = cameras.into_iter().enumerate().map(|(index, (rotation, centre))| {
        let range = index * pixels..(index + 1) * pixels;
        let depth: Vec<f32> = depth[range.clone()].iter().map(known).collect();
        let confidence = match &confidence {
            Some(all) => {
                all[range].iter().map(|value| if value.is_finite() { value.max(1.0) as f32 } else { 1.0 }).collect()
            }
            None => unsaid(&depth),
        };
        PredictedView { rotation, centre, focal: focal.as_ref().map(|focal| focal[index]), depth, confidence }
    });
    Ok(Prediction { views: views.collect(), size, names })
}

/// A depth; 0 where it is unknown or the sky. Beyond the range of f32 a value is infinite after conversion.
pub(super) fn known(value: &f64) -> f32 {
    Some(*value as f32).filter(|z| *z > 0.0 && *z < SKY).unwrap_or(0.0)
}

/// Confidences of depths without any.
pub(super) fn unsaid(depth: &[f32]) -> Vec<f32> {
    depth.iter().map(|depth| if *depth > 0.0 { UNSAID } else { 1.0 }).collect()
}

/// Rotation (camera to world) and centre of each view.
fn cameras(arrays: &mut Arrays) -> Result<Vec<(DMat3, DVec3)>, DatasetError> {
    let (key, cameras) = if let Some(array) = arrays.numbers("extrinsic")? {
        ("extrinsic", matrices(&array).ok_or(array.shape))
    } else if let Some(array) = arrays.numbers("pose_enc")? {
        ("pose_enc", encodings(&array).map(|rows| rows.iter().map(|row| decoded(row)).collect()).ok_or(array.shape))
    } else {
        let found = arrays.names().join(", ");
        let expected = "the key `extrinsic` or `pose_enc` of a VGGT dictionary";
        return Err(DatasetError::malformed(arrays.path(), "keys", expected, found));
    };
    let label = arrays.label(key);
    let wrong = |expected: &str, found: String| Err(DatasetError::malformed(&label, "shape", expected, found));
    let cameras: Vec<(DMat3, DVec3)> = match cameras {
        Ok(cameras) => cameras,
        Err(shape) => return wrong("(S, 3, 4) for `extrinsic` or (S, 9) for `pose_enc`", format!("{shape:?}")),
    };
    if !(1..=VIEWS_MAX).contains(&cameras.len()) {
        return wrong(&format!("1 to {VIEWS_MAX} views"), cameras.len().to_string());
    }
    for (index, (rotation, centre)) in cameras.iter().enumerate() {
        let deviation = rotation.transpose() * *rotation - DMat3::IDENTITY;
        let worst = deviation.to_cols_array().iter().fold(0.0_f64, |worst, value| worst.max(value.abs()));
        // Half-precision networks leave 1e-3; the comparison is false for NaN.
        if !(worst < 0.05 && rotation.determinant() > 0.0 && centre.is_finite()) {
            let expected = "a rotation and a finite translation from world to camera";
            let found = "something else".to_string();
            return Err(DatasetError::malformed(&label, format!("view {index}"), expected, found));
        }
    }
    Ok(cameras)
}

/// `(.., 3, 4)` or `(.., 4, 4)`, camera from world.
fn matrices(array: &Array) -> Option<Vec<(DMat3, DVec3)>> {
    let [.., rows @ (3 | 4), 4] = *array.shape.as_slice() else { return None };
    let camera = |m: &[f64]| {
        // The file's rows are the columns of the transpose, which is the rotation to world.
        let rotation =
            DMat3::from_cols(DVec3::new(m[0], m[1], m[2]), DVec3::new(m[4], m[5], m[6]), DVec3::new(m[8], m[9], m[10]));
        (rotation, -(rotation * DVec3::new(m[3], m[7], m[11])))
    };
    Some(array.values.chunks_exact(rows * 4).map(camera).collect())
}

/// Rows of `(.., 9)`: translation, quaternion x, y, z, w, vertical and horizontal field of view in radians.
fn encodings(array: &Array) -> Option<Vec<&[f64]>> {
    matches!(array.shape.as_slice(), [.., 9]).then(|| array.values.chunks_exact(9).collect())
}

fn decoded(row: &[f64]) -> (DMat3, DVec3) {
    let rotation = DMat3::from_quat(DQuat::from_xyzw(row[3], row[4], row[5], row[6]).normalize()).transpose();
    (rotation, -(rotation * DVec3::new(row[0], row[1], row[2])))
}

/// Width and height, and all views' depth one after another.
fn depth(arrays: &mut Arrays, cameras: &[(DMat3, DVec3)]) -> Result<((usize, usize), Vec<f64>), DatasetError> {
    let count = cameras.len();
    if let Some(array) = arrays.numbers("depth")? {
        let size = planes(&array.shape, count, 1);
        let label = arrays.label("depth");
        let expected = format!("({count}, H, W, 1), as there are {count} cameras");
        let size =
            size.ok_or_else(|| DatasetError::malformed(&label, "shape", expected, format!("{:?}", array.shape)))?;
        return Ok((size, array.values));
    }
    let Some(array) = arrays.numbers("world_points")? else {
        let expected = "the key `depth` or `world_points` of a VGGT dictionary";
        return Err(DatasetError::malformed(arrays.path(), "keys", expected, arrays.names().join(", ")));
    };
    let label = arrays.label("world_points");
    let expected = format!("({count}, H, W, 3), as there are {count} cameras");
    let size = planes(&array.shape, count, 3)
        .ok_or_else(|| DatasetError::malformed(&label, "shape", expected, format!("{:?}", array.shape)))?;
    let pixels = size.0 * size.1;
    let z = |(index, point): (usize, &[f64])| {
        let (rotation, centre) = cameras[index / pixels];
        (DVec3::new(point[0], point[1], point[2]) - centre).dot(rotation.z_axis)
    };
    Ok((size, array.values.chunks_exact(3).enumerate().map(z).collect()))
}

/// Confidences of depth, or of points where there are none of depth.
fn confidence(arrays: &mut Arrays, count: usize, size: (usize, usize)) -> Result<Option<Vec<f64>>, DatasetError> {
    for key in ["depth_conf", "world_points_conf"] {
        let Some(array) = arrays.numbers(key)? else { continue };
        if planes(&array.shape, count, 1) == Some(size) {
            return Ok(Some(array.values));
        }
        let expected = format!("({count}, {}, {}), as the depth has", size.1, size.0);
        return Err(DatasetError::malformed(&arrays.label(key), "shape", expected, format!("{:?}", array.shape)));
    }
    Ok(None)
}

/// Focal lengths; `None` where neither intrinsics nor fields of view were saved.
fn focal(arrays: &mut Arrays, count: usize, size: (usize, usize)) -> Result<Option<Vec<(f64, f64)>>, DatasetError> {
    let focal: Option<Vec<(f64, f64)>> = if let Some(array) = arrays.numbers("intrinsic")? {
        matches!(array.shape.as_slice(), [.., 3, 3])
            .then(|| array.values.chunks_exact(9).map(|k| (k[0], k[4])).collect())
    } else if let Some(array) = arrays.numbers("pose_enc")? {
        let length = |side: usize, angle: f64| 0.5 * side as f64 / (0.5 * angle).tan();
        encodings(&array).map(|rows| rows.iter().map(|row| (length(size.0, row[8]), length(size.1, row[7]))).collect())
    } else {
        None
    };
    // They only help to guess how photos were fitted into the processed size.
    Ok(focal.filter(|focal| {
        focal.len() == count && focal.iter().all(|(x, y)| x.is_finite() && y.is_finite() && *x > 0.0 && *y > 0.0)
    }))
}

/// Width and height of an array of `count` planes of `channels` values: `(S, H, W, C)`, without the last axis when it is 1, with a
/// batch of 1 before.
fn planes(shape: &[usize], count: usize, channels: usize) -> Option<(usize, usize)> {
    let size = match *shape {
        [1, s, height, width, c] | [s, height, width, c] if s == count && c == channels => (width, height),
        [1, s, height, width] | [s, height, width] if s == count && channels == 1 => (width, height),
        [height, width] if count == 1 && channels == 1 => (width, height),
        _ => return None,
    };
    (size.0 > 1 && size.1 > 1).then_some(size)
}
