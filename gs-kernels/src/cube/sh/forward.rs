//! Coefficients to colours.

use cubecl::prelude::*;

use super::basis::{basis, centre, direction, raw_colour};
use super::table::{read_rows, shared_len};
use crate::config::ShConfig;
use crate::constants;
use crate::cpu::sh::MAX_COEFFICIENTS;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid};
use crate::cube::camera::read_pose;
use crate::cube::error::CubeError;
use crate::cube::math::{Vec3, finite3, read3, write3};
use crate::cube::rows::read_radius;
use crate::rows::PROJECTED;

const INVALID_FEATURE: f32 = constants::INVALID_FEATURE as f32;

#[cube]
fn shown(raw: f32, valid: bool) -> f32 {
    select(valid, select(raw > 0.0f32, raw, 0.0f32), INVALID_FEATURE.runtime())
}

/// Forward: one unit per Gaussian.
#[cube(launch_unchecked)]
fn sh_forward_kernel(
    means: &[f32],
    sh: &[f32],
    viewmat: &[f32],
    projected: &[f32],
    colors: &mut [f32],
    count: u32,
    cubes: u32,
    #[comptime] degree: u32,
    #[comptime] coefficients: usize,
) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let used = comptime!(((degree + 1) * (degree + 1)) as usize);
    let mut shared = Shared::<[f32]>::new_slice(comptime!(shared_len(3 * coefficients)));
    let mut own = Array::<f32>::new(comptime!(3 * MAX_COEFFICIENTS));
    read_rows(sh, &mut own, &mut shared, count, comptime!(3 * coefficients), comptime!(3 * used));
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= count as usize {
        terminate!();
    }
    let mut colour = Vec3 { x: 0.0f32, y: 0.0f32, z: 0.0f32 };
    if read_radius(projected, index) > 0.0f32 {
        let dir = direction(read3(means, index), centre(read_pose(viewmat)));
        let mut b = Array::<f32>::new(MAX_COEFFICIENTS);
        basis(degree, dir.unit, &mut b);
        let raw = raw_colour(&b, &own, used);
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
    let cubes = count.div_ceil(UNITS);
    if count > 0 {
        // SAFETY: rows below `count`, which `check` found in every buffer, and coefficients of the stored degree.
        unsafe {
            sh_forward_kernel::launch_unchecked(
                client,
                grid(cubes),
                cube_dim(),
                means.arg(),
                sh.arg(),
                viewmat.arg(),
                projected.arg(),
                colors.arg(),
                count as u32,
                cubes as u32,
                config.degree.min(3),
                config.coefficients,
            );
        }
    }
    Ok(colors)
}

pub(super) fn check(means: &Buffer, sh: &Buffer, viewmat: &Buffer, projected: &Buffer, config: &ShConfig) -> usize {
    let count = means.len() / 3;
    let used = (config.degree.min(3) + 1).pow(2) as usize;
    assert_eq!(sh.len(), count * config.coefficients * 3, "sh must be [N, S, 3] for {count} means");
    assert_eq!(projected.len(), count * PROJECTED, "projected must be [N, 8] for {count} means");
    assert_eq!(viewmat.len(), 16, "viewmat must hold 16 values");
    assert!(used <= config.coefficients, "active degree above the stored one");
    count
}
