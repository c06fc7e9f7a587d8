//! From rotation, scales and the camera's Jacobian to the conic of the projected Gaussian (EWA splatting, Zwicker
//! 2001).
//!
//! `C = A R S S R^T A^T + eps I` with `A = J W` the Jacobian in world axes, `[2][3]`. With `m_i = S R^T a_i` the
//! entries are `C_ij = m_i . m_j`. The determinant is not formed from them, since for a needle `xx yy - xy^2` cancels;
//! instead `det C0 = |m_1 x m_2|^2` and `m_1 x m_2 = diag(s_2 s_3, s_3 s_1, s_1 s_2) R^T (a_1 x a_2)`.

use cubecl::prelude::*;

use crate::constants;
use crate::cube::math::{Mat3, Vec3, add, combine, cross, dot, finite, finite3, mat_t_vec, mat_vec, scaled, times};

const COV2D_MAX: f32 = constants::COV2D_MAX as f32;
const COMPENSATION_RATIO_MIN: f32 = constants::COMPENSATION_RATIO_MIN as f32;

/// A projected covariance, with the state for its backward pass.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(crate) struct Projected2d {
    /// `S R^T a_1`.
    pub half_x: Vec3,
    /// `S R^T a_2`.
    pub half_y: Vec3,
    /// `m_1 x m_2`.
    pub minors: Vec3,
    /// Variance along x with the dilation, square pixels.
    pub xx: f32,
    /// Covariance, square pixels.
    pub xy: f32,
    /// Variance along y with the dilation, square pixels.
    pub yy: f32,
    /// First diagonal entry of the conic's `L D L^T`, see [`crate::rows::ProjectedRow`].
    pub d1: f32,
    /// Off-diagonal entry of the conic's `L`.
    pub l: f32,
    /// Second diagonal entry of the conic's `D`.
    pub d2: f32,
    /// Determinant with the dilation.
    pub determinant: f32,
    /// `det C0 / det C`, at most 1.
    pub ratio: f32,
    /// Whether it can be drawn: finite and not wider than [`constants::COV2D_MAX`].
    pub drawable: bool,
}

/// Projects a Gaussian's covariance; `a_x`, `a_y` are the rows of `J W`, `eps2d` the dilation in square pixels.
#[cube]
pub(crate) fn project(rotation: Mat3, scales: Vec3, a_x: Vec3, a_y: Vec3, eps2d: f32) -> Projected2d {
    let turned_x = mat_t_vec(rotation, a_x);
    let turned_y = mat_t_vec(rotation, a_y);
    let half_x = times(turned_x, scales);
    let half_y = times(turned_y, scales);
    let xx0 = dot(half_x, half_x);
    let yy0 = dot(half_y, half_y);
    let xy = dot(half_x, half_y);
    let areas = Vec3 { x: scales.y * scales.z, y: scales.z * scales.x, z: scales.x * scales.y };
    let minors = times(areas, mat_t_vec(rotation, cross(a_x, a_y)));
    let undilated = dot(minors, minors);
    let determinant = undilated + eps2d * (xx0 + yy0) + eps2d * eps2d;
    let xx = xx0 + eps2d;
    let yy = yy0 + eps2d;
    let all_finite = finite(xx) && finite(xy) && finite(yy) && finite(determinant) && finite3(minors);
    let bounded = xx <= COV2D_MAX && yy <= COV2D_MAX && xy.abs() <= COV2D_MAX;
    Projected2d {
        half_x,
        half_y,
        minors,
        xx,
        xy,
        yy,
        d1: yy / determinant,
        l: -xy / yy,
        d2: 1.0f32 / yy,
        determinant,
        ratio: undilated / determinant,
        drawable: all_finite && bounded && yy > 0.0f32 && determinant > 0.0f32,
    }
}

/// Opacity factor that keeps the Gaussian's total light under dilation: `sqrt(det C0 / det C)` (Mip-Splatting).
#[cube]
pub(crate) fn compensation(ratio: f32) -> f32 {
    let floored = select(ratio > COMPENSATION_RATIO_MIN, ratio, COMPENSATION_RATIO_MIN.runtime());
    floored.sqrt()
}

