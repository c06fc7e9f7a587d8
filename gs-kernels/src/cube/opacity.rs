//! From logits to opacities and back; the twin of [`crate::cpu::opacity`]. One unit per Gaussian.

use cubecl::prelude::*;

use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::error::CubeError;

/// Whether `value` is a number or infinite. Read off the bits, because a shader compiler may assume that NaN never
/// occurs.
#[cube]
pub(crate) fn is_number(value: f32) -> bool {
    (u32::reinterpret(value) & 0x7fff_ffffu32) <= 0x7f80_0000u32
}

/// `1 / (1 + exp(-x))`.
#[cube]
pub(crate) fn sigmoid(x: f32) -> f32 {
    // The exponential of a positive number may be infinite, and WGSL leaves open what one over infinity is.
    let e = (-x.abs()).exp();
    let near = 1.0f32 / (1.0f32 + e);
    select(x < 0.0f32, e * near, near)
}

/// The opacity of a logit.
#[cube]
pub(crate) fn opacity_of(logit: f32) -> f32 {
    select(is_number(logit), sigmoid(logit), 0.0f32)
}

/// The derivative of [`opacity_of`].
#[cube]
pub(crate) fn slope_of(logit: f32) -> f32 {
    let e = (-logit.abs()).exp();
    let near = 1.0f32 / (1.0f32 + e);
    select(is_number(logit), e * near * near, 0.0f32)
}

#[cube(launch_unchecked)]
fn opacity_forward_kernel(logits: &[f32], opacities: &mut [f32], count: u32) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < count as usize {
        opacities[index] = opacity_of(logits[index]);
    }
}

#[cube(launch_unchecked)]
fn opacity_backward_kernel(logits: &[f32], v: &[f32], v_logits: &mut [f32], count: u32) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < count as usize {
        let logit = logits[index];
        v_logits[index] = select(is_number(logit), v[index] * slope_of(logit), 0.0f32);
    }
}

/// Opacities `[N]` of `logits` `[N]`.
///
/// # Errors
/// When the result exceeds one buffer.
pub fn forward(client: &Client, logits: &Buffer) -> Result<Buffer, CubeError> {
    let count = logits.len();
    let opacities = Buffer::empty(client, "opacities", count)?;
    if count > 0 {
        // SAFETY: both buffers hold `count` numbers.
        unsafe {
            opacity_forward_kernel::launch_unchecked(
                client,
                grid_for(count),
                cube_dim(),
                logits.arg(),
                opacities.arg(),
                count as u32,
            );
        }
    }
    Ok(opacities)
}

/// The gradient by `logits` `[N]` from `v` `[N]` by the opacities.
///
/// # Errors
/// When the result exceeds one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn backward(client: &Client, logits: &Buffer, v: &Buffer) -> Result<Buffer, CubeError> {
    let count = logits.len();
    assert_eq!(v.len(), count, "a gradient for each logit");
    let v_logits = Buffer::empty(client, "gradient of the logits", count)?;
    if count > 0 {
        // SAFETY: all buffers hold `count` numbers.
        unsafe {
            opacity_backward_kernel::launch_unchecked(
                client,
                grid_for(count),
                cube_dim(),
                logits.arg(),
                v.arg(),
                v_logits.arg(),
                count as u32,
            );
        }
    }
    Ok(v_logits)
}
