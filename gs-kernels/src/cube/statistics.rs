//! Statistics of classic density control (3DGS, section 5.2), in place; the twin of [`crate::cpu::statistics`].

use cubecl::prelude::*;

use crate::config::StatisticsConfig;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::rows::SCREEN;

/// One unit per Gaussian.
#[cube(launch_unchecked)]
fn statistics_kernel(
    gradient: &mut [f32],
    views: &mut [f32],
    screen: &[f32],
    rows: &[f32],
    count: u32,
    half_width: f32,
    half_height: f32,
    #[comptime] first: usize,
    #[comptime] columns: usize,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= count as usize {
        terminate!();
    }
    let x = screen[index * SCREEN + first] * half_width;
    let y = screen[index * SCREEN + first + 1] * half_height;
    gradient[index] += (x * x + y * y).sqrt();
    if rows[index * columns + columns - 1] > 0.0f32 {
        views[index] += 1.0f32;
    }
}

/// Adds one view in place; the twin of [`crate::cpu::statistics::gather`].
///
/// # Panics
/// When the buffers disagree in length.
pub fn gather(
    client: &Client,
    gradient: &Buffer,
    views: &Buffer,
    screen: &Buffer,
    rows: &Buffer,
    config: &StatisticsConfig,
) {
    let count = gradient.len();
    let fits = views.len() == count && screen.len() == SCREEN * count && rows.len() == config.columns * count;
    assert!(fits, "views, screen and rows must be [N], [N, {SCREEN}] and [N, {}] for N = {count}", config.columns);
    if count == 0 {
        return;
    }
    let [half_width, half_height] = config.halves().map(|half| half as f32);
    // SAFETY: every index is below the length of its buffer by the assertion above.
    unsafe {
        statistics_kernel::launch_unchecked(
            client,
            grid_for(count),
            cube_dim(),
            gradient.arg(),
            views.arg(),
            screen.arg(),
            rows.arg(),
            count as u32,
            half_width,
            half_height,
            config.first_column(),
            config.columns,
        );
    }
}
