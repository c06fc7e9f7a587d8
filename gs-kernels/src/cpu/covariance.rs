//! From rotation, scales and the camera's Jacobian to the conic of the projected Gaussian (EWA splatting, Zwicker
//! 2001), sixteen Gaussians at once.
//!
//! `C = A R S S R^T A^T + eps I` with `A = J W` the Jacobian in world axes, `[2][3]`. With `m_i = S R^T a_i` the
//! entries are `C_ij = m_i . m_j`. The determinant is not formed from them, since for a needle `xx yy - xy^2` cancels;
//! instead `det C0 = |m_1 x m_2|^2` and `m_1 x m_2 = diag(s_2 s_3, s_3 s_1, s_1 s_2) R^T (a_1 x a_2)`.

use crate::constants::{COMPENSATION_RATIO_MIN, COV2D_MAX};
use crate::cpu::math::{Mat3, Vec3, combine, cross, dot, mat_t_vec, mat_vec, scaled};
use crate::cpu::real::{Lanes, Number};
use crate::cpu::wide::Wide;

/// Sixteen projected covariances, with the state for their backward pass.
#[derive(Clone, Copy, Debug)]
pub struct Projected2d<L> {
    /// `S R^T a_i`.
    half: [Vec3<Wide<L>>; 2],
    /// `R^T a_i`.
    turned: [Vec3<Wide<L>>; 2],
    /// `[xx, xy, yy]` with the dilation.
    pub cov: [Wide<L>; 3],
    /// Conic as `[d1, l, d2]`, see [`crate::rows::ProjectedRow`].
    pub conic: [Wide<L>; 3],
    determinant: Wide<L>,
    /// `det C0 / det C`, at most 1.
    ratio: Wide<L>,
    eps2d: Wide<L>,
}

/// Projects.
#[inline(always)]
pub fn project<L: Lanes>(
    rotation: &Mat3<Wide<L>>,
    scales: Vec3<Wide<L>>,
    a: [Vec3<Wide<L>>; 2],
    eps2d: Wide<L>,
) -> Projected2d<L> {
    let turned = [mat_t_vec(rotation, a[0]), mat_t_vec(rotation, a[1])];
    let half = [scaled(turned[0], scales), scaled(turned[1], scales)];
    let (xx, xy, yy) = (dot(half[0], half[0]), dot(half[0], half[1]), dot(half[1], half[1]));
    let areas = [scales[1] * scales[2], scales[2] * scales[0], scales[0] * scales[1]];
    let minors = scaled(areas, mat_t_vec(rotation, cross(a[0], a[1])));
    let undilated = dot(minors, minors);
    let determinant = undilated + eps2d * (xx + yy) + eps2d * eps2d;
    let cov = [xx + eps2d, xy, yy + eps2d];
    let conic = [cov[2] / determinant, -cov[1] / cov[2], Wide::of(1.0) / cov[2]];
    Projected2d { half, turned, cov, conic, determinant, ratio: undilated / determinant, eps2d }
}

impl<L: Lanes> Projected2d<L> {
    /// Whether the result can be drawn: finite, and not wider than [`COV2D_MAX`].
    #[inline(always)]
    pub fn drawable(&self) -> L::Mask {
        let (zero, limit) = (Wide::<L>::of(0.0), Wide::<L>::of(COV2D_MAX));
        let [xx, xy, yy] = self.cov;
        let narrow = L::both(L::both(limit.0.ge(xx.0), limit.0.ge(yy.0)), limit.0.ge(xy.0.abs()));
        let positive = L::both(yy.above(zero), self.determinant.above(zero));
        L::both(L::both(narrow, positive), self.determinant.is_finite())
    }

    /// Opacity factor that keeps the Gaussian's total light under dilation: `sqrt(det C0 / det C)` (Mip-Splatting).
    #[inline(always)]
    pub fn compensation(&self) -> Wide<L> {
        self.ratio.max(Wide::of(COMPENSATION_RATIO_MIN)).sqrt()
    }
}

/// Gradients of [`project`]: by the rotation, by the logarithms of the scales, by `a`.
#[derive(Clone, Copy, Debug)]
pub struct ProjectVjp<L> {
    /// By the rotation matrix.
    pub rotation: Mat3<Wide<L>>,
    /// By the logarithms of the scales.
    pub log_scales: Vec3<Wide<L>>,
    /// By the rows of `J W`.
    pub a: [Vec3<Wide<L>>; 2],
}

/// Backward of [`project`] and [`Projected2d::compensation`] (pass `None` if it is not used).
#[inline(always)]
pub fn project_vjp<L: Lanes>(
    rotation: &Mat3<Wide<L>>,
    scales: Vec3<Wide<L>>,
    a: [Vec3<Wide<L>>; 2],
    projected: &Projected2d<L>,
    v_conic: [Wide<L>; 3],
    v_compensation: Option<Wide<L>>,
) -> ProjectVjp<L> {
    let two = Wide::<L>::of(2.0);
    let [d1, l, d2] = projected.conic;
    let [v_d1, v_l, v_d2] = v_conic;
    let d1_sq = v_d1 * d1 * d1;
    let mut v_xx = -d1_sq;
    let mut v_xy = -two * d1_sq * l - v_l * d2;
    let mut v_yy = -d1_sq * l * l - v_l * l * d2 - v_d2 * d2 * d2;
    if let Some(v_compensation) = v_compensation {
        let ratio = projected.ratio;
        let held = ratio.above(Wide::of(COMPENSATION_RATIO_MIN));
        let v = v_compensation / (two * ratio.sqrt() * projected.determinant);
        let v = Wide::select(held, v, Wide::of(0.0));
        let [xx, xy, yy] = projected.cov;
        v_xx += v * (yy - projected.eps2d - ratio * yy);
        v_yy += v * (xx - projected.eps2d - ratio * xx);
        v_xy -= v * two * xy * (Wide::of(1.0) - ratio);
    }
    let [m1, m2] = projected.half;
    let v_half = [combine(two * v_xx, m1, v_xy, m2), combine(v_xy, m1, two * v_yy, m2)];
    let v_turned = [scaled(v_half[0], scales), scaled(v_half[1], scales)];
    let (first, second) = (scaled(v_half[0], projected.turned[0]), scaled(v_half[1], projected.turned[1]));
    let log_scales = scaled([first[0] + second[0], first[1] + second[1], first[2] + second[2]], scales);
    ProjectVjp {
        rotation: [
            combine(a[0][0], v_turned[0], a[1][0], v_turned[1]),
            combine(a[0][1], v_turned[0], a[1][1], v_turned[1]),
            combine(a[0][2], v_turned[0], a[1][2], v_turned[1]),
        ],
        log_scales,
        a: [mat_vec(rotation, v_turned[0]), mat_vec(rotation, v_turned[1])],
    }
}
