//! Blending backward. One cube of 64 units per tile, four pixels per unit.
//!
//! The forward pass has saved every pixel's final transmittance and the position of its last Gaussian. The walk goes
//! back to front with the light `S` behind each Gaussian as one running number per pixel:
//!
//! `T = T_behind / (1 - alpha)`, `q = f . v`, `v_alpha = T q - S / (1 - alpha)`, `S += alpha T q`,
//!
//! where `v` is the gradient with respect to the pixel's channels. The division is harmless because alpha is at most
//! 0.999, and no value is a difference of large sums. With `s = -alpha v_alpha = v_sigma` and `u = dx + l dy`, all
//! gradients with respect to the ellipse are moments of `s` over pixels.
//!
//! Every (tile, Gaussian) pair has a row of moments of its own, written by its tile alone, and the rows of a Gaussian
//! are added in a fixed order ([`super::pair_sum`]): no atomic addition of floats, so equal inputs give equal bits.
//! Inside the tile a unit first adds its four pixels in registers; the 64 units' sums are then added in shared memory,
//! for as many Gaussians at once as fit there. No plane operation is used, so the width of a plane does not matter.

use cubecl::prelude::*;

use super::attributes::{PIXELS, Plan, Quad, channel, output_pixel, place_of, quads, stage};
use super::blocks::{self, blocks_reached};
use super::forward::{Inputs, Saved, UNROLLED};
use super::gather::{MOMENTS, PAIR_BYTES, RasterizeGradients, finish, tile_ranges};
use super::pair_sum::PairSums;
use super::slots::{SLOT, SLOTS, UNITS, sum_slots};
use crate::config::RasterizeConfig;
use crate::constants::TILE;
use crate::cube::blend::{ALPHA_MAX, ALPHA_MIN, capped, place, raw_alpha};
use crate::cube::buffer::{Buffer, grid, most_bytes};
use crate::cube::error::CubeError;

/// Pixels of a unit: one in each of four blocks below each other.
const OWN: usize = PIXELS / UNITS;
/// Rows of the tile that the units cover at once.
const ROWS: usize = UNITS / TILE;
/// The blocks below each other, as bits of a mask: a warp of units looks at those of its half of the tile.
const COLUMN_OF_BLOCKS: u32 = 0b0101_0101;
/// Shared memory for a batch, in floats.
const STAGE: usize = 448;
/// Most rows of a batch, by [`Plan::batch`]: of one channel.
const ROWS_STAGED: usize = 1 << (STAGE / (4 * quads(1))).ilog2();
/// Bytes of shared memory of a cube. A card with 100 KB for a multiprocessor holds eleven such cubes, 22 warps; of
/// twice the size it holds six, whose 12 warps do not hide the barriers and chains of additions.
const SHARED_BYTES: usize = 8 << 10;
const _: () = assert!(4 * (STAGE + SLOTS * SLOT + ROWS_STAGED + 1) <= SHARED_BYTES);

