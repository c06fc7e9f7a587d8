//! From gradients with respect to the colours to gradients with respect to coefficients, means and pose.

use cubecl::prelude::*;

use super::basis::{basis, basis_vjp, centre, direction, raw_colour};
use super::forward::check;
use super::table::{read_rows, shared_len, write_rows};
use crate::config::ShConfig;
use crate::cpu::sh::MAX_COEFFICIENTS;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid};
use crate::cube::camera::read_pose;
use crate::cube::error::CubeError;
use crate::cube::math::{Vec3, combine, dot, finite3, read3, scaled, write3};
use crate::cube::reduce::{column_sum, cube_sum};
use crate::cube::rows::read_radius;

/// Backward: one unit per Gaussian. The coefficients' gradient is a buffer of its own, as large as the largest tensor
/// of a scene; the other outputs are parts of one, to stay within eight bindings.
#[cube(launch_unchecked)]
fn sh_backward_kernel(
    means: &[f32],
    sh: &[f32],
    viewmat: &[f32],
    projected: &[f32],
    v_colors: &[f32],
    v_sh: &mut [f32],
    gradients: &mut [f32],
    count: u32,
    cubes: u32,
    start_sums: u32,
    #[comptime] degree: u32,
    #[comptime] coefficients: usize,
    #[comptime] of_pose: bool,
) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let used = comptime!(((degree + 1) * (degree + 1)) as usize);
    let mut slots = Shared::<[f32]>::new_slice(UNITS);
    let mut shared = Shared::<[f32]>::new_slice(comptime!(shared_len(3 * coefficients)));
    let mut own = Array::<f32>::new(comptime!(3 * MAX_COEFFICIENTS));
    #[unroll]
    for k in 0..comptime!(3 * used) {
        own[k] = 0.0f32;
    }
    read_rows(sh, &mut own, &mut shared, count, comptime!(3 * coefficients), comptime!(3 * used));
    let inside = CUBE_POS * UNITS + (UNIT_POS as usize) < count as usize;
    let index = select(inside, CUBE_POS * UNITS + UNIT_POS as usize, 0usize);

    let dir = direction(read3(means, index), centre(read_pose(viewmat)));
    let mut b = Array::<f32>::new(MAX_COEFFICIENTS);
    basis(degree, dir.unit, &mut b);
    let raw = raw_colour(&b, &own, used);
    let v_shown = read3(v_colors, index);
    let valid = inside && finite3(raw) && finite3(v_shown) && read_radius(projected, index) > 0.0f32;
    let v = Vec3 {
        x: select(valid && raw.x > 0.0f32, v_shown.x, 0.0f32),
        y: select(valid && raw.y > 0.0f32, v_shown.y, 0.0f32),
        z: select(valid && raw.z > 0.0f32, v_shown.z, 0.0f32),
    };

    let mut v_basis = Array::<f32>::new(MAX_COEFFICIENTS);
    #[unroll]
    for k in 0..used {
        let coefficient = Vec3 { x: own[3 * k], y: own[3 * k + 1], z: own[3 * k + 2] };
        v_basis[k] = select(valid, dot(coefficient, v), 0.0f32);
        // The gradient takes the place of the coefficient. The basis is at most 3 in magnitude.
        own[3 * k] = b[k] * v.x;
        own[3 * k + 1] = b[k] * v.y;
        own[3 * k + 2] = b[k] * v.z;
    }
    write_rows(v_sh, &own, &mut shared, count, comptime!(3 * coefficients), comptime!(3 * used));

    let mut v_mean = Vec3 { x: 0.0f32, y: 0.0f32, z: 0.0f32 };
    if comptime!(degree > 0) {
        let v_dir = basis_vjp(degree, dir.unit, &v_basis);
        let across = scaled(1.0f32 / dir.distance, combine(1.0f32, v_dir, -dot(dir.unit, v_dir), dir.unit));
        let kept = valid && finite3(across);
        v_mean.x = select(kept, across.x, 0.0f32);
        v_mean.y = select(kept, across.y, 0.0f32);
        v_mean.z = select(kept, across.z, 0.0f32);
    }
    if inside {
        write3(gradients, 0, index, v_mean);
    }
    if comptime!(of_pose) {
        let x = cube_sum(v_mean.x, &mut slots);
        let y = cube_sum(v_mean.y, &mut slots);
        let z = cube_sum(v_mean.z, &mut slots);
        if UNIT_POS == 0 {
            write3(gradients, start_sums as usize, CUBE_POS, Vec3 { x, y, z });
        }
    }
}

