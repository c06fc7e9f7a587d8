//! From gradients with respect to the rows to gradients with respect to the parameters and the pose.
//!
//! The camera's gradient is a sum over all Gaussians: each cube writes one row of twelve sums, and a last cube adds the
//! rows.

use cubecl::prelude::*;

use super::path::{check, path, read_quat};
use crate::config::ProjectionConfig;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid};
use crate::cube::camera::{Pinhole, PinholeLaunch, jacobian_row_vjp, read_pose};
use crate::cube::covariance::project_vjp;
use crate::cube::error::CubeError;
use crate::cube::math::{
    Vec3, add, combine, finite, finite3, mat_t_vec, normalise_vjp, read3, rotation_vjp, scaled, write3,
};
use crate::cube::reduce::{column_sum, cube_sum};
use crate::cube::rows::{read_radius, read_row};
use crate::rows::PROJECTED;

/// Entries of the camera's gradient: three rows of rotation and translation.
const POSE: usize = 12;

/// Adds row `row` of the camera's gradient over the cube: `v_p` is the gradient with respect to that camera coordinate,
/// `v_rotation` an additional gradient of the rotation's row.
#[cube]
fn pose_sums(
    sums: &mut [f32],
    start: usize,
    #[comptime] row: usize,
    v_p: f32,
    v_rotation: Vec3,
    slots: &mut Shared<[f32]>,
) {
    let x = cube_sum(v_rotation.x, slots);
    let y = cube_sum(v_rotation.y, slots);
    let z = cube_sum(v_rotation.z, slots);
    let t = cube_sum(v_p, slots);
    if UNIT_POS == 0 {
        let base = start + CUBE_POS * POSE + comptime!(row * 4);
        sums[base] = x;
        sums[base + 1] = y;
        sums[base + 2] = z;
        sums[base + 3] = t;
    }
}

/// Backward: one unit per Gaussian reads 26 values and writes 10; all outputs are parts of one buffer, to stay within
/// eight bindings.
#[cube(launch_unchecked)]
fn projection_backward_kernel(
    means: &[f32],
    quats: &[f32],
    log_scales: &[f32],
    viewmat: &[f32],
    projected: &[f32],
    v_projected: &[f32],
    gradients: &mut [f32],
    count: u32,
    cubes: u32,
    start_quats: u32,
    start_log_scales: u32,
    start_sums: u32,
    pinhole: Pinhole,
    #[comptime] antialiased: bool,
    #[comptime] of_pose: bool,
) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let mut slots = Shared::<[f32]>::new_slice(UNITS);
    let inside = CUBE_POS * UNITS + (UNIT_POS as usize) < count as usize;
    let index = select(inside, CUBE_POS * UNITS + UNIT_POS as usize, 0usize);
    let pose = read_pose(viewmat);
    let mean = read3(means, index);
    let path = path(mean, read_quat(quats, index), read3(log_scales, index), pose, pinhole);
    let v = read_row(v_projected, index);

    let mut v_compensation = 0.0f32;
    if comptime!(antialiased) {
        v_compensation = v.compensation;
    }
    let v_conic = Vec3 { x: v.d1, y: v.l, z: v.d2 };
    let ellipse = project_vjp(
        path.rotation,
        path.scales,
        path.a_x,
        path.a_y,
        path.ellipse,
        v_conic,
        v_compensation,
        pinhole.eps2d,
    );

    let p = path.p;
    let jx = jacobian_row_vjp(pinhole.fx, p.z, path.slope_x, pose.rotation.a, pose.rotation.c, ellipse.a_x);
    let jy = jacobian_row_vjp(pinhole.fy, p.z, path.slope_y, pose.rotation.b, pose.rotation.c, ellipse.a_y);
    let mx = v.mean_x * pinhole.fx / p.z;
    let my = v.mean_y * pinhole.fy / p.z;
    let v_p = Vec3 { x: mx + jx.p, y: my + jy.p, z: v.depth - mx * (p.x / p.z) - my * (p.y / p.z) + jx.z + jy.z };
    let v_rotation_a = combine(v_p.x, mean, 1.0f32, jx.axis);
    let v_rotation_b = combine(v_p.y, mean, 1.0f32, jy.axis);
    let v_rotation_c = add(scaled(v_p.z, mean), add(jx.forward, jy.forward));
    let v_mean = mat_t_vec(pose.rotation, v_p);
    let v_quat = normalise_vjp(path.unit, path.quat_norm, rotation_vjp(path.unit, ellipse.rotation));
    let v_log_scales = ellipse.log_scales;

    let own_finite = finite3(v_mean)
        && finite(v_quat.w)
        && finite(v_quat.x)
        && finite(v_quat.y)
        && finite(v_quat.z)
        && finite3(v_log_scales);
    let pose_finite = finite3(v_p) && finite3(v_rotation_a) && finite3(v_rotation_b) && finite3(v_rotation_c);
    let kept = inside && path.drawable && own_finite && pose_finite && read_radius(projected, index) > 0.0f32;

    if inside {
        write3(gradients, 0, index, masked(v_mean, kept));
        let base = start_quats as usize + index * 4;
        gradients[base] = select(kept, v_quat.w, 0.0f32);
        gradients[base + 1] = select(kept, v_quat.x, 0.0f32);
        gradients[base + 2] = select(kept, v_quat.y, 0.0f32);
        gradients[base + 3] = select(kept, v_quat.z, 0.0f32);
        write3(gradients, start_log_scales as usize, index, masked(v_log_scales, kept));
    }
    if comptime!(of_pose) {
        let v_t = masked(v_p, kept);
        let start = start_sums as usize;
        pose_sums(gradients, start, 0usize, v_t.x, masked(v_rotation_a, kept), &mut slots);
        pose_sums(gradients, start, 1usize, v_t.y, masked(v_rotation_b, kept), &mut slots);
        pose_sums(gradients, start, 2usize, v_t.z, masked(v_rotation_c, kept), &mut slots);
    }
}

