//! Fused L1 and SSIM (Wang et al. 2004) of two images, forward and backward; formulas as in [`crate::cpu::ssim`].
//!
//! One cube handles a tile of 16 x 16 pixels in one channel: it stages the tile with a margin of five pixels, filters
//! it along x into shared memory, then along y in registers; one unit per pixel.

use cubecl::prelude::*;

use crate::constants;
use crate::constants::{SSIM_SIGMA, SSIM_WINDOW, TILE};
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid};
use crate::cube::error::CubeError;
use crate::cube::math::finite;
use crate::cube::reduce::{column_sum, cube_sum};

/// Pixels of margin that the window needs.
const HALO: usize = SSIM_WINDOW / 2;
/// Edge of a staged tile.
const WIDE: usize = TILE + 2 * HALO;
/// Pixels of a staged tile.
const AREA: usize = WIDE * WIDE;
/// Pixels of a tile filtered along x: all rows of the staged tile.
const STRIP: usize = WIDE * TILE;
/// Maps filtered in the forward pass: x, y, x^2, y^2, x y.
const MOMENTS: usize = 5;
/// Maps filtered in the backward pass: the derivatives with respect to `mu_x`, `E_xx`, `E_xy`.
const DERIVATIVES: usize = 3;

const C1: f32 = constants::SSIM_C1 as f32;
const C2: f32 = constants::SSIM_C2 as f32;
const SHIFT: f32 = constants::SSIM_SHIFT as f32;
const PIXEL_MAX: f32 = constants::PIXEL_MAX as f32;

/// Tap `i` of the window.
fn tap(i: usize) -> f32 {
    let weight = |i: usize| {
        let d = i as f64 - HALO as f64;
        (-d * d / (2.0 * SSIM_SIGMA * SSIM_SIGMA)).exp()
    };
    (weight(i) / (0..SSIM_WINDOW).map(weight).sum::<f64>()) as f32
}

/// A pixel as the loss reads it: values that are not finite or beyond the limit count as 0.
#[cube]
fn clean(x: f32) -> f32 {
    select(finite(x) && x.abs() <= PIXEL_MAX, x, 0.0f32)
}

/// The tile and channel of a cube.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
struct TileChannel {
    channel: u32,
    /// First pixel of the tile.
    x: u32,
    y: u32,
}

#[cube]
fn own_tile(tile_columns: u32, channels: u32) -> TileChannel {
    let cube = CUBE_POS as u32;
    let tile = cube / channels;
    TileChannel {
        channel: cube % channels,
        x: tile % tile_columns * comptime!(TILE as u32),
        y: tile / tile_columns * comptime!(TILE as u32),
    }
}

/// Value `k` of the staged tile of a map; 0 outside the image.
#[cube]
fn read_staged(map: &[f32], k: u32, tile: TileChannel, width: u32, height: u32, channels: u32) -> f32 {
    // Offset by the margin, so that unsigned numbers do not go below zero.
    let x = tile.x + k % comptime!(WIDE as u32);
    let y = tile.y + k / comptime!(WIDE as u32);
    let halo = comptime!(HALO as u32);
    let mut value = 0.0f32;
    if x >= halo && y >= halo && x < width + halo && y < height + halo {
        let pixel = (y - halo) as usize * width as usize + (x - halo) as usize;
        value = map[pixel * channels as usize + tile.channel as usize];
    }
    value
}

