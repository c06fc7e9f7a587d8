//! Sums of rows by segment, and the rows of segments; one unit for each value of the result. The twin of
//! [`crate::cpu::segments`].

// A choice at compile time and one of the running kernel cannot be one condition.
#![allow(clippy::collapsible_if)]

use cubecl::prelude::*;

use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::error::CubeError;

/// `output[s, c] = sum over the rows of s of input[row, c]`, over their count with `mean`.
#[cube(launch)]
fn reduce_kernel(
    input: &[f32],
    starts: &[u32],
    rows: &[u32],
    output: &mut [f32],
    values: u32,
    channels: u32,
    #[comptime] mean: bool,
) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index < values {
        let segment = (index / channels) as usize;
        let channel = (index % channels) as usize;
        let first = starts[segment];
        let end = starts[segment + 1];
        let mut sum = 0.0f32;
        for place in first..end {
            sum += input[rows[place as usize] as usize * channels as usize + channel];
        }
        if comptime!(mean) {
            if end > first {
                sum *= 1.0f32 / f32::cast_from(end - first);
            }
        }
        output[index as usize] = sum;
    }
}

/// `output[row, c] = input[segment of row, c]`, over the segment's count with `mean`.
#[cube(launch)]
fn take_kernel(
    input: &[f32],
    of_row: &[u32],
    starts: &[u32],
    output: &mut [f32],
    values: u32,
    channels: u32,
    #[comptime] mean: bool,
) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index < values {
        let segment = of_row[(index / channels) as usize] as usize;
        let mut value = input[segment * channels as usize + (index % channels) as usize];
        if comptime!(mean) {
            value *= 1.0f32 / f32::cast_from(starts[segment + 1] - starts[segment]);
        }
        output[index as usize] = value;
    }
}

/// The lists of [`crate::cpu::segments::SegmentLists`] on the device.
#[derive(Debug, Clone)]
pub struct DeviceLists {
    /// `[N]`
    pub of_row: Buffer,
    /// `[V + 1]`
    pub starts: Buffer,
    /// `[N]`
    pub rows: Buffer,
}

/// `[V, C]` from `input` `[N, C]`; the twin of [`crate::cpu::segments::reduce`].
///
/// # Errors
/// When the result exceeds one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn reduce(
    client: &Client,
    input: &Buffer,
    channels: usize,
    lists: &DeviceLists,
    mean: bool,
) -> Result<Buffer, CubeError> {
    assert_eq!(input.len(), lists.of_row.len() * channels, "input must be [{}, {channels}]", lists.of_row.len());
    let values = (lists.starts.len() - 1) * channels;
    let output = Buffer::empty(client, "rows of segments", values)?;
    if values > 0 {
        reduce_kernel::launch(
            client,
            grid_for(values),
            cube_dim(),
            input.arg(),
            lists.starts.arg(),
            lists.rows.arg(),
            output.arg(),
            values as u32,
            channels as u32,
            mean,
        );
    }
    Ok(output)
}

/// `[N, C]` from `input` `[V, C]`; the twin of [`crate::cpu::segments::take`].
///
/// # Errors
/// When the result exceeds one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn take(
    client: &Client,
    input: &Buffer,
    channels: usize,
    lists: &DeviceLists,
    mean: bool,
) -> Result<Buffer, CubeError> {
    let segments = lists.starts.len() - 1;
    assert_eq!(input.len(), segments * channels, "input must be [{segments}, {channels}]");
    let values = lists.of_row.len() * channels;
    let output = Buffer::empty(client, "rows of points", values)?;
    if values > 0 {
        take_kernel::launch(
            client,
            grid_for(values),
            cube_dim(),
            input.arg(),
            lists.of_row.arg(),
            lists.starts.arg(),
            output.arg(),
            values as u32,
            channels as u32,
            mean,
        );
    }
    Ok(output)
}
