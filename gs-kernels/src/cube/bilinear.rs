//! An image between its pixels; the twin of [`crate::cpu::bilinear`].
//!
//! Forward and by the positions: one unit per lookup. By the image: the lookups are sorted by the first pixel of their
//! patch, and one unit per value of the image adds the lookups of the four patches that the pixel is part of. The sort
//! is stable, so the order of additions, and every bit of the result, is the same in each run. Burn's `select` leaves
//! its gradient to one thread a column.

use cubecl::prelude::*;

use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::error::CubeError;
use crate::cube::math::finite;
use crate::cube::sort::{first_of_keys, sort_pairs};

/// Where one position lies along one axis; see the CPU twin.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
struct Axis {
    first: u32,
    next: u32,
    fraction: f32,
    inside: bool,
}

#[cube]
fn axis(position: f32, pixels: u32) -> Axis {
    let last = pixels - 1u32;
    let last_centre = f32::cast_from(last);
    let from_first = position - 0.5f32;
    let below = from_first < 0.0f32;
    let above = from_first > last_centre;
    let held = select(below, 0.0f32, select(above, last_centre, from_first));
    // NaN looks at pixel 0; the fraction carries it. An infinite position has been brought to the border.
    let number = finite(held);
    let most = select(last > 0u32, last - 1u32, 0u32);
    let floor = u32::cast_from(select(number, held, 0.0f32));
    let first = select(floor < most, floor, most);
    Axis {
        first,
        next: select(first < last, first + 1u32, last),
        fraction: held - f32::cast_from(first),
        inside: !(below || above),
    }
}

/// One unit per lookup and channel.
#[cube(launch_unchecked)]
fn bilinear_forward_kernel(
    image: &[f32],
    positions: &[f32],
    out: &mut [f32],
    values: u32,
    height: u32,
    width: u32,
    channels: u32,
) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index >= values {
        terminate!();
    }
    let lookup = (index / channels) as usize;
    let c = index % channels;
    let x = axis(positions[2 * lookup], width);
    let y = axis(positions[2 * lookup + 1], height);
    let (left, above) = (1.0f32 - x.fraction, 1.0f32 - y.fraction);
    let (top, bottom) = (y.first * width, y.next * width);
    out[index as usize] = image[((top + x.first) * channels + c) as usize] * (left * above)
        + image[((top + x.next) * channels + c) as usize] * (x.fraction * above)
        + image[((bottom + x.first) * channels + c) as usize] * (left * y.fraction)
        + image[((bottom + x.next) * channels + c) as usize] * (x.fraction * y.fraction);
}

/// One unit per lookup: the gradient by its position.
#[cube(launch_unchecked)]
fn bilinear_by_positions_kernel(
    image: &[f32],
    positions: &[f32],
    v: &[f32],
    out: &mut [f32],
    lookups: u32,
    height: u32,
    width: u32,
    channels: u32,
) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index >= lookups {
        terminate!();
    }
    let lookup = index as usize;
    let x = axis(positions[2 * lookup], width);
    let y = axis(positions[2 * lookup + 1], height);
    let (top, bottom) = (y.first * width, y.next * width);
    let mut by_x = 0.0f32;
    let mut by_y = 0.0f32;
    for channel in 0..channels {
        let a = image[((top + x.first) * channels + channel) as usize];
        let b = image[((top + x.next) * channels + channel) as usize];
        let c = image[((bottom + x.first) * channels + channel) as usize];
        let d = image[((bottom + x.next) * channels + channel) as usize];
        let pull = v[lookup * channels as usize + channel as usize];
        by_x += pull * ((b - a) * (1.0f32 - y.fraction) + (d - c) * y.fraction);
        by_y += pull * ((c - a) * (1.0f32 - x.fraction) + (d - b) * x.fraction);
    }
    out[2 * lookup] = select(x.inside, by_x, 0.0f32);
    out[2 * lookup + 1] = select(y.inside, by_y, 0.0f32);
}