/// Forward: per pixel three derivatives, per cube the sums of L1 and SSIM.
#[cube(launch)]
fn ssim_forward_kernel(
    image: &[f32],
    target: &[f32],
    by_mean: &mut [f32],
    by_square: &mut [f32],
    by_product: &mut [f32],
    sums: &mut [f32],
    width: u32,
    height: u32,
    channels: u32,
    tile_columns: u32,
    cubes: u32,
) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let tile = own_tile(tile_columns, channels);
    let mut x = Shared::<[f32]>::new_slice(AREA);
    let mut y = Shared::<[f32]>::new_slice(AREA);
    let mut filtered = Shared::<[f32]>::new_slice(comptime!(STRIP * MOMENTS));

    let mut k = UNIT_POS;
    while k < comptime!(AREA as u32) {
        x[k as usize] = clean(read_staged(image, k, tile, width, height, channels)) - SHIFT;
        y[k as usize] = clean(read_staged(target, k, tile, width, height, channels)) - SHIFT;
        k += comptime!(UNITS as u32);
    }
    sync_cube();

    let mut k = UNIT_POS as usize;
    while k < STRIP {
        let from = k / TILE * WIDE + k % TILE;
        let mut mx = 0.0f32;
        let mut my = 0.0f32;
        let mut xx = 0.0f32;
        let mut yy = 0.0f32;
        let mut xy = 0.0f32;
        #[unroll]
        for i in 0..SSIM_WINDOW {
            let w = comptime!(tap(i));
            let a = x[from + i];
            let b = y[from + i];
            mx += w * a;
            my += w * b;
            xx += w * a * a;
            yy += w * b * b;
            xy += w * a * b;
        }
        filtered[k] = mx;
        filtered[STRIP + k] = my;
        filtered[2 * STRIP + k] = xx;
        filtered[3 * STRIP + k] = yy;
        filtered[4 * STRIP + k] = xy;
        k += UNITS;
    }
    sync_cube();

    let column = UNIT_POS as usize % TILE;
    let row = UNIT_POS as usize / TILE;
    let mut mx = 0.0f32;
    let mut my = 0.0f32;
    let mut xx = 0.0f32;
    let mut yy = 0.0f32;
    let mut xy = 0.0f32;
    #[unroll]
    for i in 0..SSIM_WINDOW {
        let w = comptime!(tap(i));
        let from = (row + i) * TILE + column;
        mx += w * filtered[from];
        my += w * filtered[STRIP + from];
        xx += w * filtered[2 * STRIP + from];
        yy += w * filtered[3 * STRIP + from];
        xy += w * filtered[4 * STRIP + from];
    }
    // The means enter A1 and B1 unshifted, and A2 and B2 shifted.
    let mean_x = mx + SHIFT;
    let mean_y = my + SHIFT;
    let a1 = 2.0f32 * mean_x * mean_y + C1;
    let a2 = 2.0f32 * (xy - mx * my) + C2;
    let b1 = mean_x * mean_x + mean_y * mean_y + C1;
    let b2 = (xx - mx * mx) + (yy - my * my) + C2;
    let inverse1 = 1.0f32 / b1;
    let inverse2 = 1.0f32 / b2;
    let both = inverse1 * inverse2;
    let similarity = a1 * a2 * both;

    let pixel_x = tile.x + column as u32;
    let pixel_y = tile.y + row as u32;
    let inside = pixel_x < width && pixel_y < height;
    let centre = (row + HALO) * WIDE + column + HALO;
    if inside {
        let at = (pixel_y as usize * width as usize + pixel_x as usize) * channels as usize + tile.channel as usize;
        let numerator = (mean_y * a2 - my * a1) * both;
        let denominator = similarity * (mean_x * inverse1 - mx * inverse2);
        by_mean[at] = 2.0f32 * (numerator - denominator);
        by_square[at] = -similarity * inverse2;
        by_product[at] = 2.0f32 * a1 * both;
    }
    let l1 = select(inside, (x[centre] - y[centre]).abs(), 0.0f32);
    let similarity = select(inside, similarity, 0.0f32);
    // All units have read the filtered maps; the sum below contains the barrier.
    sync_cube();
    let l1 = cube_sum(l1, &mut filtered);
    let similarity = cube_sum(similarity, &mut filtered);
    if UNIT_POS == 0 {
        sums[CUBE_POS * 2] = l1;
        sums[CUBE_POS * 2 + 1] = similarity;
    }
}

/// One cube: from the cubes' sums to the two means `[mean L1, mean SSIM]`.
#[cube(launch)]
fn ssim_mean_kernel(sums: &[f32], means: &mut [f32], cubes: u32, scale: f32) {
    let mut slots = Shared::<[f32]>::new_slice(UNITS);
    let l1 = column_sum(sums, cubes, 0u32, 2usize, &mut slots);
    let similarity = column_sum(sums, cubes, 1u32, 2usize, &mut slots);
    if UNIT_POS == 0 {
        means[0] = l1 * scale;
        means[1] = similarity * scale;
    }
}

/// Result of [`forward`].
#[derive(Clone, Debug)]
pub struct SsimForward {
    /// `[2]`: mean absolute difference, mean structural similarity.
    pub means: Buffer,
    /// Derivatives of each pixel's SSIM with respect to `mu_x`, `E_xx` and `E_xy`, each `[H, W, C]`. Three buffers,
    /// because one of all would be the largest of a training: 285 MiB for a photo of 3840 x 2160, where WebGPU binds
    /// 128.
    pub saved: [Buffer; DERIVATIVES],
}

