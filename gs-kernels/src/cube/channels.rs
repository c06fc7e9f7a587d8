//! A range of an image's channels, forward and backward: one unit per value of the result.

use cubecl::prelude::*;

use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::error::CubeError;

/// `part[pixel, c] = image[pixel, first + c]`.
#[cube(launch)]
fn channels_forward_kernel(image: &[f32], part: &mut [f32], values: u32, total: u32, first: u32, count: u32) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index < values {
        part[index as usize] = image[(index / count * total + first + index % count) as usize];
    }
}

/// `image[pixel, first + c] = part[pixel, c]`, zero in the other channels.
#[cube(launch)]
fn channels_backward_kernel(part: &[f32], image: &mut [f32], values: u32, total: u32, first: u32, count: u32) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index < values {
        let channel = index % total;
        let mut value = 0.0f32;
        if channel >= first && channel < first + count {
            value = part[(index / total * count + channel - first) as usize];
        }
        image[index as usize] = value;
    }
}

/// Channels `first..first + count` of `image` `[pixels, total]`.
///
/// # Errors
/// When the result exceeds one buffer.
///
/// # Panics
/// When the image has fewer channels.
pub fn forward(client: &Client, image: &Buffer, total: usize, first: usize, count: usize) -> Result<Buffer, CubeError> {
    assert!(first + count <= total, "channels {first}..{} of {total}", first + count);
    let values = image.len() / total.max(1) * count;
    let part = Buffer::empty(client, "channels of an image", values)?;
    if values > 0 {
        channels_forward_kernel::launch(
            client,
            grid_for(values),
            cube_dim(),
            image.arg(),
            part.arg(),
            values as u32,
            total as u32,
            first as u32,
            count as u32,
        );
    }
    Ok(part)
}

/// `part` `[pixels, count]` among zeros, `[pixels, total]`; the backward of [`forward`].
///
/// # Errors
/// When the result exceeds one buffer.
///
/// # Panics
/// When the image has fewer channels.
pub fn backward(client: &Client, part: &Buffer, total: usize, first: usize, count: usize) -> Result<Buffer, CubeError> {
    assert!(first + count <= total, "channels {first}..{} of {total}", first + count);
    let values = part.len() / count.max(1) * total;
    let image = Buffer::empty(client, "image of one part's channels", values)?;
    if values > 0 {
        channels_backward_kernel::launch(
            client,
            grid_for(values),
            cube_dim(),
            part.arg(),
            image.arg(),
            values as u32,
            total as u32,
            first as u32,
            count as u32,
        );
    }
    Ok(image)
}
