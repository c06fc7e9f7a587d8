//! One Gaussian in place of two, by their moments.
//!
//! With the weights `w_a + w_b = 1` of the contributions to the photos:
//!
//! ```text
//! mean    m = w_a m_a + w_b m_b
//! shape   S = w_a S_a + w_b S_b + w_a w_b (m_b - m_a) (m_b - m_a)^T
//! opacity o = (o_a A_a + o_b A_b - o_a o_b I_ab) / A
//! ```
//!
//! `A` is the integral of a Gaussian's projection and `I_ab` that of the product of two, each the mean over the three
//! planes of the world's axes. The numerator is the integral of `1 - (1 - alpha_a) (1 - alpha_b)`: the merged Gaussian
//! covers as much as the two did where they overlap and where they do not.
//!
//! Departure from Hierarchical 3DGS (Kerbl et al. 2024), Sec. 4: there the weights are `o A`. A contribution is that
//! as far as it is seen, so a hidden Gaussian does not change the shape and colour of the one before it.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3, Vec3};
use gs_base::eigen::diagonalise;

use crate::Splats;
use crate::splats::{ALPHA_LEAST, sigmoid, unit};
use crate::turn::quaternion;

/// Logarithms of scales are taken for at most this, and at least minus this: `e^30` units are no scene, and products of
/// four variances of that size are still numbers.
const LOG_SCALE_MAX: f32 = 30.0;

/// Sweeps until a matrix of three rows is diagonal to the last digit.
const SWEEPS: usize = 8;

/// A Gaussian as merging sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    /// Scene units.
    pub mean: DVec3,
    /// Squared scene units.
    pub covariance: DMat3,
    /// 0 to 1.
    pub opacity: f64,
    /// Pixels of the photos, above 0.
    pub contribution: f64,
    /// Integral of its projection, squared scene units.
    pub area: f64,
}

impl Shape {
    /// The Gaussian `row`, whose values are finite.
    pub fn of(splats: &Splats, row: usize, contribution: f64) -> Self {
        let [w, x, y, z] = unit(splats.quats[row]);
        let rotation = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w));
        let variance = |log: f32| f64::from(2.0 * log.clamp(-LOG_SCALE_MAX, LOG_SCALE_MAX)).exp();
        let variances = DMat3::from_diagonal(DVec3::from(splats.log_scales[row].map(variance)));
        let covariance = rotation * variances * rotation.transpose();
        Self {
            mean: Vec3::from(splats.means[row]).as_dvec3(),
            covariance,
            opacity: sigmoid(splats.opacity_logits[row]),
            contribution,
            area: area(&covariance),
        }
    }

    /// Pixels that a part of the integral contributes.
    pub fn visibility(&self) -> f64 {
        self.contribution / (self.opacity * self.area).max(f64::MIN_POSITIVE)
    }

    /// The share of `other` when the two are merged, 0 to 1.
    pub fn share_of(&self, other: &Self) -> f64 {
        other.contribution / (self.contribution + other.contribution)
    }

    /// The Gaussian in place of the two.
    pub fn merged_with(&self, other: &Self) -> Self {
        let share = self.share_of(other);
        let between = other.mean - self.mean;
        let apart = DMat3::from_cols(between * between.x, between * between.y, between * between.z);
        let within = self.covariance * (1.0 - share) + other.covariance * share;
        let covariance = within + apart * (share * (1.0 - share));
        let area = area(&covariance);
        let twice = self.opacity * other.opacity * self.overlap(other);
        let covered = self.opacity * self.area + other.opacity * other.area - twice;
        Self {
            mean: self.mean + between * share,
            covariance,
            opacity: (covered / area).clamp(0.0, 1.0 - ALPHA_LEAST),
            contribution: self.contribution + other.contribution,
            area,
        }
    }

    /// Integral of the product of two projections of opacity 1, squared scene units.
    pub fn overlap(&self, other: &Self) -> f64 {
        let sum = self.covariance + other.covariance;
        let determinants = minors(&sum);
        let d = other.mean - self.mean;
        let (x, y, z) = (sum.x_axis, sum.y_axis, sum.z_axis);
        let distances = DVec3::new(
            d.y * d.y * z.z - 2.0 * d.y * d.z * y.z + d.z * d.z * y.y,
            d.x * d.x * z.z - 2.0 * d.x * d.z * x.z + d.z * d.z * x.x,
            d.x * d.x * y.y - 2.0 * d.x * d.y * x.y + d.y * d.y * x.x,
        ) / determinants;
        let products = minors(&self.covariance) * minors(&other.covariance) / determinants;
        // Of a needle the square of a distance may round below zero.
        let of_plane = |k: usize| products[k].sqrt() * (-0.5 * distances[k].max(0.0)).exp();
        TAU * (of_plane(0) + of_plane(1) + of_plane(2)) / 3.0
    }

    /// Orientation, w x y z, and logarithms of the scales.
    pub fn axes(&self) -> ([f32; 4], [f32; 3]) {
        // Symmetric, so that rows are columns.
        let mut matrix = self.covariance.to_cols_array_2d();
        let mut vectors = [[0.0; 3]; 3];
        diagonalise(&mut matrix, &mut vectors, SWEEPS);
        let mut rotation = DMat3::from_cols_array_2d(&vectors).transpose();
        if rotation.determinant() < 0.0 {
            rotation.z_axis = -rotation.z_axis;
        }
        let q = quaternion(rotation);
        let log_scale = |k: usize| (0.5 * matrix[k][k].max(f64::MIN_POSITIVE).ln()) as f32;
        let limited = |log: f32| log.clamp(-LOG_SCALE_MAX, LOG_SCALE_MAX);
        ([q.w, q.x, q.y, q.z].map(|x| x as f32), [0, 1, 2].map(|k| limited(log_scale(k))))
    }
}

