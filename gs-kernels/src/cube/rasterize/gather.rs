//! From the pairs' rows of moments to the gradients of each Gaussian.

use std::ops::Range;

use cubecl::prelude::*;

use super::attributes::Plan;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid, grid_for};
use crate::cube::error::CubeError;
use crate::cube::intersect::Intersections;
use crate::cube::math::finite;
use crate::cube::reduce::column_sum;
use crate::cube::rows::read_row;
use crate::rows::{PROJECTED, SCREEN};

/// Moments in a pair's row before the blended channels: `s`, `s dy`, `s dy^2`, `s u`, `s u dy`, `s u^2`, and the
/// absolute screen gradients along x (over `d1`) and y.
pub(super) const MOMENTS: usize = 8;

/// Gradients of [`super::forward`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct RasterizeGradients {
    /// `[N, 8]`; zero for compensation and radius.
    pub projected: Buffer,
    /// `[N]`
    pub opacities: Buffer,
    /// `[N, C]`
    pub features: Buffer,
    /// `[C]`, if it was wanted.
    pub background: Option<Buffer>,
    /// `[N, 4]`, see [`crate::rows::SCREEN`].
    pub screen: Buffer,
}

/// Most bytes of pair rows held at once where nothing is known of the device; a scene with more is processed in ranges
/// of tiles. At three channels this is twelve million pairs.
pub const PAIR_BYTES: usize = 512 << 20;

/// One unit per Gaussian: from moments to gradients; all zero if one is not finite. All outputs are parts of one
/// buffer.
#[cube(launch_unchecked)]
fn finish_kernel(
    sums: &[f32],
    projected: &[f32],
    opacities: &[f32],
    gradients: &mut [f32],
    count: u32,
    start_opacities: u32,
    start_features: u32,
    start_screen: u32,
    #[comptime] channels: usize,
    #[comptime] depth: bool,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= count as usize {
        terminate!();
    }
    let row_len = comptime!(MOMENTS + channels + depth as usize);
    let from = index * row_len;
    let row = read_row(projected, index);
    let s = sums[from];
    let s_dy = sums[from + 1];
    let s_u = sums[from + 3];
    let mean_x = -(row.d1 * s_u);
    let mean_y = -(row.d1 * row.l * s_u + row.d2 * s_dy);
    let v_d1 = 0.5f32 * sums[from + 5];
    let v_l = row.d1 * sums[from + 4];
    let v_d2 = 0.5f32 * sums[from + 2];
    let mut v_depth = 0.0f32;
    if comptime!(depth) {
        v_depth = sums[from + comptime!(MOMENTS + channels)];
    }
    // A Gaussian that was never blended may have opacity 0.
    let opacity = opacities[index];
    let v_opacity = select(s == 0.0f32, 0.0f32, -(s / opacity));
    let abs_x = row.d1 * sums[from + 6];
    let abs_y = sums[from + 7];

    let mut kept = finite(mean_x)
        && finite(mean_y)
        && finite(v_d1)
        && finite(v_l)
        && finite(v_d2)
        && finite(v_depth)
        && finite(v_opacity)
        && finite(abs_x)
        && finite(abs_y);
    for c in 0..channels {
        kept = kept && finite(sums[from + MOMENTS + c]);
    }

    let to = index * PROJECTED;
    gradients[to] = select(kept, mean_x, 0.0f32);
    gradients[to + 1] = select(kept, mean_y, 0.0f32);
    gradients[to + 2] = select(kept, v_d1, 0.0f32);
    gradients[to + 3] = select(kept, v_l, 0.0f32);
    gradients[to + 4] = select(kept, v_d2, 0.0f32);
    gradients[to + 5] = select(kept, v_depth, 0.0f32);
    gradients[to + 6] = 0.0f32;
    gradients[to + 7] = 0.0f32;
    gradients[start_opacities as usize + index] = select(kept, v_opacity, 0.0f32);
    for c in 0..channels {
        gradients[start_features as usize + index * channels + c] = select(kept, sums[from + MOMENTS + c], 0.0f32);
    }
    let to = start_screen as usize + index * SCREEN;
    gradients[to] = select(kept, mean_x, 0.0f32);
    gradients[to + 1] = select(kept, mean_y, 0.0f32);
    gradients[to + 2] = select(kept, abs_x, 0.0f32);
    gradients[to + 3] = select(kept, abs_y, 0.0f32);
}

