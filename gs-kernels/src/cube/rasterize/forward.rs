//! Blending forward: colour, depth and alpha of every pixel. One cube per tile, one unit per pixel.

use cubecl::prelude::*;

use super::attributes::{PIXELS, Plan, Quad, channel, output_pixel, place_of, quads, stage};
use super::blocks::{self, reaches};
use crate::config::RasterizeConfig;
use crate::constants::TILE;
use crate::cube::blend::{ALPHA_MIN, TRANSMITTANCE_MIN, capped, place, raw_alpha};
use crate::cube::buffer::{Buffer, grid};
use crate::cube::error::CubeError;
use crate::cube::intersect::Intersections;
use crate::cube::math::finite;
use crate::cube::uniform::of_first_unit;

/// Shared memory for a batch, in floats (8 KiB).
const STAGE: usize = 2048;

/// Above this many channels the loops over them are not unrolled: the code would no longer fit an instruction cache.
pub(super) const UNROLLED: usize = 40;

/// One cube per tile. A pixel ends when a Gaussian would bring its transmittance under the floor; the tile ends when
/// all its pixels have. `saved` is [`Saved::pixels`].
#[cube(launch_unchecked)]
fn rasterize_forward_kernel(
    attributes: &[Quad],
    background: &[f32],
    tile_offsets: &[u32],
    gaussian_ids: &[u32],
    output: &mut [f32],
    saved: &mut [u32],
    width: u32,
    height: u32,
    tile_columns: u32,
    tiles: u32,
    pixels: u32,
    #[comptime] channels: usize,
    #[comptime] depth: bool,
    #[comptime] placed: bool,
    #[comptime] save: bool,
    #[comptime] batch: u32,
) {
    if CUBE_POS >= tiles as usize {
        terminate!();
    }
    let blended = comptime!(channels + depth as usize);
    let quads = comptime!(quads(channels + depth as usize));
    let unroll = comptime!(channels <= UNROLLED);
    // Words of 32 Gaussians in a block's mask.
    let words = comptime!(batch.div_ceil(32));
    let tile = CUBE_POS as u32;
    let image_tile = place_of(tile_offsets, tile, tiles, placed);
    let block = UNIT_POS / blocks::UNITS;
    let lane = UNIT_POS % blocks::UNITS;
    let own_x = block % blocks::ACROSS * blocks::WIDE + lane % blocks::WIDE;
    let own_y = block / blocks::ACROSS * blocks::HIGH + lane / blocks::WIDE;
    let left = image_tile % tile_columns * comptime!(TILE as u32);
    let top = image_tile / tile_columns * comptime!(TILE as u32);
    let (x, y) = (left + own_x, top + own_y);
    let pixel_x = f32::cast_from(x) + 0.5f32;
    let pixel_y = f32::cast_from(y) + 0.5f32;
    let inside = x < width && y < height;

    let mut staged = Shared::<[Quad]>::new_slice(comptime!(batch as usize * quads));
    let masks = Shared::<[Atomic<u32>]>::new_slice(comptime!((blocks::BLOCKS * words) as usize));
    let ended_pixels = Shared::<[Atomic<u32>]>::new_slice(1usize);
    let mut slot = Shared::<[u32]>::new_slice(1usize);
    let begin = tile_offsets[CUBE_POS];
    let end = tile_offsets[CUBE_POS + 1];
    if UNIT_POS == 0 {
        ended_pixels[0].store(0u32);
    }
    // The barrier inside is also that of the store.
    let batches = of_first_unit((end - begin).div_ceil(batch), &mut slot);
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
    let mut last = begin;
    for b in 0..batches {
        // The barrier inside also keeps the last batch until every unit has finished with it.
        if workgroup_uniform_load_atomic(&ended_pixels[0]) == comptime!(PIXELS as u32) {
            break;
        }
        let first = begin + b * batch;
        let rest = end - first;
        let count = select(rest < batch, rest, batch.runtime());
        if UNIT_POS < comptime!(blocks::BLOCKS * words) {
            masks[UNIT_POS as usize].store(0u32);
        }
        stage(attributes, gaussian_ids, first, count, &mut staged, quads, comptime!(PIXELS as u32));
        sync_cube();
        let mut test = UNIT_POS;
        while test < count * blocks::BLOCKS {
            let k = test / blocks::BLOCKS;
            let of = test % blocks::BLOCKS;
            let block_x = f32::cast_from(left + of % blocks::ACROSS * blocks::WIDE) + 0.5f32;
            let block_y = f32::cast_from(top + of / blocks::ACROSS * blocks::HIGH) + 0.5f32;
            if reaches(&staged, k as usize * quads, block_x, block_y) {
                masks[(of * words + k / 32u32) as usize].fetch_or(1u32 << (k % 32u32));
            }
            test += comptime!(PIXELS as u32);
        }
        sync_cube();
        if !ended {
            for word in 0..words {
                // No `break` behind the words: where there is one word CubeCL drops this loop, and the unit would leave
                // the loop around, whose barriers are for all.
                let mut bits = select(ended, 0u32, masks[(block * words + word) as usize].load());
                while bits != 0u32 {
                    let k = word * 32u32 + bits.trailing_zeros();
                    bits &= bits - 1u32;
                    let row = k as usize * quads;
                    let (one, two) = (staged[row], staged[row + 1]);
                    let dx = pixel_x - one.extract(0usize);
                    let dy = pixel_y - one.extract(1usize);
                    let at = place(dx, dy, one.extract(2usize), one.extract(3usize), two.extract(0usize));
                    if at.twice_sigma <= two.extract(2usize) {
                        let raw = raw_alpha(at.twice_sigma, two.extract(1usize));
                        if raw >= ALPHA_MIN {
                            let alpha = capped(raw);
                            let next = t * (1.0f32 - alpha);
                            if next < TRANSMITTANCE_MIN {
                                ended = true;
                                bits = 0u32;
                            } else {
                                let weight = alpha * t;
                                #[unroll(unroll)]
                                for c in 0..blended {
                                    sums[c] += weight * channel(&staged, row, c);
                                }
                                t = next;
                                last = first + k + 1u32;
                            }
                        }
                    }
                }
            }
            if ended {
                ended_pixels[0].fetch_add(1u32);
            }
        }
    }

    let own = own_y * comptime!(TILE as u32) + own_x;
    let number = output_pixel(x, y, width, tile, own, placed);
    let pixel = number * comptime!(blended + 1);
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
    if comptime!(save) {
        if comptime!(placed) || inside {
            saved[number] = u32::reinterpret(t);
            saved[pixels as usize + number] = last;
        }
        if CUBE_POS == 0 {
            let mut c = UNIT_POS as usize;
            while c < channels {
                let behind = background[c];
                saved[2 * pixels as usize + c] = u32::reinterpret(select(finite(behind), behind, 0.0f32));
                c += PIXELS;
            }
        }
    }
}

