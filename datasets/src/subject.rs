//! The subject: the point nearest to the optical axes of all cameras.

use glam::{DMat3, DMat4, DVec3};

use crate::statistics::median;

/// Cameras look at one subject when the point nearest to all their axes lies within this angle of each, radians.
const LOOKING_AT: f64 = 0.5;

/// Least determinant (see [`nearest_to_axes`]) with which axes meet at all; parallel ones have 0.
const MEETING: f64 = 1e-4;

/// The point with the least sum of squared distances to the optical axes of `poses` (camera to world, OpenCV axes), scene units; `None`
/// where they hardly meet: the determinant of the mean projection across an axis is below `least` (0 for parallel axes, at most 8/27;
/// 0.005 is a spread of some 10 degrees).
pub fn nearest_to_axes(poses: &[DMat4], least: f64) -> Option<DVec3> {
    // The point p solves (sum of I - d d^T) p = sum of (I - d d^T) o.
    let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for c2w in poses {
        let (centre, axis) = (c2w.w_axis.truncate(), c2w.z_axis.truncate());
        let across = DMat3::IDENTITY - DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        matrix += across;
        right += across * centre;
    }
    if poses.is_empty() || (matrix * (1.0 / poses.len() as f64)).determinant() < least {
        return None;
    }
    let point = matrix.inverse() * right;
    point.is_finite().then_some(point)
}

/// [`nearest_to_axes`] if every camera has it before it and near its axis.
pub fn subject(poses: &[DMat4]) -> Option<DVec3> {
    let subject = nearest_to_axes(poses, MEETING)?;
    let sees = |c2w: &DMat4| {
        let to = subject - c2w.w_axis.truncate();
        to.length() > 0.0 && to.angle_between(c2w.z_axis.truncate()) < LOOKING_AT
    };
    poses.iter().all(sees).then_some(subject)
}

/// The median distance of cameras (camera to world, OpenCV axes) from the subject that all of them look at, scene units; `None` where
/// their axes do not meet before each of them (parallel axes, a walk through rooms, one camera).
pub(crate) fn subject_distance(poses: &[DMat4]) -> Option<f64> {
    let target = subject(poses)?;
    median(poses.iter().map(|c2w| c2w.w_axis.truncate().distance(target)).collect())
}
