//! The rigid motion between two sets of points (Horn 1987): the rotation is the eigenvector of the largest eigenvalue
//! of a 4 x 4 matrix.

use gs_base::eigen::diagonalise;
use gs_burn::glam::{DQuat, DVec3};

use super::law::BodyPose;

/// Sweeps of Jacobi's method: four rotations of planes converge quadratically, six sweeps reach rounding.
const SWEEPS: usize = 8;

/// The rotation and the position of the centre `first` that lead best from the points `before` to `after`.
///
/// # Panics
/// When the lists differ in length or are empty.
pub fn rigid_motion(before: &[DVec3], after: &[DVec3], first: DVec3) -> BodyPose {
    assert!(before.len() == after.len() && !before.is_empty(), "points of both times");
    let count = before.len() as f64;
    let (from, to) = (before.iter().sum::<DVec3>() / count, after.iter().sum::<DVec3>() / count);
    let mut s = [[0.0; 3]; 3];
    for (a, b) in before.iter().zip(after) {
        let (a, b) = ((*a - from).to_array(), (*b - to).to_array());
        for i in 0..3 {
            for j in 0..3 {
                s[i][j] += a[i] * b[j];
            }
        }
    }
    let n = [
        [s[0][0] + s[1][1] + s[2][2], s[1][2] - s[2][1], s[2][0] - s[0][2], s[0][1] - s[1][0]],
        [s[1][2] - s[2][1], s[0][0] - s[1][1] - s[2][2], s[0][1] + s[1][0], s[2][0] + s[0][2]],
        [s[2][0] - s[0][2], s[0][1] + s[1][0], s[1][1] - s[0][0] - s[2][2], s[1][2] + s[2][1]],
        [s[0][1] - s[1][0], s[2][0] + s[0][2], s[1][2] + s[2][1], s[2][2] - s[0][0] - s[1][1]],
    ];
    let [w, x, y, z] = largest_eigenvector(n);
    let rotation = DQuat::from_xyzw(x, y, z, w).normalize();
    let rotation = if rotation.is_finite() { rotation } else { DQuat::IDENTITY };
    BodyPose { rotation, centre: to + rotation * (first - from) }
}

/// The eigenvector of the largest eigenvalue of a symmetric matrix.
fn largest_eigenvector(mut matrix: [[f64; 4]; 4]) -> [f64; 4] {
    let mut vectors = [[0.0; 4]; 4];
    diagonalise(&mut matrix, &mut vectors, SWEEPS);
    let best = (0..4).max_by(|a, b| matrix[*a][*a].total_cmp(&matrix[*b][*b])).unwrap_or(0);
    std::array::from_fn(|row| vectors[row][best])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rigid_motion_is_found_again() {
        let before: Vec<DVec3> =
            (0..9).map(|i| DVec3::new((i % 3) as f64, (i / 3) as f64 - 1.0, ((7 * i) % 4) as f64 * 0.3)).collect();
        let first = DVec3::new(0.4, 0.2, -0.7);
        for angle in [0.0, 1e-6, 0.3, 3.1] {
            let rotation = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), angle);
            let after: Vec<DVec3> = before.iter().map(|x| rotation * *x + DVec3::new(3.0, -1.0, 2.0)).collect();
            let pose = rigid_motion(&before, &after, first);
            for (a, b) in before.iter().zip(&after) {
                assert!(pose.apply(*a, first).distance(*b) < 1e-12, "angle {angle}");
            }
        }
        let one = rigid_motion(&before[..1], &[DVec3::ONE], first);
        assert!(one.apply(before[0], first).distance(DVec3::ONE) < 1e-12, "a single point");
    }
}
