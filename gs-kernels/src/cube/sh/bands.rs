//! Colours of degree 3 with the third band in a buffer of its own, where a device binds too little for all sixteen coefficients.
//!
//! A colour is a sum over coefficients, so the gradient of one is the basis times `v`, the gradient with respect to the unclamped
//! colour. `v` alone needs all coefficients. One kernel binds both buffers and writes `v`; another multiplies it with the basis, once for
//! each buffer. In one kernel, two gradients of coefficients would be one binding too many.

use cubecl::prelude::*;

use super::backward::{mean_gradient, passes, pose_gradient, unclamped, write_sum};
use super::basis::{basis, centre, direction, raw_colour};
use super::forward::colour_of;
use super::table::{read_rows, shared_len, write_rows};
use crate::config::{SH_BELOW_THIRD, SH_THIRD};
use crate::cpu::sh::MAX_COEFFICIENTS;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid};
use crate::cube::camera::read_pose;
use crate::cube::error::CubeError;
use crate::cube::math::{Vec3, dot, read3, write3};
use crate::rows::PROJECTED;

/// Values of a Gaussian in each buffer.
const BELOW: usize = 3 * SH_BELOW_THIRD;
const THIRD: usize = 3 * SH_THIRD;

/// Each unit of a cube reads its sixteen coefficients from both buffers.
#[cube]
fn read_both(sh: &[f32], third: &[f32], own: &mut Array<f32>, shared: &mut Shared<[f32]>, count: u32) {
    read_rows(sh, own, shared, count, BELOW, BELOW, 0usize);
    read_rows(third, own, shared, count, THIRD, THIRD, BELOW);
}

/// Forward: one unit per Gaussian.
#[cube(launch_unchecked)]
fn bands_forward_kernel(
    means: &[f32],
    sh: &[f32],
    third: &[f32],
    viewmat: &[f32],
    projected: &[f32],
    colors: &mut [f32],
    count: u32,
    cubes: u32,
) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let mut shared = Shared::<[f32]>::new_slice(comptime!(shared_len(BELOW)));
    let mut own = Array::<f32>::new(comptime!(3 * MAX_COEFFICIENTS));
    read_both(sh, third, &mut own, &mut shared, count);
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= count as usize {
        terminate!();
    }
    write3(colors, 0, index, colour_of(means, &own, viewmat, projected, index, 3u32));
}

/// Backward of all but the coefficients: one unit per Gaussian. Into `gradients` go the gradients of the means, their sums by cube and `v`.
#[cube(launch_unchecked)]
fn bands_backward_kernel(
    means: &[f32],
    sh: &[f32],
    third: &[f32],
    viewmat: &[f32],
    projected: &[f32],
    v_colors: &[f32],
    gradients: &mut [f32],
    count: u32,
    cubes: u32,
    start_sums: u32,
    start_v: u32,
    #[comptime] of_pose: bool,
) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let mut slots = Shared::<[f32]>::new_slice(UNITS);
    let mut shared = Shared::<[f32]>::new_slice(comptime!(shared_len(BELOW)));
    let mut own = Array::<f32>::new(comptime!(3 * MAX_COEFFICIENTS));
    #[unroll]
    for k in 0..comptime!(3 * MAX_COEFFICIENTS) {
        own[k] = 0.0f32;
    }
    read_both(sh, third, &mut own, &mut shared, count);
    let inside = CUBE_POS * UNITS + (UNIT_POS as usize) < count as usize;
    let index = select(inside, CUBE_POS * UNITS + UNIT_POS as usize, 0usize);

    let dir = direction(read3(means, index), centre(read_pose(viewmat)));
    let mut b = Array::<f32>::new(MAX_COEFFICIENTS);
    basis(3u32, dir.unit, &mut b);
    let raw = raw_colour(&b, &own, MAX_COEFFICIENTS);
    let valid = inside && passes(raw, v_colors, projected, index);
    let v = unclamped(raw, read3(v_colors, index), valid);
    let mut v_basis = Array::<f32>::new(MAX_COEFFICIENTS);
    #[unroll]
    for k in 0..comptime!(MAX_COEFFICIENTS) {
        let coefficient = Vec3 { x: own[3 * k], y: own[3 * k + 1], z: own[3 * k + 2] };
        v_basis[k] = select(valid, dot(coefficient, v), 0.0f32);
    }
    let v_mean = mean_gradient(dir, &v_basis, valid, 3u32);
    if inside {
        write3(gradients, 0, index, v_mean);
        write3(gradients, start_v as usize, index, v);
    }
    if comptime!(of_pose) {
        write_sum(gradients, start_sums, v_mean, &mut slots);
    }
}