/// Integral of a projection of opacity 1, squared scene units.
fn area(covariance: &DMat3) -> f64 {
    let determinants = minors(covariance);
    TAU * (determinants.x.sqrt() + determinants.y.sqrt() + determinants.z.sqrt()) / 3.0
}

/// Determinants of the projections along x, y and z. Of a needle the difference may round to what is no area.
fn minors(m: &DMat3) -> DVec3 {
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let determinants = DVec3::new(y.y * z.z - y.z * y.z, x.x * z.z - x.z * x.z, x.x * y.y - x.y * x.y);
    determinants.max(DVec3::splat(f64::MIN_POSITIVE))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Gaussian turned by `angle` about z.
    fn turned(mean: [f64; 3], scales: [f64; 3], angle: f64, opacity: f64, contribution: f64) -> Shape {
        let rotation = DMat3::from_rotation_z(angle);
        let variances = DMat3::from_diagonal(DVec3::from(scales) * DVec3::from(scales));
        let covariance = rotation * variances * rotation.transpose();
        Shape { mean: mean.into(), covariance, opacity, contribution, area: area(&covariance) }
    }

    #[test]
    fn moments_are_those_of_the_pair() {
        let a = turned([0.0; 3], [0.1, 0.2, 0.3], 0.0, 0.4, 3.0);
        let b = turned([4.0, 4.0, 0.0], [0.3, 0.2, 0.1], 0.0, 0.2, 1.0);
        let m = a.merged_with(&b);
        assert_eq!((m.mean, m.contribution), (DVec3::new(1.0, 1.0, 0.0), 4.0));
        // Along x 0.75 * 0.01 + 0.25 * 0.09 within, and 0.75 * 0.25 * 16 between.
        let mut expected = DMat3::from_diagonal(DVec3::new(0.03 + 3.0, 0.04 + 3.0, 0.75 * 0.09 + 0.25 * 0.01));
        (expected.x_axis.y, expected.y_axis.x) = (3.0, 3.0);
        let error = m.covariance - expected;
        assert!(error.to_cols_array().iter().all(|x| x.abs() < 1e-12), "{error}");
        // They overlap in no plane.
        assert!((a.area - TAU / 3.0 * (0.02 + 0.03 + 0.06)).abs() < 1e-12);
        let covered = 0.4 * a.area + 0.2 * b.area;
        assert!((m.opacity * m.area - covered).abs() < 1e-12, "{} {covered}", m.opacity * m.area);
    }

    /// The same sphere twice: `1 - (1 - a g) (1 - b g)` has the integral `(a + b - a b / 2) A`.
    #[test]
    fn coincident_spheres_cover_what_they_did() {
        let of = |opacity| turned([1.0, 2.0, 3.0], [0.5; 3], 0.3, opacity, opacity);
        let m = of(0.6).merged_with(&of(0.3));
        assert!((m.opacity - (0.9 - 0.09)).abs() < 1e-12, "{}", m.opacity);
        assert!((m.mean - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
        let (_, log_scales) = m.axes();
        assert!(log_scales.iter().all(|log| (log - 0.5_f32.ln()).abs() < 1e-6), "{log_scales:?}");
        assert_eq!(of(1.0).merged_with(&of(1.0)).opacity, 1.0 - ALPHA_LEAST, "opaque is the most");
    }

    /// Coverage of the pair in the planes of two axes each, summed over a grid.
    #[test]
    fn the_integral_of_alpha_stays() {
        let a = turned([0.0, 0.1, 0.0], [0.5, 0.2, 0.3], 0.7, 0.8, 2.0);
        let b = turned([0.4, 0.0, 0.2], [0.3, 0.4, 0.2], -0.4, 0.5, 1.0);
        let (step, reach) = (0.02, 150);
        let alpha = |shape: &Shape, [i, j]: [usize; 2], at: [f64; 2]| {
            let d = [at[0] - shape.mean[i], at[1] - shape.mean[j]];
            let entry = |r: usize, c: usize| shape.covariance.col(c)[r];
            let determinant = entry(i, i) * entry(j, j) - entry(i, j) * entry(i, j);
            let squared = d[0] * d[0] * entry(j, j) - 2.0 * d[0] * d[1] * entry(i, j) + d[1] * d[1] * entry(i, i);
            shape.opacity * (-0.5 * squared / determinant).exp()
        };
        let mut sum = 0.0;
        for plane in [[0, 1], [1, 2], [0, 2]] {
            for p in -reach..=reach {
                for q in -reach..=reach {
                    let at = [f64::from(p) * step, f64::from(q) * step];
                    sum += 1.0 - (1.0 - alpha(&a, plane, at)) * (1.0 - alpha(&b, plane, at));
                }
            }
        }
        let covered = sum * step * step / 3.0;
        let m = a.merged_with(&b);
        assert!(((m.opacity * m.area) / covered - 1.0).abs() < 1e-6, "{} {covered}", m.opacity * m.area);
    }

    #[test]
    fn axes_make_the_covariance_again() {
        let shape = turned([0.0; 3], [0.5, 0.02, 0.3], 0.7, 0.8, 2.0);
        let (quat, log_scales) = shape.axes();
        let splats = Splats {
            means: vec![[0.0; 3]],
            quats: vec![quat],
            log_scales: vec![log_scales],
            opacity_logits: vec![0.0],
            sh: vec![[0.0; 3]],
            ..Splats::default()
        };
        let again = Shape::of(&splats, 0, 1.0).covariance - shape.covariance;
        assert!(again.to_cols_array().iter().all(|x| x.abs() < 1e-6), "{again}");
    }
}
