//! A camera's pose and the pinhole projection of a point with its Jacobian.

use cubecl::prelude::*;

use crate::config::ProjectionConfig;
use crate::cube::math::{Mat3, Vec3, add, combine, dot, mat_vec, scaled};

/// World-to-camera rotation and translation.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(crate) struct Pose {
    /// Rows of the rotation.
    pub rotation: Mat3,
    /// Translation, scene units.
    pub translation: Vec3,
}

/// From a row-major 4x4 `viewmat`.
#[cube]
pub(crate) fn read_pose(viewmat: &[f32]) -> Pose {
    Pose {
        rotation: Mat3 {
            a: Vec3 { x: viewmat[0], y: viewmat[1], z: viewmat[2] },
            b: Vec3 { x: viewmat[4], y: viewmat[5], z: viewmat[6] },
            c: Vec3 { x: viewmat[8], y: viewmat[9], z: viewmat[10] },
        },
        translation: Vec3 { x: viewmat[3], y: viewmat[7], z: viewmat[11] },
    }
}

/// A world point in camera axes.
#[cube]
pub(crate) fn apply(pose: Pose, point: Vec3) -> Vec3 {
    add(mat_vec(pose.rotation, point), pose.translation)
}

/// The intrinsics and limits of [`ProjectionConfig`] as launch scalars.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(crate) struct Pinhole {
    /// Image width, pixels.
    pub width: f32,
    /// Image height, pixels.
    pub height: f32,
    /// Focal length along x, pixels.
    pub fx: f32,
    /// Focal length along y, pixels.
    pub fy: f32,
    /// Principal point, pixels from the left.
    pub cx: f32,
    /// Principal point, pixels from the top.
    pub cy: f32,
    /// Lower bound of `x / z` for the Jacobian.
    pub x_low: f32,
    /// Upper bound of `x / z` for the Jacobian.
    pub x_high: f32,
    /// Lower bound of `y / z` for the Jacobian.
    pub y_low: f32,
    /// Upper bound of `y / z` for the Jacobian.
    pub y_high: f32,
    /// Near plane, scene units.
    pub near: f32,
    /// Far plane, scene units.
    pub far: f32,
    /// Variance added to the projected covariance, square pixels.
    pub eps2d: f32,
}

impl PinholeLaunch {
    /// The launch scalars of `config`.
    pub(crate) fn of(config: &ProjectionConfig) -> Self {
        let [x_low, x_high, y_low, y_high] = config.frustum_limits().map(|limit| limit as f32);
        Self::new(
            config.width as f32,
            config.height as f32,
            config.fx as f32,
            config.fy as f32,
            config.cx as f32,
            config.cy as f32,
            x_low,
            x_high,
            y_low,
            y_high,
            config.near as f32,
            config.far as f32,
            config.eps2d as f32,
        )
    }
}

/// A slope `p / z` clamped to the limits of the Jacobian.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(crate) struct Slope {
    /// The value used.
    pub value: f32,
    /// 1 if the slope was inside the limits, 0 if it was clamped.
    pub free: f32,
}

/// `p / z` clamped to `low..=high`.
#[cube]
pub(crate) fn slope(p: f32, z: f32, low: f32, high: f32) -> Slope {
    let value = p / z;
    let below = value < low;
    let above = value > high;
    let held = select(below, low, select(above, high, value));
    Slope { value: held, free: select(below || above, 0.0f32, 1.0f32) }
}

/// Row of `J R` for one image axis: `focal / z (axis - slope forward)`, where `axis` and `forward` are the camera's x
/// (or y) and z rows.
#[cube]
pub(crate) fn jacobian_row(focal: f32, z: f32, slope: f32, axis: Vec3, forward: Vec3) -> Vec3 {
    let scale = focal / z;
    combine(scale, axis, -scale * slope, forward)
}

/// Gradients of [`jacobian_row`] and of the slope inside it.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(crate) struct JacobianVjp {
    /// By the point's coordinate along the axis.
    pub p: f32,
    /// By the point's depth.
    pub z: f32,
    /// By the camera's axis row.
    pub axis: Vec3,
    /// By the camera's z row.
    pub forward: Vec3,
}

/// Backward of [`jacobian_row`] for the gradient `v` by its result.
#[cube]
pub(crate) fn jacobian_row_vjp(focal: f32, z: f32, slope: Slope, axis: Vec3, forward: Vec3, v: Vec3) -> JacobianVjp {
    let scale = focal / z;
    let along_forward = dot(v, forward);
    let v_scale = dot(v, axis) - slope.value * along_forward;
    let v_slope = -scale * along_forward * slope.free;
    JacobianVjp {
        p: v_slope / z,
        z: -v_scale * scale / z - v_slope * slope.value / z,
        axis: scaled(scale, v),
        forward: scaled(-scale * slope.value, v),
    }
}