/// One cube: adds the cubes' sums of the gradient with respect to the means `[rows, 3]`, and propagates the camera
/// centre's gradient, which is its negative, through `-R^T t` to `v_viewmat` `[4, 4]`; zero if it is not finite.
#[cube(launch_unchecked)]
fn centre_sum_kernel(sums: &[f32], viewmat: &[f32], v_viewmat: &mut [f32], rows: u32) {
    let mut slots = Shared::<[f32]>::new_slice(UNITS);
    let x = column_sum(sums, rows, 0u32, 3usize, &mut slots);
    let y = column_sum(sums, rows, 1u32, 3usize, &mut slots);
    let z = column_sum(sums, rows, 2u32, 3usize, &mut slots);
    if UNIT_POS == 0 {
        let pose = read_pose(viewmat);
        let sum = Vec3 { x, y, z };
        let a = scaled(pose.translation.x, sum);
        let b = scaled(pose.translation.y, sum);
        let c = scaled(pose.translation.z, sum);
        let t = Vec3 { x: dot(pose.rotation.a, sum), y: dot(pose.rotation.b, sum), z: dot(pose.rotation.c, sum) };
        let kept = finite3(a) && finite3(b) && finite3(c) && finite3(t);
        write_pose_row(v_viewmat, 0usize, a, t.x, kept);
        write_pose_row(v_viewmat, 1usize, b, t.y, kept);
        write_pose_row(v_viewmat, 2usize, c, t.z, kept);
        write_pose_row(v_viewmat, 3usize, a, t.x, false);
    }
}

#[cube]
fn write_pose_row(viewmat: &mut [f32], #[comptime] row: usize, rotation: Vec3, translation: f32, kept: bool) {
    let base = comptime!(4 * row);
    viewmat[base] = select(kept, rotation.x, 0.0f32);
    viewmat[base + 1] = select(kept, rotation.y, 0.0f32);
    viewmat[base + 2] = select(kept, rotation.z, 0.0f32);
    viewmat[base + 3] = select(kept, translation, 0.0f32);
}

/// Gradients of [`super::forward`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct ShGradients {
    /// `[N, 3]`, through the view direction.
    pub means: Buffer,
    /// `[N, S, 3]`; zero above the active degree.
    pub sh: Buffer,
    /// `[4, 4]`, through the camera centre, if it was wanted.
    pub viewmat: Option<Buffer>,
}

/// Backward of [`super::forward`] from `v_colors` `[N, 3]`; the twin of [`crate::cpu::sh::backward`]. A channel clamped
/// at 0 passes no gradient. That of the camera is made only if `of_pose`.
///
/// # Errors
/// When the gradients exceed one buffer.
///
/// # Panics
/// When the buffers disagree in length, or the active degree is above the stored one.
pub fn backward(
    client: &Client,
    means: &Buffer,
    sh: &Buffer,
    viewmat: &Buffer,
    projected: &Buffer,
    config: &ShConfig,
    v_colors: &Buffer,
    of_pose: bool,
) -> Result<ShGradients, CubeError> {
    let count = check(means, sh, viewmat, projected, config);
    assert_eq!(v_colors.len(), count * 3, "v_colors must be [N, 3]");
    let cubes = count.div_ceil(UNITS);
    let v_sh = Buffer::empty(client, "gradients of the coefficients", sh.len())?;
    let slab = Buffer::slab(client, "gradients of the colours", [count * 3, cubes * 3])?;
    if count > 0 {
        // SAFETY: rows below `count`, which the checks above found in every buffer; the slab's parts are that long.
        unsafe {
            sh_backward_kernel::launch_unchecked(
                client,
                grid(cubes),
                cube_dim(),
                means.arg(),
                sh.arg(),
                viewmat.arg(),
                projected.arg(),
                v_colors.arg(),
                v_sh.arg(),
                slab.whole.arg(),
                count as u32,
                cubes as u32,
                slab.starts[1] as u32,
                config.degree.min(3),
                config.coefficients,
                of_pose,
            );
        }
    }
    let [v_means, sums] = slab.parts;
    let mut v_viewmat = None;
    if of_pose {
        let pose = Buffer::empty(client, "gradient of the camera", 16)?;
        // SAFETY: `rows` rows of three sums, sixteen values of a pose.
        unsafe {
            centre_sum_kernel::launch_unchecked(
                client,
                grid(1),
                cube_dim(),
                sums.arg(),
                viewmat.arg(),
                pose.arg(),
                cubes as u32,
            );
        }
        v_viewmat = Some(pose);
    }
    Ok(ShGradients { means: v_means, sh: v_sh, viewmat: v_viewmat })
}