/// `v` where `kept`, zero elsewhere; a product with 0 would keep NaN.
#[cube]
fn masked(v: Vec3, kept: bool) -> Vec3 {
    Vec3 { x: select(kept, v.x, 0.0f32), y: select(kept, v.y, 0.0f32), z: select(kept, v.z, 0.0f32) }
}

/// One cube: adds the cubes' rows of pose sums `[rows, 12]` into the gradient of `viewmat` `[4, 4]`, which is zero if a
/// sum is not finite.
#[cube(launch_unchecked)]
fn pose_sum_kernel(sums: &[f32], viewmat: &mut [f32], rows: u32) {
    let mut slots = Shared::<[f32]>::new_slice(UNITS);
    let mut totals = Array::<f32>::new(POSE);
    let mut all_finite = true;
    #[unroll]
    for k in 0..POSE {
        totals[k] = column_sum(sums, rows, k as u32, POSE, &mut slots);
        all_finite = all_finite && finite(totals[k]);
    }
    if UNIT_POS == 0 {
        #[unroll]
        for k in 0..POSE {
            viewmat[k] = select(all_finite, totals[k], 0.0f32);
        }
        #[unroll]
        for k in POSE..16usize {
            viewmat[k] = 0.0f32;
        }
    }
}

/// Gradients of [`super::forward`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct ProjectionGradients {
    /// `[N, 3]`
    pub means: Buffer,
    /// `[N, 4]`
    pub quats: Buffer,
    /// `[N, 3]`
    pub log_scales: Buffer,
    /// `[4, 4]`, if it was wanted; the last row is zero.
    pub viewmat: Option<Buffer>,
}

/// Backward of [`super::forward`]: `projected` is its result, `v_projected` `[N, 8]` the gradient with respect to it;
/// the twin of [`crate::cpu::projection::backward`]. Culled Gaussians receive zero, and so does one whose gradient is
/// not finite. The camera's gradient is made only if `of_pose`.
///
/// # Errors
/// When the gradients exceed one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn backward(
    client: &Client,
    means: &Buffer,
    quats: &Buffer,
    log_scales: &Buffer,
    viewmat: &Buffer,
    config: &ProjectionConfig,
    projected: &Buffer,
    v_projected: &Buffer,
    of_pose: bool,
) -> Result<ProjectionGradients, CubeError> {
    let count = check(means, quats, log_scales, viewmat);
    assert_eq!(projected.len(), count * PROJECTED, "projected must be [N, 8]");
    assert_eq!(v_projected.len(), count * PROJECTED, "v_projected must be [N, 8]");
    let cubes = count.div_ceil(UNITS);
    let lens = [count * 3, count * 4, count * 3, cubes * POSE];
    let slab = Buffer::slab(client, "gradients of the projection", lens)?;
    if count > 0 {
        // SAFETY: rows below `count`, which the checks above found in every buffer; the slab's parts are that long.
        unsafe {
            projection_backward_kernel::launch_unchecked(
                client,
                grid(cubes),
                cube_dim(),
                means.arg(),
                quats.arg(),
                log_scales.arg(),
                viewmat.arg(),
                projected.arg(),
                v_projected.arg(),
                slab.whole.arg(),
                count as u32,
                cubes as u32,
                slab.starts[1] as u32,
                slab.starts[2] as u32,
                slab.starts[3] as u32,
                PinholeLaunch::of(config),
                config.antialiased,
                of_pose,
            );
        }
    }
    let [v_means, v_quats, v_log_scales, sums] = slab.parts;
    let mut v_viewmat = None;
    if of_pose {
        let pose = Buffer::empty(client, "gradient of the camera", 16)?;
        // SAFETY: `rows` rows of twelve sums, sixteen values of a pose.
        unsafe {
            pose_sum_kernel::launch_unchecked(client, grid(1), cube_dim(), sums.arg(), pose.arg(), cubes as u32);
        }
        v_viewmat = Some(pose);
    }
    Ok(ProjectionGradients { means: v_means, quats: v_quats, log_scales: v_log_scales, viewmat: v_viewmat })
}