/// Compares `image` with `target`, both `[H, W, C]`; the twin of [`crate::cpu::ssim::forward`]. Values that are not
/// finite or beyond [`constants::PIXEL_MAX`] count as 0.
///
/// # Errors
/// When a saved map exceeds one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn forward(
    client: &Client,
    image: &Buffer,
    target: &Buffer,
    width: usize,
    height: usize,
    channels: usize,
) -> Result<SsimForward, CubeError> {
    let len = check(image, target, width, height, channels);
    if len == 0 {
        let means = Buffer::upload(client, "means of L1 and SSIM", &[0.0f32, 1.0])?;
        return Ok(SsimForward { means, saved: maps(client, 0)? });
    }
    let (columns, cubes) = cubes(width, height, channels);
    let saved = maps(client, len)?;
    let [by_mean, by_square, by_product] = &saved;
    let sums = Buffer::empty(client, "sums of L1 and SSIM", 2 * cubes)?;
    let means = Buffer::empty(client, "means of L1 and SSIM", 2)?;
    ssim_forward_kernel::launch(
        client,
        grid(cubes),
        cube_dim(),
        image.arg(),
        target.arg(),
        by_mean.arg(),
        by_square.arg(),
        by_product.arg(),
        sums.arg(),
        width as u32,
        height as u32,
        channels as u32,
        columns as u32,
        cubes as u32,
    );
    let scale = (1.0 / len as f64) as f32;
    ssim_mean_kernel::launch(client, grid(1), cube_dim(), sums.arg(), means.arg(), cubes as u32, scale);
    Ok(SsimForward { means, saved })
}

/// Backward: filters the three saved maps; one unit per pixel writes its gradient.
#[cube(launch)]
fn ssim_backward_kernel(
    image: &[f32],
    target: &[f32],
    by_mean: &[f32],
    by_square: &[f32],
    by_product: &[f32],
    v_means: &[f32],
    v_image: &mut [f32],
    width: u32,
    height: u32,
    channels: u32,
    tile_columns: u32,
    cubes: u32,
    scale: f32,
) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let tile = own_tile(tile_columns, channels);
    let mut maps = Shared::<[f32]>::new_slice(comptime!(AREA * DERIVATIVES));
    let mut filtered = Shared::<[f32]>::new_slice(comptime!(STRIP * DERIVATIVES));

    let mut k = UNIT_POS;
    while k < comptime!(AREA as u32) {
        let at = k as usize;
        maps[at] = read_staged(by_mean, k, tile, width, height, channels);
        maps[AREA + at] = read_staged(by_square, k, tile, width, height, channels);
        maps[2 * AREA + at] = read_staged(by_product, k, tile, width, height, channels);
        k += comptime!(UNITS as u32);
    }
    sync_cube();

    let mut k = UNIT_POS as usize;
    while k < STRIP {
        let from = k / TILE * WIDE + k % TILE;
        #[unroll]
        for map in 0..DERIVATIVES {
            let mut sum = 0.0f32;
            #[unroll]
            for i in 0..SSIM_WINDOW {
                sum += comptime!(tap(i)) * maps[map * AREA + from + i];
            }
            filtered[map * STRIP + k] = sum;
        }
        k += UNITS;
    }
    sync_cube();

    let column = UNIT_POS as usize % TILE;
    let row = UNIT_POS as usize / TILE;
    let mut mu = 0.0f32;
    let mut xx = 0.0f32;
    let mut xy = 0.0f32;
    #[unroll]
    for i in 0..SSIM_WINDOW {
        let w = comptime!(tap(i));
        let from = (row + i) * TILE + column;
        mu += w * filtered[from];
        xx += w * filtered[STRIP + from];
        xy += w * filtered[2 * STRIP + from];
    }
    let pixel_x = tile.x + column as u32;
    let pixel_y = tile.y + row as u32;
    if pixel_x < width && pixel_y < height {
        let at = (pixel_y as usize * width as usize + pixel_x as usize) * channels as usize + tile.channel as usize;
        let raw = image[at];
        let x = clean(raw);
        let y = clean(target[at]);
        let v_l1 = select(finite(v_means[0]), v_means[0] * scale, 0.0f32);
        let v_ssim = select(finite(v_means[1]), v_means[1] * scale, 0.0f32);
        let similarity = mu + 2.0f32 * (x - SHIFT) * xx + (y - SHIFT) * xy;
        let sign = select(x > y, v_l1, select(x < y, -v_l1, 0.0f32));
        let usable = finite(raw) && raw.abs() <= PIXEL_MAX;
        v_image[at] = select(usable, v_ssim * similarity + sign, 0.0f32);
    }
}

