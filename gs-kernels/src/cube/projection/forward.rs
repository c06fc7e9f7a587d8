//! Means, scales and orientations to packed rows.

use cubecl::prelude::*;

use super::path::{check, path, read_quat};
use crate::config::ProjectionConfig;
use crate::constants;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::camera::{Pinhole, PinholeLaunch, read_pose};
use crate::cube::covariance::compensation;
use crate::cube::error::CubeError;
use crate::cube::math::{finite, read3};
use crate::cube::rows::{DeviceRow, write_row};
use crate::rows::PROJECTED;

const CUTOFF_SIGMAS: f32 = constants::CUTOFF_SIGMAS as f32;

/// Forward: one unit per Gaussian reads 10 values and writes its row of 8.
#[cube(launch_unchecked)]
fn projection_forward_kernel(
    means: &[f32],
    quats: &[f32],
    log_scales: &[f32],
    viewmat: &[f32],
    projected: &mut [f32],
    count: u32,
    pinhole: Pinhole,
    #[comptime] antialiased: bool,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= count as usize {
        terminate!();
    }
    let pose = read_pose(viewmat);
    let path = path(read3(means, index), read_quat(quats, index), read3(log_scales, index), pose, pinhole);
    let mean_x = pinhole.fx * (path.p.x / path.p.z) + pinhole.cx;
    let mean_y = pinhole.fy * (path.p.y / path.p.z) + pinhole.cy;
    let reach_x = CUTOFF_SIGMAS * path.ellipse.xx.sqrt();
    let reach_y = CUTOFF_SIGMAS * path.ellipse.yy.sqrt();
    let mut factor = 1.0f32;
    if comptime!(antialiased) {
        factor = compensation(path.ellipse.ratio);
    }
    let row = DeviceRow {
        mean_x,
        mean_y,
        d1: path.ellipse.d1,
        l: path.ellipse.l,
        d2: path.ellipse.d2,
        depth: path.p.z,
        compensation: factor,
        radius: select(reach_x > reach_y, reach_x, reach_y),
    };
    let row_finite = finite(row.mean_x)
        && finite(row.mean_y)
        && finite(row.d1)
        && finite(row.l)
        && finite(row.d2)
        && finite(row.compensation)
        && finite(row.radius);
    let seen_x = mean_x + reach_x > 0.0f32 && mean_x - reach_x < pinhole.width;
    let seen_y = mean_y + reach_y > 0.0f32 && mean_y - reach_y < pinhole.height;
    write_row(projected, index, row, path.drawable && row_finite && seen_x && seen_y);
}

/// Projects every Gaussian: `means` `[N, 3]`, `quats` `[N, 4]`, `log_scales` `[N, 3]`, `viewmat` `[4, 4]` to packed
/// rows `[N, 8]`; the twin of [`crate::cpu::projection::forward`].
///
/// # Errors
/// When the rows exceed one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn forward(
    client: &Client,
    means: &Buffer,
    quats: &Buffer,
    log_scales: &Buffer,
    viewmat: &Buffer,
    config: &ProjectionConfig,
) -> Result<Buffer, CubeError> {
    let count = check(means, quats, log_scales, viewmat);
    let projected = Buffer::empty(client, "projected Gaussians", count * PROJECTED)?;
    if count > 0 {
        // SAFETY: rows below `count`, which `check` found in every buffer.
        unsafe {
            projection_forward_kernel::launch_unchecked(
                client,
                grid_for(count),
                cube_dim(),
                means.arg(),
                quats.arg(),
                log_scales.arg(),
                viewmat.arg(),
                projected.arg(),
                count as u32,
                PinholeLaunch::of(config),
                config.antialiased,
            );
        }
    }
    Ok(projected)
}
