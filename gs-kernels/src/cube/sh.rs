//! View-dependent colour from real spherical harmonics, forward and backward: one unit a Gaussian.
//!
//! `colour = max(0, 1/2 + sum_k Y_k(dir) sh_k)` with `dir` the unit vector from the camera to the Gaussian; signs and
//! order of the basis as in 3DGS. The degree is known when the kernel is compiled, so no coefficient above it is read.

use cubecl::prelude::*;

use crate::config::ShConfig;
use crate::constants;
use crate::cpu::sh::{MAX_COEFFICIENTS, SH_C0, SH_C1, SH_C2, SH_C3};
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid, grid_for};
use crate::cube::camera::{Pose, read_pose};
use crate::cube::error::CubeError;
use crate::cube::math::{Vec3, combine, dot, finite, finite3, mat_t_vec, read3, scaled, write3};
use crate::cube::reduce::{column_sum, cube_sum};
use crate::cube::rows::read_radius;
use crate::rows::PROJECTED;

const INVALID_FEATURE: f32 = constants::INVALID_FEATURE as f32;
const Y0: f32 = SH_C0 as f32;
const Y1: f32 = SH_C1 as f32;
const Y2: [f32; 5] = [SH_C2[0] as f32, SH_C2[1] as f32, SH_C2[2] as f32, SH_C2[3] as f32, SH_C2[4] as f32];
const Y3: [f32; 7] = [
    SH_C3[0] as f32,
    SH_C3[1] as f32,
    SH_C3[2] as f32,
    SH_C3[3] as f32,
    SH_C3[4] as f32,
    SH_C3[5] as f32,
    SH_C3[6] as f32,
];

/// The camera's place in the world, `-R^T t`.
#[cube]
fn centre(pose: Pose) -> Vec3 {
    scaled(-1.0f32, mat_t_vec(pose.rotation, pose.translation))
}

/// Unit vector from the camera and the distance; at the camera itself the direction is zero and has no gradient.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
struct Direction {
    unit: Vec3,
    distance: f32,
}

#[cube]
fn direction(mean: Vec3, centre: Vec3) -> Direction {
    let offset = combine(1.0f32, mean, -1.0f32, centre);
    let distance2 = dot(offset, offset);
    let known = finite(distance2) && distance2 > 0.0f32;
    let distance = select(known, distance2, 1.0f32).sqrt();
    let unit = Vec3 {
        x: select(known, offset.x / distance, 0.0f32),
        y: select(known, offset.y / distance, 0.0f32),
        z: select(known, offset.z / distance, 0.0f32),
    };
    Direction { unit, distance }
}

/// The basis up to `degree` at the unit vector `d`, into `b`.
#[cube]
fn basis(#[comptime] degree: u32, d: Vec3, b: &mut Array<f32>) {
    let x = d.x;
    let y = d.y;
    let z = d.z;
    b[0] = f32::new(Y0);
    if comptime!(degree >= 1) {
        b[1] = -Y1 * y;
        b[2] = Y1 * z;
        b[3] = -Y1 * x;
    }
    if comptime!(degree >= 2) {
        b[4] = comptime!(Y2[0]) * x * y;
        b[5] = comptime!(Y2[1]) * y * z;
        b[6] = comptime!(Y2[2]) * (2.0f32 * z * z - x * x - y * y);
        b[7] = comptime!(Y2[3]) * x * z;
        b[8] = comptime!(Y2[4]) * (x * x - y * y);
    }
    if comptime!(degree >= 3) {
        b[9] = comptime!(Y3[0]) * y * (3.0f32 * x * x - y * y);
        b[10] = comptime!(Y3[1]) * x * y * z;
        b[11] = comptime!(Y3[2]) * y * (4.0f32 * z * z - x * x - y * y);
        b[12] = comptime!(Y3[3]) * z * (2.0f32 * z * z - 3.0f32 * x * x - 3.0f32 * y * y);
        b[13] = comptime!(Y3[4]) * x * (4.0f32 * z * z - x * x - y * y);
        b[14] = comptime!(Y3[5]) * z * (x * x - y * y);
        b[15] = comptime!(Y3[6]) * x * (x * x - 3.0f32 * y * y);
    }
}

