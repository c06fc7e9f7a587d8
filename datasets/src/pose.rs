//! Checking camera poses and bringing them to OpenCV axes.

use std::path::Path;

use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};
use gs_base::sentence::decimals;

use crate::error::DatasetError;

/// How far from orthonormal a rotation may be, as the largest entry of `R^T R - 1`: room for matrices printed with
/// three digits, far from a sheared or squeezed one.
const RIGID_TOLERANCE: f64 = 0.02;

/// A uniform scale in the rotation up to this much off 1 is taken for rounding or a slightly scaled camera object and
/// divided out; more says that the matrix means something else.
const SCALE_TOLERANCE: f64 = 0.05;

/// From this much off 1 the user hears of it.
const SCALE_NOTICE: f64 = 1e-3;

/// Farthest that a camera may be from the origin of its world, scene units: squared distances, and their products with
/// focal lengths in pixels, stay within what an f32 holds.
const FARTHEST: f64 = 1e15;

/// A camera-to-world matrix with an exactly orthonormal rotation, and the scale that was divided out if notable.
pub(crate) struct Rigid {
    pub c2w: DMat4,
    pub scale: Option<f64>,
}

/// A pose that is a reflection, of the camera that `frame` names.
pub(crate) fn reflection(file: &Path, frame: &str) -> DatasetError {
    DatasetError::Pose {
        path: file.to_path_buf(),
        frame: frame.to_string(),
        expected: "a rotation (determinant +1)".to_string(),
        found: "a reflection (determinant -1); is an axis negated or are two swapped?".to_string(),
    }
}

/// [`orthonormal`] of a pose that is no reflection.
pub(crate) fn rigid(rows: &[[f64; 4]; 4], file: &Path, frame: &str) -> Result<Rigid, DatasetError> {
    let rigid = orthonormal(rows, file, frame)?;
    if rigid.c2w.determinant() < 0.0 { Err(reflection(file, frame)) } else { Ok(rigid) }
}

/// Checks a matrix of a pose (rows as in the file) and makes its rotation, or reflection, exactly orthonormal.
pub(crate) fn orthonormal(rows: &[[f64; 4]; 4], file: &Path, frame: &str) -> Result<Rigid, DatasetError> {
    let wrong = |expected: &str, found: String| DatasetError::Pose {
        path: file.to_path_buf(),
        frame: frame.to_string(),
        expected: expected.to_string(),
        found,
    };
    if let Some((index, value)) = rows.iter().flatten().enumerate().find(|(_, value)| !value.is_finite()) {
        return Err(wrong("finite numbers", format!("{value} in row {}, column {}", index / 4, index % 4)));
    }
    let last = DVec4::from_array(rows[3]);
    if rows[..3].iter().all(|row| row[3] == 0.0) && rows[3][3] == 1.0 && last.truncate() != DVec3::ZERO {
        return Err(wrong(
            "a last row of 0 0 0 1",
            "a last column of 0 0 0 1: a transposed (column-major) matrix".into(),
        ));
    }
    if (last - DVec4::W).abs().max_element() > 1e-6 {
        return Err(wrong("a last row of 0 0 0 1", format!("{:?}", last.to_array())));
    }
    let m = DMat4::from_cols_array_2d(rows).transpose();
    let rotation = DMat3::from_mat4(m);
    let determinant = rotation.determinant();
    if !determinant.is_finite() || determinant.abs() < 1e-12 {
        return Err(wrong("a rotation", format!("a singular matrix (determinant {determinant:e})")));
    }
    let scale = determinant.abs().cbrt();
    if (scale - 1.0).abs() > SCALE_TOLERANCE {
        return Err(wrong("a rotation without scale", format!("a scale of {} in the rotation", decimals(scale, 4))));
    }
    let rotation = rotation * (1.0 / scale);
    let deviation = rotation.transpose() * rotation - DMat3::IDENTITY;
    let worst = deviation.to_cols_array().iter().fold(0.0_f64, |worst, value| worst.max(value.abs()));
    if worst > RIGID_TOLERANCE {
        return Err(wrong(
            "a rotation (orthonormal columns)",
            format!("a sheared or unevenly scaled matrix (off by {worst:.4})"),
        ));
    }
    let mut c2w = DMat4::from_mat3(nearest_rotation(rotation));
    c2w.w_axis = m.w_axis;
    let c2w = near_enough(c2w, file, frame)?;
    Ok(Rigid { c2w, scale: ((scale - 1.0).abs() > SCALE_NOTICE).then_some(scale) })
}

/// The orthonormal factor of the polar decomposition, by Newton's iteration `R <- (R + R^-T) / 2`. It is the rotation
/// closest to R and favours no column; the deviation is at most [`RIGID_TOLERANCE`] here, so five steps reach rounding.
fn nearest_rotation(mut rotation: DMat3) -> DMat3 {
    for _ in 0..5 {
        rotation = (rotation + rotation.inverse().transpose()) * 0.5;
    }
    rotation
}

/// From OpenGL/Blender camera axes (x right, y up, z back) to OpenCV's (x right, y down, z forward).
pub(crate) fn opencv_from_opengl(c2w: DMat4) -> DMat4 {
    DMat4::from_cols(c2w.x_axis, -c2w.y_axis, -c2w.z_axis, c2w.w_axis)
}

/// Camera to world from a world-to-camera quaternion (w, x, y, z, nearly normalised) and translation, as COLMAP writes.
pub(crate) fn from_world_to_camera(q: [f64; 4], t: [f64; 3], file: &Path, frame: &str) -> Result<DMat4, DatasetError> {
    let norm2: f64 = q.iter().map(|value| value * value).sum();
    let finite = t.iter().all(|value| value.is_finite()) && norm2.is_finite();
    if !finite || norm2 < 1e-12 {
        return Err(DatasetError::Pose {
            path: file.to_path_buf(),
            frame: frame.to_string(),
            expected: "a finite translation and a quaternion that is not zero".to_string(),
            found: format!("quaternion {q:?}, translation {t:?}"),
        });
    }
    let world_to_camera = DQuat::from_xyzw(q[1], q[2], q[3], q[0]).normalize();
    let camera_to_world = world_to_camera.conjugate();
    let c2w = DMat4::from_rotation_translation(camera_to_world, -(camera_to_world * DVec3::from_array(t)));
    near_enough(c2w, file, frame)
}

/// The pose, unless its camera is beyond [`FARTHEST`].
fn near_enough(c2w: DMat4, file: &Path, frame: &str) -> Result<DMat4, DatasetError> {
    let position = c2w.w_axis.truncate();
    if position.abs().max_element() <= FARTHEST {
        return Ok(c2w);
    }
    Err(DatasetError::Pose {
        path: file.to_path_buf(),
        frame: frame.to_string(),
        expected: format!("a camera within {FARTHEST:e} scene units of the origin"),
        found: format!("one at ({:e}, {:e}, {:e})", position.x, position.y, position.z),
    })
}