/// One unit per lookup: the first pixel of its patch, and its number.
#[cube(launch_unchecked)]
fn patch_kernel(positions: &[f32], patches: &mut [u32], numbers: &mut [u32], lookups: u32, height: u32, width: u32) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index >= lookups {
        terminate!();
    }
    let lookup = index as usize;
    let x = axis(positions[2 * lookup], width);
    let y = axis(positions[2 * lookup + 1], height);
    patches[lookup] = y.first * width + x.first;
    numbers[lookup] = index;
}

/// The part of `v` that the lookups of the patch whose first pixel is (`x`, `y`) hand to its corner (`right`, `below`).
#[cube]
fn from_patch(
    positions: &[f32],
    v: &[f32],
    starts: &[u32],
    ordered: &[u32],
    x: u32,
    y: u32,
    height: u32,
    width: u32,
    channel: u32,
    channels: u32,
    #[comptime] right: bool,
    #[comptime] below: bool,
) -> f32 {
    let patch = (y * width + x) as usize;
    let mut sum = 0.0f32;
    for k in starts[patch]..starts[patch + 1] {
        let lookup = ordered[k as usize] as usize;
        let x = axis(positions[2 * lookup], width).fraction;
        let y = axis(positions[2 * lookup + 1], height).fraction;
        let mut along_x = 1.0f32 - x;
        let mut along_y = 1.0f32 - y;
        if comptime!(right) {
            along_x = x;
        }
        if comptime!(below) {
            along_y = y;
        }
        sum += along_x * along_y * v[lookup * channels as usize + channel as usize];
    }
    sum
}

/// One unit per value of the image: adds what the lookups of its four patches hand to it.
#[cube(launch_unchecked)]
fn bilinear_by_image_kernel(
    positions: &[f32],
    v: &[f32],
    starts: &[u32],
    ordered: &[u32],
    out: &mut [f32],
    values: u32,
    height: u32,
    width: u32,
    channels: u32,
) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index >= values {
        terminate!();
    }
    let channel = index % channels;
    let x = index / channels % width;
    let y = index / channels / width;
    let mut sum = from_patch(positions, v, starts, ordered, x, y, height, width, channel, channels, false, false);
    if x > 0u32 {
        sum += from_patch(positions, v, starts, ordered, x - 1u32, y, height, width, channel, channels, true, false);
    }
    if y > 0u32 {
        sum += from_patch(positions, v, starts, ordered, x, y - 1u32, height, width, channel, channels, false, true);
    }
    if x > 0u32 && y > 0u32 {
        let (x, y) = (x - 1u32, y - 1u32);
        sum += from_patch(positions, v, starts, ordered, x, y, height, width, channel, channels, true, true);
    }
    out[index as usize] = sum;
}

/// The checked sizes of a lookup.
struct Sizes {
    lookups: usize,
    values: usize,
    height: u32,
    width: u32,
    channels: u32,
}

fn sizes([height, width]: [usize; 2], channels: usize, positions: &Buffer) -> Sizes {
    assert!(height > 0 && width > 0, "an image to sample must have pixels, it has {width} x {height}");
    let lookups = positions.len() / 2;
    let (height, width, channels) = (height as u32, width as u32, channels as u32);
    Sizes { lookups, values: lookups * channels as usize, height, width, channels }
}