/// Gradient by the unit vector from the gradient `v` by [`basis`].
#[cube]
fn basis_vjp(#[comptime] degree: u32, d: Vec3, v: &Array<f32>) -> Vec3 {
    let x = d.x;
    let y = d.y;
    let z = d.z;
    let mut gx = 0.0f32;
    let mut gy = 0.0f32;
    let mut gz = 0.0f32;
    if comptime!(degree >= 1) {
        gx -= Y1 * v[3];
        gy -= Y1 * v[1];
        gz += Y1 * v[2];
    }
    if comptime!(degree >= 2) {
        let k4 = comptime!(Y2[0]) * v[4];
        let k5 = comptime!(Y2[1]) * v[5];
        let k6 = comptime!(Y2[2]) * v[6];
        let k7 = comptime!(Y2[3]) * v[7];
        let k8 = comptime!(Y2[4]) * v[8];
        gx += k4 * y - 2.0f32 * k6 * x + k7 * z + 2.0f32 * k8 * x;
        gy += k4 * x + k5 * z - 2.0f32 * k6 * y - 2.0f32 * k8 * y;
        gz += k5 * y + 4.0f32 * k6 * z + k7 * x;
    }
    if comptime!(degree >= 3) {
        let k9 = comptime!(Y3[0]) * v[9];
        let k10 = comptime!(Y3[1]) * v[10];
        let k11 = comptime!(Y3[2]) * v[11];
        let k12 = comptime!(Y3[3]) * v[12];
        let k13 = comptime!(Y3[4]) * v[13];
        let k14 = comptime!(Y3[5]) * v[14];
        let k15 = comptime!(Y3[6]) * v[15];
        let xx = x * x;
        let yy = y * y;
        let zz = z * z;
        gx += 6.0f32 * k9 * x * y + k10 * y * z - 2.0f32 * k11 * x * y - 6.0f32 * k12 * x * z
            + k13 * (4.0f32 * zz - 3.0f32 * xx - yy)
            + 2.0f32 * k14 * x * z
            + 3.0f32 * k15 * (xx - yy);
        gy += 3.0f32 * k9 * (xx - yy) + k10 * x * z + k11 * (4.0f32 * zz - xx - 3.0f32 * yy)
            - 6.0f32 * k12 * y * z
            - 2.0f32 * k13 * x * y
            - 2.0f32 * k14 * y * z
            - 6.0f32 * k15 * x * y;
        gz += k10 * x * y
            + 8.0f32 * k11 * y * z
            + k12 * (6.0f32 * zz - 3.0f32 * xx - 3.0f32 * yy)
            + 8.0f32 * k13 * x * z
            + k14 * (xx - yy);
    }
    Vec3 { x: gx, y: gy, z: gz }
}

/// `1/2 + sum_k b_k sh_k`, not yet held at zero; `base` is where the Gaussian's coefficients begin.
#[cube]
fn raw_colour(b: &Array<f32>, sh: &[f32], base: usize, #[comptime] used: usize) -> Vec3 {
    let mut r = 0.5f32;
    let mut g = 0.5f32;
    let mut blue = 0.5f32;
    #[unroll]
    for k in 0..used {
        r += b[k] * sh[base + 3 * k];
        g += b[k] * sh[base + 3 * k + 1];
        blue += b[k] * sh[base + 3 * k + 2];
    }
    Vec3 { x: r, y: g, z: blue }
}

#[cube]
fn shown(raw: f32, valid: bool) -> f32 {
    select(valid, select(raw > 0.0f32, raw, 0.0f32), INVALID_FEATURE.runtime())
}

/// Forward: one unit a Gaussian reads `3 (degree + 1)^2 + 4` values and writes 3.
#[cube(launch)]
fn sh_forward_kernel(
    means: &[f32],
    sh: &[f32],
    viewmat: &[f32],
    projected: &[f32],
    colors: &mut [f32],
    count: u32,
    stride: u32,
    #[comptime] degree: u32,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= count as usize {
        terminate!();
    }
    let mut colour = Vec3 { x: 0.0f32, y: 0.0f32, z: 0.0f32 };
    if read_radius(projected, index) > 0.0f32 {
        let dir = direction(read3(means, index), centre(read_pose(viewmat)));
        let mut b = Array::<f32>::new(MAX_COEFFICIENTS);
        basis(degree, dir.unit, &mut b);
        let raw = raw_colour(&b, sh, index * stride as usize, comptime!(((degree + 1) * (degree + 1)) as usize));
        let valid = finite3(raw);
        colour.x = shown(raw.x, valid);
        colour.y = shown(raw.y, valid);
        colour.z = shown(raw.z, valid);
    }
    write3(colors, 0, index, colour);
}

/// Colours `[N, 3]` seen from the camera: `means` `[N, 3]`, `sh` `[N, S, 3]`, `viewmat` `[4, 4]`, `projected` `[N, 8]`
/// (only its culling is read); the twin of [`crate::cpu::sh::forward`].
///
/// # Errors
/// When the colours exceed one buffer.
///
/// # Panics
/// When the buffers disagree in length, or the active degree is above the stored one.
pub fn forward(
    client: &Client,
    means: &Buffer,
    sh: &Buffer,
    viewmat: &Buffer,
    projected: &Buffer,
    config: &ShConfig,
) -> Result<Buffer, CubeError> {
    let count = check(means, sh, viewmat, projected, config);
    let colors = Buffer::empty(client, "colours", count * 3)?;
    if count > 0 {
        sh_forward_kernel::launch(
            client,
            grid_for(count),
            cube_dim(),
            means.arg(),
            sh.arg(),
            viewmat.arg(),
            projected.arg(),
            colors.arg(),
            count as u32,
            config.coefficients as u32 * 3,
            config.degree.min(3),
        );
    }
    Ok(colors)
}