/// Gradient with respect to `image` `[H, W, C]` from `v_means` `[2]`, the gradient with respect to the means of
/// [`forward`], whose `saved` maps it needs; the twin of [`crate::cpu::ssim::backward`].
///
/// # Errors
/// When the gradient exceeds one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn backward(
    client: &Client,
    image: &Buffer,
    target: &Buffer,
    saved: &[Buffer; DERIVATIVES],
    width: usize,
    height: usize,
    channels: usize,
    v_means: &Buffer,
) -> Result<Buffer, CubeError> {
    let len = check(image, target, width, height, channels);
    assert!(saved.iter().all(|map| map.len() == len), "each saved map must be [{height}, {width}, {channels}]");
    assert_eq!(v_means.len(), 2, "v_means must hold the gradients by L1 and SSIM");
    let v_image = Buffer::empty(client, "gradient of the image", len)?;
    if len > 0 {
        let (columns, cubes) = cubes(width, height, channels);
        let [by_mean, by_square, by_product] = saved;
        ssim_backward_kernel::launch(
            client,
            grid(cubes),
            cube_dim(),
            image.arg(),
            target.arg(),
            by_mean.arg(),
            by_square.arg(),
            by_product.arg(),
            v_means.arg(),
            v_image.arg(),
            width as u32,
            height as u32,
            channels as u32,
            columns as u32,
            cubes as u32,
            (1.0 / len as f64) as f32,
        );
    }
    Ok(v_image)
}

/// Room for the saved maps of `len` values.
fn maps(client: &Client, len: usize) -> Result<[Buffer; DERIVATIVES], CubeError> {
    let map = || Buffer::empty(client, "derivatives of SSIM", len);
    Ok([map()?, map()?, map()?])
}

/// Tile columns, and cubes for all tiles and channels.
fn cubes(width: usize, height: usize, channels: usize) -> (usize, usize) {
    let columns = width.div_ceil(TILE);
    (columns, columns * height.div_ceil(TILE) * channels)
}

fn check(image: &Buffer, target: &Buffer, width: usize, height: usize, channels: usize) -> usize {
    let len = width * height * channels;
    let agree = image.len() == len && target.len() == len;
    assert!(agree, "image and target must be [{height}, {width}, {channels}]");
    len
}

/// One unit: `out[0] = (1 - dssim) terms[0] + dssim (1 - terms[1])`.
#[cube(launch)]
fn loss_kernel(terms: &[f32], out: &mut [f32], dssim: f32) {
    if CUBE_POS == 0 && UNIT_POS == 0 {
        out[0] = (1.0f32 - dssim) * terms[0] + dssim * (1.0f32 - terms[1]);
    }
}

/// One unit: the gradient by the two terms.
#[cube(launch)]
fn loss_backward_kernel(v: &[f32], out: &mut [f32], dssim: f32) {
    if CUBE_POS == 0 && UNIT_POS == 0 {
        out[0] = (1.0f32 - dssim) * v[0];
        out[1] = -dssim * v[0];
    }
}

/// The loss `[1]` of the two `terms`, mean L1 and mean SSIM.
///
/// # Errors
/// Never: the result is one number.
pub fn loss(client: &Client, terms: &Buffer, dssim: f32) -> Result<Buffer, CubeError> {
    let out = Buffer::empty(client, "photometric loss", 1)?;
    loss_kernel::launch(client, grid(1), CubeDim::new_1d(1), terms.arg(), out.arg(), dssim);
    Ok(out)
}

/// The gradient `[2]` by the terms from `v` `[1]` by the [`loss`].
///
/// # Errors
/// Never: the result is two numbers.
pub fn loss_backward(client: &Client, v: &Buffer, dssim: f32) -> Result<Buffer, CubeError> {
    let out = Buffer::empty(client, "gradient of the photometric loss's terms", 2)?;
    loss_backward_kernel::launch(client, grid(1), CubeDim::new_1d(1), v.arg(), out.arg(), dssim);
    Ok(out)
}