/// One cube per tile: writes a row of moments for every pair of the tile, and the tile's part of the background's
/// gradient.
#[cube(launch_unchecked)]
fn rasterize_backward_kernel(
    attributes: &[Quad],
    saved: &[u32],
    tile_offsets: &[u32],
    gaussian_ids: &[u32],
    v_output: &[f32],
    pairs: &mut [f32],
    backgrounds: &mut [f32],
    width: u32,
    height: u32,
    tile_columns: u32,
    first_tile: u32,
    tiles: u32,
    all_tiles: u32,
    pixels: u32,
    #[comptime] channels: usize,
    #[comptime] depth: bool,
    #[comptime] placed: bool,
    #[comptime] of_background: bool,
    #[comptime] batch: u32,
) {
    if CUBE_POS >= tiles as usize {
        terminate!();
    }
    let blended = comptime!(channels + depth as usize);
    let quads = comptime!(quads(channels + depth as usize));
    let row_len = comptime!(MOMENTS + channels + depth as usize);
    let row_len_u32 = comptime!(row_len as u32);
    let unroll = comptime!(channels <= UNROLLED);
    // Rows that are added in shared memory at once; a row longer than the slots is added piece by piece.
    let group = comptime!((SLOTS / row_len).max(1) as u32);
    let pieces = comptime!(row_len.div_ceil(SLOTS));

    let tile = first_tile + CUBE_POS as u32;
    let unit = UNIT_POS as usize;
    let image_tile = place_of(tile_offsets, tile, all_tiles, placed);
    // The units of a warp share a half of the tile.
    let half = UNIT_POS / blocks::UNITS;
    let lane = UNIT_POS % blocks::UNITS;
    let own_x = half * blocks::WIDE + lane % blocks::WIDE;
    let own_y = lane / blocks::WIDE;
    let left = image_tile % tile_columns * comptime!(TILE as u32);
    let top = image_tile / tile_columns * comptime!(TILE as u32);
    let (x, y) = (left + own_x, top + own_y);
    let pixel_x = f32::cast_from(x) + 0.5f32;
    let pixel_y = f32::cast_from(y) + 0.5f32;

    let mut staged = Shared::<[Quad]>::new_slice(comptime!(batch as usize * quads));
    let mut slots = Shared::<[f32]>::new_slice(comptime!(SLOTS * SLOT));
    let mut masks = Shared::<[u32]>::new_slice(comptime!(batch as usize));
    let last_drawn = Shared::<[Atomic<u32>]>::new_slice(1usize);
    let begin = tile_offsets[tile as usize];
    let end = tile_offsets[tile as usize + 1];
    // Rows are written from the first tile of the launch on.
    let base = tile_offsets[first_tile as usize];
    if UNIT_POS == 0 {
        last_drawn[0].store(0u32);
    }
    sync_cube();

    // The pixels' saved state and gradients, zero outside the image, and the light behind all Gaussians.
    let mut t = Array::<f32>::new(OWN);
    let mut last = Array::<u32>::new(OWN);
    let mut v = Array::<f32>::new(comptime!(OWN * (blended + 1)));
    let mut behind = Array::<f32>::new(OWN);
    let mut own_last = begin;
    #[unroll]
    for j in 0..OWN {
        let row = y + comptime!((j * ROWS) as u32);
        let inside = x < width && row < height;
        let own = (own_y + comptime!((j * ROWS) as u32)) * comptime!(TILE as u32) + own_x;
        let number = output_pixel(x, row, width, tile, own, placed);
        let pixel = number * comptime!(blended + 1);
        t[j] = 1.0f32;
        last[j] = begin;
        if inside {
            t[j] = f32::reinterpret(saved[number]);
            last[j] = saved[pixels as usize + number];
        }
        own_last = select(last[j] > own_last, last[j], own_last);
        #[unroll(unroll)]
        for c in 0..comptime!(blended + 1) {
            let mut value = 0.0f32;
            if inside {
                value = v_output[pixel + c];
            }
            v[j * comptime!(blended + 1) + c] = value;
        }
        let mut light = -v[j * comptime!(blended + 1) + blended];
        #[unroll(unroll)]
        for c in 0..channels {
            light += f32::reinterpret(saved[2 * pixels as usize + c]) * v[j * comptime!(blended + 1) + c];
        }
        behind[j] = t[j] * light;
    }
    last_drawn[0].fetch_max(own_last - begin);

    // The background's gradient is the sum of T v.
    #[unroll]
    for piece in 0..comptime!(if of_background { channels.div_ceil(SLOTS) } else { 0 }) {
        let from = comptime!(piece * SLOTS);
        let len = comptime!((channels - piece * SLOTS).min(SLOTS));
        #[unroll]
        for c in 0..len {
            let mut sum = 0.0f32;
            #[unroll]
            for j in 0..OWN {
                sum += t[j] * v[j * comptime!(blended + 1) + from + c];
            }
            slots[c * SLOT + unit] = sum;
        }
        sum_slots(&slots, comptime!(len as u32).runtime(), backgrounds, tile as usize * channels + from);
    }

    // Gaussians behind the last that a pixel blended have a row of zeros.
    let drawn = workgroup_uniform_load_atomic(&last_drawn[0]);
    let mut at = (begin - base + drawn) as usize * row_len + unit;
    while at < (end - base) as usize * row_len {
        pairs[at] = 0.0f32;
        at += UNITS;
    }
    let mut sums = Array::<f32>::new(row_len);
    // Counted from the list's begin, which is read from a buffer: no barrier below depends on it.
    let batches = drawn.div_ceil(batch);
    for b in 0..batches {
        let before = (batches - 1u32 - b) * batch;
        let first = begin + before;
        let rest = drawn - before;
        let count = select(rest < batch, rest, batch.runtime());
        sync_cube();
        stage(attributes, gaussian_ids, first, count, &mut staged, quads, comptime!(UNITS as u32));
        sync_cube();
        // One unit tests a Gaussian against all blocks.
        let mut k = UNIT_POS;
        while k < count {
            masks[k as usize] = blocks_reached(&staged, k as usize * quads, left, top);
            k += comptime!(UNITS as u32);
        }
        sync_cube();
        let groups = count.div_ceil(group);
        for g in 0..groups {
            // Gaussians `bottom..top` of the batch, nearest last.
            let top = count - g * group;
            let bottom = select(top > group, top - group, 0u32);
            for step in 0..top - bottom {
                let k = top - 1u32 - step;
                let row = k as usize * quads;
                #[unroll(unroll)]
                for value in 0..row_len {
                    sums[value] = 0.0f32;
                }
                let reached = masks[k as usize] >> half;
                if reached & COLUMN_OF_BLOCKS != 0u32 {
                    let (one, two) = (staged[row], staged[row + 1]);
                    let dx = pixel_x - one.extract(0usize);
                    let (d1, l, d2) = (one.extract(2usize), one.extract(3usize), two.extract(0usize));
                    #[unroll]
                    for j in 0..OWN {
                        let block = comptime!(1u32 << (j as u32 * blocks::ACROSS));
                        if reached & block != 0u32 {
                            let dy = pixel_y + comptime!((j * ROWS) as f32) - one.extract(1usize);
                            let at = place(dx, dy, d1, l, d2);
                            if at.twice_sigma <= two.extract(2usize) && first + k < last[j] {
                                let raw = raw_alpha(at.twice_sigma, two.extract(1usize));
                                if raw >= ALPHA_MIN {
                                    let alpha = capped(raw);
                                    let inverse = 1.0f32 / (1.0f32 - alpha);
                                    let before = t[j] * inverse;
                                    // Rounding may differ between the passes, but transmittance never exceeds 1.
                                    let before = select(before < 1.0f32, before, 1.0f32);
                                    let weight = alpha * before;
                                    let mut q = 0.0f32;
                                    #[unroll(unroll)]
                                    for c in 0..blended {
                                        let v_channel = v[j * comptime!(blended + 1) + c];
                                        q += channel(&staged, row, c) * v_channel;
                                        sums[MOMENTS + c] += weight * v_channel;
                                    }
                                    let v_alpha = before * q - behind[j] * inverse;
                                    behind[j] += weight * q;
                                    t[j] = before;
                                    // A capped alpha does not depend on sigma or opacity.
                                    let s = select(raw < ALPHA_MAX, -alpha * v_alpha, 0.0f32);
                                    let su = s * at.u;
                                    let sy = s * dy;
                                    sums[0] += s;
                                    sums[1] += sy;
                                    sums[2] += sy * dy;
                                    sums[3] += su;
                                    sums[4] += su * dy;
                                    sums[5] += su * at.u;
                                    sums[6] += su.abs();
                                    sums[7] += (d1 * l * su + d2 * sy).abs();
                                }
                            }
                        }
                    }
                }
                let slot = (k - bottom) as usize * row_len;
                #[unroll]
                for value in 0..comptime!(row_len.min(SLOTS)) {
                    slots[(slot + value) * SLOT + unit] = sums[value];
                }
            }
            let to = (first + bottom - base) as usize * row_len;
            let values = select(
                comptime!(pieces > 1).runtime(),
                comptime!(SLOTS as u32).runtime(),
                (top - bottom) * row_len_u32,
            );
            sum_slots(&slots, values, pairs, to);
            #[unroll]
            for piece in 1..pieces {
                let from = comptime!(piece * SLOTS);
                let len = comptime!((row_len - piece * SLOTS).min(SLOTS));
                #[unroll]
                for value in 0..len {
                    slots[value * SLOT + unit] = sums[from + value];
                }
                sum_slots(&slots, comptime!(len as u32).runtime(), pairs, to + from);
            }
        }
    }
}

