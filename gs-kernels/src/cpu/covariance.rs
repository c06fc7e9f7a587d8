//! From rotation, scales and the camera's Jacobian to the conic of the projected Gaussian (EWA splatting, Zwicker 2001).
//!
//! `C = A R S S R^T A^T + eps I` with `A = J W` the Jacobian in world axes, `[2][3]`. With `m_i = S R^T a_i` the entries
//! are `C_ij = m_i . m_j`. The determinant is not formed from them, since for a needle `xx yy - xy^2` cancels; instead
//! `det C0 = |m_1 x m_2|^2` and `m_1 x m_2 = diag(s_2 s_3, s_3 s_1, s_1 s_2) R^T (a_1 x a_2)`.

use crate::constants::{COMPENSATION_RATIO_MIN, COV2D_MAX};
use crate::cpu::Real;
use crate::cpu::math::{Mat3, Vec3, combine, cross, dot, mat_t_vec, mat_vec};

/// A projected covariance and what its backward pass needs again.
#[derive(Clone, Copy, Debug)]
pub struct Projected2d<F> {
    /// `S R^T a_i`.
    half: [Vec3<F>; 2],
    /// `R^T a_i`.
    turned: [Vec3<F>; 2],
    /// `[xx, xy, yy]` with the dilation.
    pub cov: [F; 3],
    /// Conic as `[d1, l, d2]`, see [`crate::rows::ProjectedRow`].
    pub conic: [F; 3],
    determinant: F,
    /// `det C0 / det C`, at most 1.
    ratio: F,
    eps2d: F,
}

/// Projects; `None` when the result is outside what can be drawn (not finite, or wider than [`COV2D_MAX`]).
#[inline(always)]
pub fn project<F: Real>(rotation: &Mat3<F>, scales: Vec3<F>, a: [Vec3<F>; 2], eps2d: F) -> Option<Projected2d<F>> {
    let turned = a.map(|a| mat_t_vec(rotation, a));
    let half = turned.map(|t| std::array::from_fn(|k| t[k] * scales[k]));
    let (xx, xy, yy) = (dot(half[0], half[0]), dot(half[0], half[1]), dot(half[1], half[1]));
    let areas = [scales[1] * scales[2], scales[2] * scales[0], scales[0] * scales[1]];
    let normal = mat_t_vec(rotation, cross(a[0], a[1]));
    let minors: Vec3<F> = std::array::from_fn(|k| areas[k] * normal[k]);
    let undilated = dot(minors, minors);
    let determinant = undilated + eps2d * (xx + yy) + eps2d * eps2d;
    let cov = [xx + eps2d, xy, yy + eps2d];
    let limit = F::of(COV2D_MAX);
    let drawable = cov[0] <= limit && cov[2] <= limit && cov[1].abs() <= limit && cov[2] > F::ZERO;
    if !(drawable && determinant > F::ZERO && determinant.is_finite()) {
        return None;
    }
    let conic = [cov[2] / determinant, -cov[1] / cov[2], F::ONE / cov[2]];
    Some(Projected2d { half, turned, cov, conic, determinant, ratio: undilated / determinant, eps2d })
}

impl<F: Real> Projected2d<F> {
    /// Opacity factor that keeps the Gaussian's total light under dilation: `sqrt(det C0 / det C)` (Mip-Splatting).
    #[inline(always)]
    pub fn compensation(&self) -> F {
        self.ratio.greatest(F::of(COMPENSATION_RATIO_MIN)).sqrt()
    }
}

/// Gradients of [`project`]: by the rotation, by the logarithms of the scales, by `a`.
#[derive(Clone, Copy, Debug)]
pub struct ProjectVjp<F> {
    /// By the rotation matrix.
    pub rotation: Mat3<F>,
    /// By the logarithms of the scales.
    pub log_scales: Vec3<F>,
    /// By the rows of `J W`.
    pub a: [Vec3<F>; 2],
}

/// Backward of [`project`] and [`Projected2d::compensation`] (pass 0 for `v_compensation` when it is not used).
#[inline(always)]
pub fn project_vjp<F: Real>(
    rotation: &Mat3<F>,
    scales: Vec3<F>,
    a: [Vec3<F>; 2],
    projected: &Projected2d<F>,
    v_conic: [F; 3],
    v_compensation: F,
) -> ProjectVjp<F> {
    let two = F::of(2.0);
    let [d1, l, d2] = projected.conic;
    let [v_d1, v_l, v_d2] = v_conic;
    let d1_sq = v_d1 * d1 * d1;
    let mut v_xx = -d1_sq;
    let mut v_xy = -two * d1_sq * l - v_l * d2;
    let mut v_yy = -d1_sq * l * l - v_l * l * d2 - v_d2 * d2 * d2;
    if projected.ratio > F::of(COMPENSATION_RATIO_MIN) {
        let ratio = projected.ratio;
        let v = v_compensation / (two * ratio.sqrt() * projected.determinant);
        let [xx, xy, yy] = projected.cov;
        v_xx += v * (yy - projected.eps2d - ratio * yy);
        v_yy += v * (xx - projected.eps2d - ratio * xx);
        v_xy -= v * two * xy * (F::ONE - ratio);
    }
    let [m1, m2] = projected.half;
    let v_half = [combine(two * v_xx, m1, v_xy, m2), combine(v_xy, m1, two * v_yy, m2)];
    let v_turned = v_half.map(|v| -> Vec3<F> { std::array::from_fn(|k| v[k] * scales[k]) });
    let log_scales = std::array::from_fn(|k| {
        (v_half[0][k] * projected.turned[0][k] + v_half[1][k] * projected.turned[1][k]) * scales[k]
    });
    ProjectVjp {
        rotation: std::array::from_fn(|i| combine(a[0][i], v_turned[0], a[1][i], v_turned[1])),
        log_scales,
        a: v_turned.map(|v| mat_vec(rotation, v)),
    }
}