/// Gradients of [`project`].
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(crate) struct ProjectVjp {
    /// By the rotation matrix.
    pub rotation: Mat3,
    /// By the logarithms of the scales.
    pub log_scales: Vec3,
    /// By the first row of `J W`.
    pub a_x: Vec3,
    /// By the second row of `J W`.
    pub a_y: Vec3,
}

/// Backward of [`project`] and [`compensation`] (pass 0 for `v_compensation` if it is not used); `v_conic` holds the
/// gradients with respect to `d1`, `l` and `d2`.
///
/// The gradients with respect to the covariance's entries are never formed: for a needle they are huge and cancel. With
/// `w = m_1 + l m_2` the conic's part of `v_{m_1}` is `-2 v_d1 d1^2 w - v_l d2 m_2`, and the one of `v_{m_2}` is `l
/// v_{m_1} - v_l d2 w - 2 v_d2 d2^2 m_2`; `w = (m_2 x (m_1 x m_2) + eps m_1) / C_yy` has no difference of large numbers
/// either.
#[cube]
pub(crate) fn project_vjp(
    rotation: Mat3,
    scales: Vec3,
    a_x: Vec3,
    a_y: Vec3,
    projected: Projected2d,
    v_conic: Vec3,
    v_compensation: f32,
    eps2d: f32,
) -> ProjectVjp {
    let d1 = projected.d1;
    let l = projected.l;
    let d2 = projected.d2;
    let m_x = projected.half_x;
    let m_y = projected.half_y;
    let w = scaled(d2, combine(1.0f32, cross(m_y, projected.minors), eps2d, m_x));
    let by_w = -2.0f32 * v_conic.x * d1 * d1;
    let by_l = -v_conic.y * d2;
    let by_d2 = -2.0f32 * v_conic.z * d2 * d2;
    let v_conic_x = combine(by_w, w, by_l, m_y);
    let v_conic_y = add(scaled(l, v_conic_x), combine(by_l, w, by_d2, m_y));

    // The slope of det C0 / det C with respect to the covariance; below the floor, a harmless 1 is under the root.
    let raised = projected.ratio > COMPENSATION_RATIO_MIN;
    let root = select(raised, projected.ratio, 1.0f32).sqrt();
    let determinant = projected.determinant;
    let slope = select(raised, v_compensation, 0.0f32) / (2.0f32 * root * determinant) * (eps2d / determinant);
    let xx = projected.xx;
    let xy = projected.xy;
    let yy = projected.yy;
    let v_xx = slope * ((yy - eps2d) * yy + xy * xy);
    let v_yy = slope * ((xx - eps2d) * xx + xy * xy);
    let v_xy = -2.0f32 * slope * xy * (xx + yy - eps2d);
    let v_ratio_x = combine(2.0f32 * v_xx, m_x, v_xy, m_y);
    let v_ratio_y = combine(v_xy, m_x, 2.0f32 * v_yy, m_y);

    // The scales multiply `m`: their logarithms have the gradient `v_{m_1} m_1 + v_{m_2} m_2`, by components.
    let conic_part = add(times(w, combine(by_w, w, 2.0f32 * by_l, m_y)), scaled(by_d2, times(m_y, m_y)));
    let ratio_part = add(times(v_ratio_x, m_x), times(v_ratio_y, m_y));
    let v_turned_x = times(add(v_conic_x, v_ratio_x), scales);
    let v_turned_y = times(add(v_conic_y, v_ratio_y), scales);
    ProjectVjp {
        rotation: Mat3 {
            a: combine(a_x.x, v_turned_x, a_y.x, v_turned_y),
            b: combine(a_x.y, v_turned_x, a_y.y, v_turned_y),
            c: combine(a_x.z, v_turned_x, a_y.z, v_turned_y),
        },
        log_scales: add(conic_part, ratio_part),
        a_x: mat_vec(rotation, v_turned_x),
        a_y: mat_vec(rotation, v_turned_y),
    }
}