/// Backward of [`super::forward`] from `v_output` in the shape of its result, with what that `saved`; the twin of
/// [`crate::cpu::rasterize::backward`]. A Gaussian whose gradient is not finite receives zero. The gradient of the
/// background is made only if it is wanted.
///
/// # Errors
/// When a buffer would be too large, or the device fails while the tiles' offsets are read.
///
/// # Panics
/// When the buffers disagree in length.
pub fn backward(
    client: &Client,
    config: &RasterizeConfig,
    inputs: &Inputs,
    saved: &Saved,
    v_output: &Buffer,
    of_background: bool,
) -> Result<RasterizeGradients, CubeError> {
    backward_within(client, config, inputs, saved, v_output, of_background, PAIR_BYTES)
}

/// [`backward`] with at most `pair_bytes` of pair rows at once (or those of one tile, if they are more). The sums keep
/// their order, so the limit does not change a bit of the result.
///
/// # Errors
/// As [`backward`].
///
/// # Panics
/// When the buffers disagree in length.
pub fn backward_within(
    client: &Client,
    config: &RasterizeConfig,
    inputs: &Inputs,
    saved: &Saved,
    v_output: &Buffer,
    of_background: bool,
    pair_bytes: usize,
) -> Result<RasterizeGradients, CubeError> {
    let Inputs { projected, opacities, features, background, lists } = *inputs;
    let plan = Plan::new(config, projected, opacities, features, background, lists);
    let pixels = plan.pixels();
    assert_eq!(v_output.len(), pixels * config.output_channels(), "v_output must have the shape of the output");
    assert_eq!(saved.attributes.len(), plan.attributes(), "the saved rows must be those of the inputs");
    assert_eq!(saved.pixels.len(), 2 * pixels + plan.channels, "the saved pixels must be those of the output");
    let row_len = MOMENTS + plan.blended();
    let parts = if of_background { plan.tiles * plan.channels } else { 0 };
    let backgrounds = Buffer::empty(client, "gradients of the background by tile", parts)?;
    let sums = PairSums::new(client, &plan, lists)?;

    let pair_bytes = pair_bytes.min(usize::try_from(most_bytes(client)).unwrap_or(usize::MAX));
    let (ranges, most) = tile_ranges(client, lists, plan.tiles, pair_bytes / (4 * row_len))?;
    let pairs = Buffer::empty(client, "gradients by tile and Gaussian", most * row_len)?;
    for tiles in ranges {
        if pixels > 0 {
            // SAFETY: as in the forward pass; rows of pairs are those of the tiles of this launch.
            unsafe {
                rasterize_backward_kernel::launch_unchecked(
                    client,
                    grid(tiles.len()),
                    CubeDim::new_1d(UNITS as u32),
                    saved.attributes.arg(),
                    saved.pixels.arg(),
                    lists.tile_offsets.arg(),
                    lists.gaussian_ids.arg(),
                    v_output.arg(),
                    pairs.arg(),
                    backgrounds.arg(),
                    plan.width,
                    plan.height,
                    plan.columns as u32,
                    tiles.start as u32,
                    tiles.len() as u32,
                    plan.tiles as u32,
                    pixels as u32,
                    plan.channels,
                    plan.depth,
                    plan.placed,
                    of_background,
                    plan.batch(STAGE) as u32,
                );
            }
        }
        sums.add(client, &plan, lists, &pairs, tiles);
    }
    finish(client, &plan, projected, opacities, &sums.sums, &backgrounds, of_background)
}