/// Values of `image` `[H, W, C]` at `positions` `[P, 2]`, `[P, C]`; see the CPU twin.
///
/// # Errors
/// When the result exceeds one buffer.
///
/// # Panics
/// When the buffers disagree in length or the image has no pixel.
pub fn forward(
    client: &Client,
    image: &Buffer,
    size: [usize; 2],
    channels: usize,
    positions: &Buffer,
) -> Result<Buffer, CubeError> {
    let Sizes { values, height, width, channels, .. } = sizes(size, channels, positions);
    assert_eq!(image.len(), size[0] * size[1] * channels as usize, "the image must be [H, W, C]");
    let out = Buffer::empty(client, "values between pixels", values)?;
    if values > 0 {
        let (dim, at) = (cube_dim(), positions.arg());
        let (image, result, count) = (image.arg(), out.arg(), values as u32);
        // SAFETY: pixels are held inside the image, whatever the positions are; values below `values`.
        unsafe {
            let grid = grid_for(values);
            bilinear_forward_kernel::launch_unchecked(
                client, grid, dim, image, at, result, count, height, width, channels,
            );
        }
    }
    Ok(out)
}

/// The gradient by the positions, `[P, 2]`, from `v` `[P, C]`.
///
/// # Errors
/// When the result exceeds one buffer.
///
/// # Panics
/// As [`forward`].
pub fn by_positions(
    client: &Client,
    image: &Buffer,
    size: [usize; 2],
    channels: usize,
    positions: &Buffer,
    v: &Buffer,
) -> Result<Buffer, CubeError> {
    let Sizes { lookups, values, height, width, channels } = sizes(size, channels, positions);
    assert_eq!(image.len(), size[0] * size[1] * channels as usize, "the image must be [H, W, C]");
    assert_eq!(v.len(), values, "a value for each lookup and channel");
    let out = Buffer::empty(client, "gradient of positions in an image", 2 * lookups)?;
    if lookups > 0 {
        let (dim, image, at, count) = (cube_dim(), image.arg(), positions.arg(), lookups as u32);
        let (v, result, grid) = (v.arg(), out.arg(), grid_for(lookups));
        // SAFETY: as in the forward pass.
        unsafe {
            bilinear_by_positions_kernel::launch_unchecked(
                client, grid, dim, image, at, v, result, count, height, width, channels,
            );
        }
    }
    Ok(out)
}

/// The gradient by the image, `[H, W, C]`, from `v` `[P, C]`. A pixel's unit adds its lookups one after the other: the
/// time grows with the most lookups of one pixel.
///
/// # Errors
/// When the result or the sorted lookups exceed one buffer.
///
/// # Panics
/// As [`forward`].
pub fn by_image(
    client: &Client,
    size: [usize; 2],
    channels: usize,
    positions: &Buffer,
    v: &Buffer,
) -> Result<Buffer, CubeError> {
    let Sizes { lookups, values, height, width, channels } = sizes(size, channels, positions);
    assert_eq!(v.len(), values, "a value for each lookup and channel");
    let pixels = size[0] * size[1];
    let patches = Buffer::empty(client, "patches of lookups", lookups)?;
    let numbers = Buffer::empty(client, "numbers of lookups", lookups)?;
    if lookups > 0 {
        let (grid, dim, at, count) = (grid_for(lookups), cube_dim(), positions.arg(), lookups as u32);
        let (patches, numbers) = (patches.arg(), numbers.arg());
        // SAFETY: lookups below `lookups`.
        unsafe { patch_kernel::launch_unchecked(client, grid, dim, at, patches, numbers, count, height, width) };
    }
    let bits = u32::BITS - (pixels as u32).leading_zeros();
    let (patches, ordered) = sort_pairs(client, patches, numbers, bits)?;
    let starts = first_of_keys(client, &patches, pixels)?;
    let out = Buffer::empty(client, "gradient of an image by lookups", pixels * channels as usize)?;
    if !out.is_empty() {
        let (grid, dim, at, v) = (grid_for(out.len()), cube_dim(), positions.arg(), v.arg());
        let (starts, ordered, result, count) = (starts.arg(), ordered.arg(), out.arg(), out.len() as u32);
        // SAFETY: `starts` has an offset for each pixel and an end; `ordered` is a permutation of the lookups.
        unsafe {
            bilinear_by_image_kernel::launch_unchecked(
                client, grid, dim, at, v, starts, ordered, result, count, height, width, channels,
            );
        }
    }
    Ok(out)
}
