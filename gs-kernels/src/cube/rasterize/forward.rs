//! Blending forward: colour, depth and alpha of every pixel. One cube per tile, one unit per pixel.

use cubecl::prelude::*;

use super::attributes::{GEOMETRY, PIXELS, Plan, output_pixel, place_of, stage};
use crate::config::RasterizeConfig;
use crate::constants::TILE;
use crate::cube::blend::{ALPHA_MIN, TRANSMITTANCE_MIN, capped, sight};
use crate::cube::buffer::{Buffer, grid};
use crate::cube::error::CubeError;
use crate::cube::intersect::Intersections;
use crate::cube::math::finite;

/// Shared memory for a batch, in floats (8 KiB).
const STAGE: usize = 2048;

/// Above this many channels the loops over them are not unrolled: the code would no longer fit an instruction cache.
pub(super) const UNROLLED: usize = 40;

/// One cube per tile. A pixel ends when a Gaussian would bring its transmittance under the floor; the tile ends when all its pixels
/// have.
#[cube(launch)]
fn rasterize_forward_kernel(
    attributes: &[f32],
    background: &[f32],
    tile_offsets: &[u32],
    gaussian_ids: &[u32],
    output: &mut [f32],
    width: u32,
    height: u32,
    tile_columns: u32,
    tiles: u32,
    #[comptime] channels: usize,
    #[comptime] depth: bool,
    #[comptime] placed: bool,
    #[comptime] batch: u32,
) {
    if CUBE_POS >= tiles as usize {
        terminate!();
    }
    let blended = comptime!(channels + depth as usize);
    let stride = comptime!(GEOMETRY + channels + depth as usize);
    let unroll = comptime!(channels <= UNROLLED);
    let tile = CUBE_POS as u32;
    let image_tile = place_of(tile_offsets, tile, tiles, placed);
    let x = image_tile % tile_columns * comptime!(TILE as u32) + UNIT_POS % comptime!(TILE as u32);
    let y = image_tile / tile_columns * comptime!(TILE as u32) + UNIT_POS / comptime!(TILE as u32);
    let pixel_x = f32::cast_from(x) + 0.5f32;
    let pixel_y = f32::cast_from(y) + 0.5f32;
    let inside = x < width && y < height;

    let mut staged = Shared::<[f32]>::new_slice(comptime!(batch as usize * stride));
    let ended_pixels = Shared::<[Atomic<u32>]>::new_slice(1usize);
    if UNIT_POS == 0 {
        ended_pixels[0].store(0u32);
    }
    sync_cube();
    if !inside {
        ended_pixels[0].fetch_add(1u32);
    }

    let mut sums = Array::<f32>::new(blended);
    #[unroll(unroll)]
    for c in 0..blended {
        sums[c] = 0.0f32;
    }
    let mut t = 1.0f32;
    let mut ended = !inside;
    let begin = tile_offsets[CUBE_POS];
    let end = tile_offsets[CUBE_POS + 1];
    let batches = (end - begin).div_ceil(batch);
    for b in 0..batches {
        // The barrier inside also keeps the last batch until every unit has finished with it.
        if workgroup_uniform_load_atomic(&ended_pixels[0]) == comptime!(PIXELS as u32) {
            break;
        }
        let first = begin + b * batch;
        let rest = end - first;
        let count = select(rest < batch, rest, batch.runtime());
        stage(attributes, gaussian_ids, first, count, &mut staged, stride, stride, comptime!(PIXELS as u32));
        sync_cube();
        if !ended {
            for k in 0..count {
                let row = k as usize * stride;
                let dx = pixel_x - staged[row];
                let dy = pixel_y - staged[row + 1];
                let seen = sight(dx, dy, staged[row + 2], staged[row + 3], staged[row + 4], staged[row + 5]);
                if seen.raw >= ALPHA_MIN {
                    let alpha = capped(seen.raw);
                    let next = t * (1.0f32 - alpha);
                    if next < TRANSMITTANCE_MIN {
                        ended = true;
                        break;
                    }
                    let weight = alpha * t;
                    #[unroll(unroll)]
                    for c in 0..blended {
                        sums[c] += weight * staged[row + GEOMETRY + c];
                    }
                    t = next;
                }
            }
            if ended {
                ended_pixels[0].fetch_add(1u32);
            }
        }
    }

    let pixel = output_pixel(x, y, width, tile, UNIT_POS, placed) * comptime!(blended + 1);
    if comptime!(placed) && !inside {
        for value in 0..comptime!(blended + 1) {
            output[pixel + value] = 0.0f32;
        }
    }
    if inside {
        #[unroll(unroll)]
        for c in 0..channels {
            let behind = background[c];
            output[pixel + c] = sums[c] + t * select(finite(behind), behind, 0.0f32);
        }
        if comptime!(depth) {
            output[pixel + channels] = sums[channels];
        }
        output[pixel + blended] = 1.0f32 - t;
    }
}

/// Renders: `projected` `[N, 8]`, `opacities` `[N]`, `features` `[N, C]`, `background` `[C]` to `[H, W, C + depth + 1]`, or for
/// lists with `places` to `[tiles, 16, 16, C + depth + 1]`; the twin of [`crate::cpu::rasterize::forward`].
///
/// # Errors
/// When a buffer would be too large.
///
/// # Panics
/// When the buffers disagree in length.
pub fn forward(
    client: &Client,
    config: &RasterizeConfig,
    projected: &Buffer,
    opacities: &Buffer,
    features: &Buffer,
    background: &Buffer,
    lists: &Intersections,
) -> Result<Buffer, CubeError> {
    let plan = Plan::new(config, projected, opacities, features, background, lists);
    let pixels = plan.pixels();
    let output = Buffer::empty(client, "rendered image", pixels * config.output_channels())?;
    if pixels == 0 {
        return Ok(output);
    }
    let attributes = plan.pack(client, projected, opacities, features)?;
    rasterize_forward_kernel::launch(
        client,
        grid(plan.tiles),
        CubeDim::new_1d(PIXELS as u32),
        attributes.arg(),
        background.arg(),
        lists.tile_offsets.arg(),
        lists.gaussian_ids.arg(),
        output.arg(),
        plan.width,
        plan.height,
        plan.columns as u32,
        plan.tiles as u32,
        plan.channels,
        plan.depth,
        plan.placed,
        plan.batch(STAGE) as u32,
    );
    Ok(output)
}