/// The buffers that are blended.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// `[N, 8]`
    pub projected: &'a Buffer,
    /// `[N]`
    pub opacities: &'a Buffer,
    /// `[N, C]`
    pub features: &'a Buffer,
    /// `[C]`
    pub background: &'a Buffer,
    /// Tiles and their Gaussians.
    pub lists: &'a Intersections,
}

/// The results of the forward pass that the backward one reads.
#[derive(Clone, Debug)]
pub struct Saved {
    /// The packed rows.
    pub attributes: Buffer,
    /// Bits of each pixel's final transmittance `[pixels]`, one past the place of its last Gaussian in the lists
    /// `[pixels]`, and bits of the background `[C]`, zero where it is not finite. Bits, because a shader may flush a
    /// small whole number read as a float to zero; one buffer, because the backward kernel has no binding left.
    pub pixels: Buffer,
}

/// An image, and the state for its backward pass if that was asked for.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// `[H, W, C + depth + 1]`, or for lists with `places` `[tiles, 16, 16, C + depth + 1]`.
    pub output: Buffer,
    /// State of the forward pass.
    pub saved: Option<Saved>,
}

/// Renders the inputs to `[H, W, C + depth + 1]`, or for
/// lists with `places` to `[tiles, 16, 16, C + depth + 1]`; the twin of [`crate::cpu::rasterize::forward`]. With `save`
/// it keeps what [`super::backward`] needs.
///
/// # Errors
/// When a buffer would be too large.
///
/// # Panics
/// When the buffers disagree in length.
pub fn forward(client: &Client, config: &RasterizeConfig, inputs: &Inputs, save: bool) -> Result<Rendered, CubeError> {
    let Inputs { projected, opacities, features, background, lists } = *inputs;
    let plan = Plan::new(config, projected, opacities, features, background, lists);
    let pixels = plan.pixels();
    let output = Buffer::empty(client, "rendered image", pixels * config.output_channels())?;
    let attributes = plan.pack(client, projected, opacities, features)?;
    let kept = if save { 2 * pixels + plan.channels } else { 0 };
    let state = Buffer::empty(client, "transmittances of the rendered image", kept)?;
    if pixels > 0 {
        // SAFETY: the lists hold numbers of Gaussians below N and places below their own length, as `intersect` made
        // them; the rows are `[N, stride]`; every other index is a pixel's inside the image or the tiles.
        unsafe {
            rasterize_forward_kernel::launch_unchecked(
                client,
                grid(plan.tiles),
                CubeDim::new_1d(PIXELS as u32),
                attributes.arg(),
                background.arg(),
                lists.tile_offsets.arg(),
                lists.gaussian_ids.arg(),
                output.arg(),
                state.arg(),
                plan.width,
                plan.height,
                plan.columns as u32,
                plan.tiles as u32,
                pixels as u32,
                plan.channels,
                plan.depth,
                plan.placed,
                save,
                plan.batch(STAGE) as u32,
            );
        }
    }
    Ok(Rendered { output, saved: save.then_some(Saved { attributes, pixels: state }) })
}
