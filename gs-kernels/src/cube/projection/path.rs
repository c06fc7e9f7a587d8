//! The steps of the projection that forward and backward share.

use cubecl::prelude::*;

use crate::constants;
use crate::cube::buffer::Buffer;
use crate::cube::camera::{Pinhole, Pose, Slope, apply, jacobian_row, slope};
use crate::cube::covariance::{Projected2d, project};
use crate::cube::math::{Mat3, Quat, Vec3, finite, finite3, norm2, rotation};

const QUAT_NORM2_MIN: f32 = constants::QUAT_NORM2_MIN as f32;
const QUAT_NORM2_MAX: f32 = constants::QUAT_NORM2_MAX as f32;

/// The intermediate results of the projection of one Gaussian, recomputed by the backward pass.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(super) struct Path {
    pub(super) unit: Quat,
    pub(super) quat_norm: f32,
    pub(super) rotation: Mat3,
    pub(super) scales: Vec3,
    pub(super) p: Vec3,
    pub(super) slope_x: Slope,
    pub(super) slope_y: Slope,
    pub(super) a_x: Vec3,
    pub(super) a_y: Vec3,
    pub(super) ellipse: Projected2d,
    pub(super) drawable: bool,
}

#[cube]
pub(super) fn read_quat(quats: &[f32], index: usize) -> Quat {
    let base = index * 4;
    Quat { w: quats[base], x: quats[base + 1], y: quats[base + 2], z: quats[base + 3] }
}

#[cube]
pub(super) fn path(mean: Vec3, quat: Quat, log_scales: Vec3, pose: Pose, pinhole: Pinhole) -> Path {
    let p = apply(pose, mean);
    let q2 = norm2(quat);
    let quat_norm = q2.sqrt();
    let unit = Quat { w: quat.w / quat_norm, x: quat.x / quat_norm, y: quat.y / quat_norm, z: quat.z / quat_norm };
    let rotation = rotation(unit);
    let scales = Vec3 { x: log_scales.x.exp(), y: log_scales.y.exp(), z: log_scales.z.exp() };
    let slope_x = slope(p.x, p.z, pinhole.x_low, pinhole.x_high);
    let slope_y = slope(p.y, p.z, pinhole.y_low, pinhole.y_high);
    let a_x = jacobian_row(pinhole.fx, p.z, slope_x.value, pose.rotation.a, pose.rotation.c);
    let a_y = jacobian_row(pinhole.fy, p.z, slope_y.value, pose.rotation.b, pose.rotation.c);
    let ellipse = project(rotation, scales, a_x, a_y, pinhole.eps2d);
    // Bits first: comparisons with NaN are not reliable in a shader.
    let all_finite = finite3(p) && finite(q2) && finite3(scales) && finite3(a_x) && finite3(a_y);
    let in_depth = p.z >= pinhole.near && p.z <= pinhole.far;
    let long_enough = q2 >= QUAT_NORM2_MIN;
    let short_enough = q2 <= QUAT_NORM2_MAX;
    let drawable = all_finite && in_depth && long_enough && short_enough && ellipse.drawable;
    Path { unit, quat_norm, rotation, scales, p, slope_x, slope_y, a_x, a_y, ellipse, drawable }
}

pub(super) fn check(means: &Buffer, quats: &Buffer, log_scales: &Buffer, viewmat: &Buffer) -> usize {
    let count = means.len() / 3;
    assert_eq!(means.len(), count * 3, "means must be [N, 3]");
    assert_eq!(quats.len(), count * 4, "quats must be [N, 4] for {count} means");
    assert_eq!(log_scales.len(), count * 3, "log_scales must be [N, 3] for {count} means");
    assert_eq!(viewmat.len(), 16, "viewmat must hold 16 values");
    count
}