/// Gradient of a run of coefficients, the basis from `first` on times the gradients that `passed` the clamp: one unit per Gaussian.
#[cube(launch_unchecked)]
fn coefficients_kernel(
    means: &[f32],
    viewmat: &[f32],
    passed: &[f32],
    v_sh: &mut [f32],
    count: u32,
    cubes: u32,
    #[comptime] degree: u32,
    #[comptime] first: usize,
    #[comptime] coefficients: usize,
) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let mut shared = Shared::<[f32]>::new_slice(comptime!(shared_len(3 * coefficients)));
    let inside = CUBE_POS * UNITS + (UNIT_POS as usize) < count as usize;
    let index = select(inside, CUBE_POS * UNITS + UNIT_POS as usize, 0usize);
    let dir = direction(read3(means, index), centre(read_pose(viewmat)));
    let mut b = Array::<f32>::new(MAX_COEFFICIENTS);
    basis(degree, dir.unit, &mut b);
    let v = read3(passed, index);
    let mut own = Array::<f32>::new(comptime!(3 * coefficients));
    #[unroll]
    for k in 0..coefficients {
        let y = b[comptime!(first + k)];
        own[3 * k] = y * v.x;
        own[3 * k + 1] = y * v.y;
        own[3 * k + 2] = y * v.z;
    }
    write_rows(v_sh, &own, &mut shared, count, comptime!(3 * coefficients), comptime!(3 * coefficients));
}

/// [`super::forward`] at degree 3 with the coefficients in two buffers: `sh` `[N, 9, 3]` below the third degree, `third` `[N, 7, 3]`.
///
/// # Errors
/// When the colours exceed one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn forward_of_bands(
    client: &Client,
    means: &Buffer,
    sh: &Buffer,
    third: &Buffer,
    viewmat: &Buffer,
    projected: &Buffer,
) -> Result<Buffer, CubeError> {
    let count = check(means, sh, third, viewmat, projected);
    let colors = Buffer::empty(client, "colours", count * 3)?;
    let cubes = count.div_ceil(UNITS);
    if count > 0 {
        // SAFETY: rows below `count`, which `check` found in every buffer.
        unsafe {
            bands_forward_kernel::launch_unchecked(
                client,
                grid(cubes),
                cube_dim(),
                means.arg(),
                sh.arg(),
                third.arg(),
                viewmat.arg(),
                projected.arg(),
                colors.arg(),
                count as u32,
                cubes as u32,
            );
        }
    }
    Ok(colors)
}

/// Gradients of [`forward_of_bands`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct BandGradients {
    /// `[N, 3]`, through the view direction.
    pub means: Buffer,
    /// `[N, 9, 3]`.
    pub sh: Buffer,
    /// `[N, 7, 3]`.
    pub third: Buffer,
    /// `[4, 4]`, through the camera centre, if it was wanted.
    pub viewmat: Option<Buffer>,
}

/// Backward of [`forward_of_bands`] from `v_colors` `[N, 3]`; see [`super::backward`].
///
/// # Errors
/// When the gradients exceed one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn backward_of_bands(
    client: &Client,
    means: &Buffer,
    sh: &Buffer,
    third: &Buffer,
    viewmat: &Buffer,
    projected: &Buffer,
    v_colors: &Buffer,
    of_pose: bool,
) -> Result<BandGradients, CubeError> {
    let count = check(means, sh, third, viewmat, projected);
    assert_eq!(v_colors.len(), count * 3, "v_colors must be [N, 3]");
    let cubes = count.div_ceil(UNITS);
    let slab = Buffer::slab(client, "gradients of the colours", [count * 3, cubes * 3, count * 3])?;
    if count > 0 {
        // SAFETY: rows below `count`, which the checks above found in every buffer; the slab's parts are that long.
        unsafe {
            bands_backward_kernel::launch_unchecked(
                client,
                grid(cubes),
                cube_dim(),
                means.arg(),
                sh.arg(),
                third.arg(),
                viewmat.arg(),
                projected.arg(),
                v_colors.arg(),
                slab.whole.arg(),
                count as u32,
                cubes as u32,
                slab.starts[1] as u32,
                slab.starts[2] as u32,
                of_pose,
            );
        }
    }
    let [v_means, sums, v] = slab.parts;
    let of_coefficients = |degree: u32, first: usize, coefficients: usize| -> Result<Buffer, CubeError> {
        let v_sh = Buffer::empty(client, "gradients of the coefficients", count * 3 * coefficients)?;
        if count > 0 {
            // SAFETY: rows below `count` in every buffer.
            unsafe {
                coefficients_kernel::launch_unchecked(
                    client,
                    grid(cubes),
                    cube_dim(),
                    means.arg(),
                    viewmat.arg(),
                    v.arg(),
                    v_sh.arg(),
                    count as u32,
                    cubes as u32,
                    degree,
                    first,
                    coefficients,
                );
            }
        }
        Ok(v_sh)
    };
    Ok(BandGradients {
        sh: of_coefficients(2, 0, SH_BELOW_THIRD)?,
        third: of_coefficients(3, SH_BELOW_THIRD, SH_THIRD)?,
        viewmat: if of_pose { Some(pose_gradient(client, &sums, viewmat, cubes)?) } else { None },
        means: v_means,
    })
}

fn check(means: &Buffer, sh: &Buffer, third: &Buffer, viewmat: &Buffer, projected: &Buffer) -> usize {
    let count = means.len() / 3;
    assert_eq!(sh.len(), count * BELOW, "sh must be [N, 9, 3] for {count} means");
    assert_eq!(third.len(), count * THIRD, "the third band must be [N, 7, 3] for {count} means");
    assert_eq!(projected.len(), count * PROJECTED, "projected must be [N, 8] for {count} means");
    assert_eq!(viewmat.len(), 16, "viewmat must hold 16 values");
    count
}
