//! The subject: the point nearest to the optical axes of all cameras.

use glam::{DMat3, DMat4, DVec3};
use gs_base::median;

/// Cameras look at one subject when the point nearest to all their axes lies within this angle of each, radians.
const LOOKING_AT: f64 = 0.5;

/// Least determinant (see [`nearest_to_axes`]) with which axes meet at all; parallel ones have 0.
const MEETING: f64 = 1e-4;

/// The point with the least sum of squared distances to the optical axes of `poses` (camera to world, OpenCV axes),
/// scene units; `None` where they hardly meet: the determinant of the mean projection across an axis is below `least`
/// (0 for parallel axes, at most 8/27; 0.005 is a spread of some 10 degrees).
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

/// A camera this many times farther from the cameras' middle than three quarters of them are is a stray. A rig of a
/// close group and a few far cameras may have a factor of 5.
pub(crate) const STRAY: f64 = 10.0;

/// Whether each camera stands so far from all others that its pose is a mistake rather than a part of the rig: rates,
/// near planes and thresholds go by the others.
pub(crate) fn strays(positions: &[DVec3]) -> Vec<bool> {
    let along = |axis: fn(&DVec3) -> f64| median(positions.iter().map(axis).collect()).unwrap_or(0.0);
    // By axis, since a mean goes where the stray is.
    let middle = DVec3::new(along(|p| p.x), along(|p| p.y), along(|p| p.z));
    let mut distances: Vec<f64> = positions.iter().map(|position| position.distance(middle)).collect();
    distances.sort_by(f64::total_cmp);
    let usual = distances.get(3 * distances.len() / 4).copied().unwrap_or(0.0);
    positions.iter().map(|position| usual > 0.0 && position.distance(middle) > STRAY * usual).collect()
}

/// The positions without [strays].
pub(crate) fn without_strays(positions: &[DVec3]) -> Vec<DVec3> {
    positions.iter().zip(strays(positions)).filter(|(_, stray)| !stray).map(|(position, _)| *position).collect()
}

/// Least determinant (see [`nearest_to_axes`]) with which the subject says how far things are: axes that spread by some
/// 10 degrees. A narrower rig knows its subject's distance worse than by half.
const SPREAD: f64 = 0.005;

/// Fewest cameras whose axes say where the subject is: those of two need not come near each other.
const CAMERAS_MIN: usize = 3;

/// The median depth of the subject, along the optical axes of the cameras (camera to world, OpenCV axes) that have it
/// before them, scene units; `None` where their axes do not meet before most of them (parallel axes, a forward-facing
/// rig, a walk through rooms, fewer than three cameras). The one meaning of "distance of the subject": near planes,
/// warnings about them, and the depths at which random points begin are shares of it.
pub fn subject_distance(poses: &[DMat4]) -> Option<f64> {
    let centres: Vec<DVec3> = poses.iter().map(|pose| pose.w_axis.truncate()).collect();
    let poses: Vec<DMat4> =
        poses.iter().zip(strays(&centres)).filter(|(_, stray)| !stray).map(|(pose, _)| *pose).collect();
    let poses = &poses[..];
    let subject = nearest_to_axes(poses, SPREAD).filter(|_| poses.len() >= CAMERAS_MIN)?;
    let depth = |c2w: &DMat4| (subject - c2w.w_axis.truncate()).dot(c2w.z_axis.truncate());
    let before: Vec<f64> = poses.iter().map(depth).filter(|depth| *depth > 0.0).collect();
    if 2 * before.len() > poses.len() { median(before) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cameras on a circle of radius 4 that look at its middle, over an angle.
    fn arc(count: usize, angle: f64) -> Vec<DMat4> {
        let camera = |i: usize| {
            let turn = angle * i as f64 / (count - 1) as f64;
            let position = DVec3::new(4.0 * turn.sin(), 0.0, -4.0 * turn.cos());
            let (z, y) = (-position.normalize(), DVec3::Y);
            DMat4::from_cols(y.cross(z).extend(0.0), y.extend(0.0), z.extend(0.0), position.extend(1.0))
        };
        (0..count).map(camera).collect()
    }

    #[test]
    fn a_stray_changes_no_distance() {
        let mut poses = arc(12, 2.0);
        assert!(
            strays(&poses.iter().map(|pose| pose.w_axis.truncate()).collect::<Vec<_>>()).iter().all(|stray| !stray)
        );
        poses[3].w_axis = (100.0 * poses[3].w_axis.truncate() + DVec3::X).extend(1.0);
        let centres: Vec<DVec3> = poses.iter().map(|pose| pose.w_axis.truncate()).collect();
        assert_eq!(strays(&centres).iter().position(|stray| *stray), Some(3));
        assert_eq!(without_strays(&centres).len(), 11);
        assert!((subject_distance(&poses).expect("an arc") - 4.0).abs() < 1e-9);
    }

    #[test]
    fn the_distance_is_that_of_most_cameras() {
        let mut poses = arc(6, 1.0);
        assert!((subject_distance(&poses).expect("an arc") - 4.0).abs() < 1e-9);
        // One camera that was held the wrong way round.
        let axes = [poses[5].x_axis, poses[5].z_axis].map(|axis| -axis);
        (poses[5].x_axis, poses[5].z_axis) = (axes[0], axes[1]);
        assert!((subject_distance(&poses).expect("five of six") - 4.0).abs() < 1e-9);
        assert_eq!(subject_distance(&arc(6, 0.1)), None, "a rig of six degrees");
        assert_eq!(subject_distance(&arc(2, 1.0)), None, "two cameras");
    }
}