/// Backward: one unit a Gaussian; all outputs are parts of one buffer, to stay within eight bindings.
#[cube(launch)]
fn sh_backward_kernel(
    means: &[f32],
    sh: &[f32],
    viewmat: &[f32],
    projected: &[f32],
    v_colors: &[f32],
    gradients: &mut [f32],
    count: u32,
    cubes: u32,
    start_sh: u32,
    start_sums: u32,
    #[comptime] degree: u32,
    #[comptime] coefficients: usize,
) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let used = comptime!(((degree + 1) * (degree + 1)) as usize);
    let mut slots = Shared::<[f32]>::new_slice(UNITS);
    let inside = CUBE_POS * UNITS + (UNIT_POS as usize) < count as usize;
    let index = select(inside, CUBE_POS * UNITS + UNIT_POS as usize, 0usize);
    let base = index * comptime!(3 * coefficients);

    let dir = direction(read3(means, index), centre(read_pose(viewmat)));
    let mut b = Array::<f32>::new(MAX_COEFFICIENTS);
    basis(degree, dir.unit, &mut b);
    let raw = raw_colour(&b, sh, base, used);
    let v_shown = read3(v_colors, index);
    let valid = inside && finite3(raw) && finite3(v_shown) && read_radius(projected, index) > 0.0f32;
    let v = Vec3 {
        x: select(valid && raw.x > 0.0f32, v_shown.x, 0.0f32),
        y: select(valid && raw.y > 0.0f32, v_shown.y, 0.0f32),
        z: select(valid && raw.z > 0.0f32, v_shown.z, 0.0f32),
    };

    let mut v_basis = Array::<f32>::new(MAX_COEFFICIENTS);
    if inside {
        #[unroll]
        for k in 0..used {
            let coefficient = Vec3 { x: sh[base + 3 * k], y: sh[base + 3 * k + 1], z: sh[base + 3 * k + 2] };
            v_basis[k] = select(valid, dot(coefficient, v), 0.0f32);
            let to = start_sh as usize + base + 3 * k;
            // The basis is at most 3 in magnitude.
            gradients[to] = b[k] * v.x;
            gradients[to + 1] = b[k] * v.y;
            gradients[to + 2] = b[k] * v.z;
        }
        #[unroll]
        for k in comptime!(3 * used)..comptime!(3 * coefficients) {
            gradients[start_sh as usize + base + k] = 0.0f32;
        }
    }

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
    let x = cube_sum(v_mean.x, &mut slots);
    let y = cube_sum(v_mean.y, &mut slots);
    let z = cube_sum(v_mean.z, &mut slots);
    if UNIT_POS == 0 {
        write3(gradients, start_sums as usize, CUBE_POS, Vec3 { x, y, z });
    }
}

/// One cube: adds the cubes' sums of the gradient by the means `[rows, 3]`, and carries the camera centre's gradient,
/// which is its negative, through `-R^T t` to `v_viewmat` `[4, 4]`; zero when it is not finite.
#[cube(launch)]
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

/// Gradients of [`forward`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct ShGradients {
    /// `[N, 3]`, through the view direction.
    pub means: Buffer,
    /// `[N, S, 3]`; zero above the active degree.
    pub sh: Buffer,
    /// `[4, 4]`, through the camera centre.
    pub viewmat: Buffer,
}

/// Backward of [`forward`] from `v_colors` `[N, 3]`; the twin of [`crate::cpu::sh::backward`]. A channel held at 0
/// passes nothing.
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
) -> Result<ShGradients, CubeError> {
    let count = check(means, sh, viewmat, projected, config);
    assert_eq!(v_colors.len(), count * 3, "v_colors must be [N, 3]");
    let cubes = count.div_ceil(UNITS);
    let slab = Buffer::slab(client, "gradients of the colours", [count * 3, sh.len(), cubes * 3])?;
    if count > 0 {
        sh_backward_kernel::launch(
            client,
            grid(cubes),
            cube_dim(),
            means.arg(),
            sh.arg(),
            viewmat.arg(),
            projected.arg(),
            v_colors.arg(),
            slab.whole.arg(),
            count as u32,
            cubes as u32,
            slab.starts[1] as u32,
            slab.starts[2] as u32,
            config.degree.min(3),
            config.coefficients,
        );
    }
    let [v_means, v_sh, sums] = slab.parts;
    let v_viewmat = Buffer::empty(client, "gradient of the camera", 16)?;
    centre_sum_kernel::launch(client, grid(1), cube_dim(), sums.arg(), viewmat.arg(), v_viewmat.arg(), cubes as u32);
    Ok(ShGradients { means: v_means, sh: v_sh, viewmat: v_viewmat })
}

fn check(means: &Buffer, sh: &Buffer, viewmat: &Buffer, projected: &Buffer, config: &ShConfig) -> usize {
    let count = means.len() / 3;
    let used = (config.degree.min(3) + 1).pow(2) as usize;
    assert_eq!(sh.len(), count * config.coefficients * 3, "sh must be [N, S, 3] for {count} means");
    assert_eq!(projected.len(), count * PROJECTED, "projected must be [N, 8] for {count} means");
    assert_eq!(viewmat.len(), 16, "viewmat must hold 16 values");
    assert!(used <= config.coefficients, "active degree above the stored one");
    count
}