/// One cube: adds the tiles' parts of the background's gradient `[tiles, C]`; zero if a sum is not finite.
#[cube(launch_unchecked)]
fn background_sum_kernel(backgrounds: &[f32], v_background: &mut [f32], tiles: u32, #[comptime] channels: usize) {
    let mut slots = Shared::<[f32]>::new_slice(UNITS);
    let mut all_finite = true;
    for c in 0..channels {
        let total = column_sum(backgrounds, tiles, c as u32, channels, &mut slots);
        all_finite = all_finite && finite(total);
        if UNIT_POS == 0 {
            v_background[c] = total;
        }
    }
    if UNIT_POS == 0 && !all_finite {
        for c in 0..channels {
            v_background[c] = 0.0f32;
        }
    }
}

/// Cuts the tiles into ranges of at most `pairs` pairs each; also returns the most pairs of a range. Only if one range
/// is not enough are the tiles' offsets read back.
#[allow(clippy::single_range_in_vec_init)] // one range is meant, not its numbers
pub(super) fn tile_ranges(
    client: &Client,
    lists: &Intersections,
    tiles: usize,
    pairs: usize,
) -> Result<(Vec<Range<usize>>, usize), CubeError> {
    let total = lists.gaussian_ids.len();
    if total <= pairs {
        return Ok((vec![0..tiles], total));
    }
    let offsets = lists.tile_offsets.download::<u32>(client)?;
    let len = |range: &Range<usize>| (offsets[range.end] - offsets[range.start]) as usize;
    let mut ranges = vec![0..0];
    for tile in 0..tiles {
        let last = ranges.last_mut().expect("begins with one range");
        if last.start < last.end && len(&(last.start..tile + 1)) > pairs {
            ranges.push(tile..tile + 1);
        } else {
            last.end = tile + 1;
        }
    }
    let most = ranges.iter().map(len).max().unwrap_or(0);
    Ok((ranges, most))
}

/// From the Gaussians' sums of moments and the tiles' parts of the background to gradients.
pub(super) fn finish(
    client: &Client,
    plan: &Plan,
    projected: &Buffer,
    opacities: &Buffer,
    sums: &Buffer,
    backgrounds: &Buffer,
    of_background: bool,
) -> Result<RasterizeGradients, CubeError> {
    let count = plan.count;
    let lens = [count * PROJECTED, count, count * plan.channels, count * SCREEN];
    let slab = Buffer::slab(client, "gradients of the rasterizer", lens)?;
    if count > 0 {
        // SAFETY: rows below `count` of buffers that `Plan::new` and the slab's lengths make that long.
        unsafe {
            finish_kernel::launch_unchecked(
                client,
                grid_for(count),
                cube_dim(),
                sums.arg(),
                projected.arg(),
                opacities.arg(),
                slab.whole.arg(),
                count as u32,
                slab.starts[1] as u32,
                slab.starts[2] as u32,
                slab.starts[3] as u32,
                plan.channels,
                plan.depth,
            );
        }
    }
    let mut v_background = None;
    if of_background {
        let sums = Buffer::empty(client, "gradient of the background", plan.channels)?;
        let (tiles, channels) = (plan.tiles as u32, plan.channels);
        let (parts, total) = (backgrounds.arg(), sums.arg());
        // SAFETY: a part for each tile and channel, a sum for each channel.
        unsafe {
            background_sum_kernel::launch_unchecked(client, grid(1), cube_dim(), parts, total, tiles, channels);
        }
        v_background = Some(sums);
    }
    let [v_projected, v_opacities, v_features, screen] = slab.parts;
    Ok(RasterizeGradients {
        projected: v_projected,
        opacities: v_opacities,
        features: v_features,
        background: v_background,
        screen,
    })
}
