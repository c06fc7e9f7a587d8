//! Several instants of a scene in one image: the mean of the tiles drawn for them, forward and backward. The twin of
//! [`crate::cpu::exposure`]; the lists of the tiles are in [`crate::cube::intersect`].

use cubecl::prelude::*;

use crate::config::{AverageConfig, tile_grid};
use crate::constants::TILE;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::error::CubeError;
use crate::cube::light::{to_encoded, to_encoded_slope, to_linear, to_linear_slope};

/// Pixels of a tile.
const PIXELS: u32 = (TILE * TILE) as u32;
const EDGE: u32 = TILE as u32;

/// Mean over the instants of one value of a tile of the image, of light if encoded. `shares` holds the offsets of the
/// further tiles of each tile of the image, `[grid + 1]`, then the number of instants for which each drawn tile stands.
#[cube]
fn mean_of(
    tiles: &[f32],
    shares: &[u32],
    tile: u32,
    own: u32,
    grid: u32,
    instants: f32,
    light: bool,
    #[comptime] channels: u32,
) -> f32 {
    let stride = comptime!(PIXELS * channels);
    let mut sum = 0.0f32;
    let (first, last) = (shares[tile as usize], shares[tile as usize + 1]);
    // The image's own tile, then the further ones.
    for k in 0..last - first + 1u32 {
        let drawn = select(k == 0u32, tile, grid + first + k - 1u32);
        let mut value = tiles[(drawn * stride + own) as usize];
        if light {
            value = to_linear(value);
        }
        sum += f32::cast_from(shares[(grid + 1u32 + drawn) as usize]) * value;
    }
    sum / instants
}

/// One unit per value of the image.
#[cube(launch)]
fn average_forward_kernel(
    tiles: &[f32],
    shares: &[u32],
    image: &mut [f32],
    values: u32,
    width: u32,
    columns: u32,
    grid: u32,
    instants: f32,
    #[comptime] channels: u32,
    #[comptime] encoded: u32,
) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index >= values {
        terminate!();
    }
    let (channel, pixel) = (index % channels, index / channels);
    let (x, y) = (pixel % width, pixel / width);
    let tile = y / EDGE * columns + x / EDGE;
    let own = (y % EDGE * EDGE + x % EDGE) * channels + channel;
    let mut value = tiles[(tile * comptime!(PIXELS * channels) + own) as usize];
    if shares[tile as usize] < shares[tile as usize + 1] {
        let light = channel < encoded;
        value = mean_of(tiles, shares, tile, own, grid, instants, light, channels);
        if light {
            value = to_encoded(value);
        }
    }
    image[index as usize] = value;
}

/// One unit per value of the image's own tiles writes it and the same value of the further tiles; pixels outside the
/// image get zero.
#[cube(launch)]
fn average_backward_kernel(
    tiles: &[f32],
    shares: &[u32],
    v_image: &[f32],
    v_tiles: &mut [f32],
    values: u32,
    width: u32,
    height: u32,
    columns: u32,
    grid: u32,
    instants: f32,
    #[comptime] channels: u32,
    #[comptime] encoded: u32,
) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index >= values {
        terminate!();
    }
    let stride = comptime!(PIXELS * channels);
    let (tile, own) = (index / stride, index % stride);
    if tile >= grid {
        if tile >= grid + shares[grid as usize] {
            v_tiles[index as usize] = 0.0f32;
        }
        terminate!();
    }
    let channel = own % channels;
    let x = tile % columns * EDGE + own / channels % EDGE;
    let y = tile / columns * EDGE + own / channels / EDGE;
    let mut v = 0.0f32;
    if x < width && y < height {
        v = v_image[((y * width + x) * channels + channel) as usize];
    }
    let (first, last) = (shares[tile as usize], shares[tile as usize + 1]);
    let light = channel < encoded;
    if first == last {
        v_tiles[index as usize] = v;
    } else {
        v /= instants;
        if light {
            let mean = mean_of(tiles, shares, tile, own, grid, instants, light, channels);
            v *= to_encoded_slope(mean, to_encoded(mean));
        }
        for k in 0..last - first + 1u32 {
            let drawn = select(k == 0u32, tile, grid + first + k - 1u32);
            let at = (drawn * stride + own) as usize;
            let mut share = f32::cast_from(shares[(grid + 1u32 + drawn) as usize]) * v;
            if light {
                let value = tiles[at];
                share *= to_linear_slope(value, to_linear(value));
            }
            v_tiles[at] = share;
        }
    }
}

fn check(config: &AverageConfig, shares: &Buffer, tiles: &Buffer) -> usize {
    let (columns, rows) = tile_grid(config.width, config.height);
    let drawn = shares.len().checked_sub(columns * rows + 1).expect("shares must be those of an image of this size");
    let expected = drawn * PIXELS as usize * config.channels;
    assert_eq!(tiles.len(), expected, "tiles must be [tiles, 16, 16, C]");
    config.width as usize * config.height as usize * config.channels
}

/// The mean image `[H, W, C]` over all `instants`, from the drawn tiles, `[tiles, 16, 16, C]`, and their
/// [shares](crate::cube::intersect::FoundInstants::shares); the twin of [`crate::cpu::exposure::average`].
///
/// # Errors
/// When a buffer would be too large.
///
/// # Panics
/// When the lengths disagree.
pub fn average(
    client: &Client,
    config: &AverageConfig,
    shares: &Buffer,
    instants: usize,
    tiles: &Buffer,
) -> Result<Buffer, CubeError> {
    let values = check(config, shares, tiles);
    let image = Buffer::empty(client, "mean image", values)?;
    if values > 0 {
        let (columns, rows) = tile_grid(config.width, config.height);
        average_forward_kernel::launch(
            client,
            grid_for(values),
            cube_dim(),
            tiles.arg(),
            shares.arg(),
            image.arg(),
            values as u32,
            config.width,
            columns as u32,
            (columns * rows) as u32,
            instants as f32,
            config.channels as u32,
            config.encoded as u32,
        );
    }
    Ok(image)
}

/// Backward of [`average`] from `v_image` `[H, W, C]`: the gradient with respect to the tiles, zero in pixels outside
/// the image and in tiles that nothing shows.
///
/// # Errors
/// When a buffer would be too large.
///
/// # Panics
/// When the lengths disagree.
pub fn average_backward(
    client: &Client,
    config: &AverageConfig,
    shares: &Buffer,
    instants: usize,
    tiles: &Buffer,
    v_image: &Buffer,
) -> Result<Buffer, CubeError> {
    let values = check(config, shares, tiles);
    assert_eq!(v_image.len(), values, "v_image must be [H, W, C]");
    let v_tiles = Buffer::empty(client, "gradient by tiles", tiles.len())?;
    if !tiles.is_empty() {
        let (columns, rows) = tile_grid(config.width, config.height);
        average_backward_kernel::launch(
            client,
            grid_for(tiles.len()),
            cube_dim(),
            tiles.arg(),
            shares.arg(),
            v_image.arg(),
            v_tiles.arg(),
            tiles.len() as u32,
            config.width,
            config.height,
            columns as u32,
            (columns * rows) as u32,
            instants as f32,
            config.channels as u32,
            config.encoded as u32,
        );
    }
    Ok(v_tiles)
}
