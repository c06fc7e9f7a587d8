//! Backward by the weights: a cube sums a part of the rows for one offset and 32 by 32 weights, a unit 2 by 2 of
//! them; then the parts are added in order.

// Kernels have no `div_ceil`.
#![allow(clippy::manual_div_ceil)]

use cubecl::prelude::*;

use super::{Table, check};
use crate::cpu::sparse_conv::Channels;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid, grid_for};
use crate::cube::error::CubeError;

/// Edge of a tile of weights.
const EDGE: usize = 32;
/// Rows staged at a time.
const DEPTH: usize = 16;
/// Half the edge: the distance of a unit's two rows and columns.
const HALF: usize = EDGE / 2;
/// A missing neighbour.
const NONE: u32 = u32::MAX;
/// Rows of a part, so that a large cloud fills a GPU.
const PART: usize = 8192;
/// Most parts: each has weights of its own.
const MOST_PARTS: usize = 16;

/// Sums of one part, `[parts, K, C_in, C_out]`.
#[cube(launch)]
fn parts_kernel(
    input: &[f32],
    v_output: &[f32],
    table: &[u32],
    parts: &mut [f32],
    outputs: u32,
    offsets: u32,
    wide_in: u32,
    wide_out: u32,
    part_rows: u32,
    cubes: u32,
    #[comptime] flip: bool,
) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let edge = comptime!(EDGE as u32);
    let across_tiles = (wide_out + edge - 1u32) / edge;
    let down_tiles = (wide_in + edge - 1u32) / edge;
    let cube = CUBE_POS as u32;
    let first_d = cube % across_tiles * edge;
    let first_c = cube / across_tiles % down_tiles * edge;
    let k = cube / across_tiles / down_tiles % offsets;
    let part = cube / across_tiles / down_tiles / offsets;
    let unit = UNIT_POS as usize;
    let across = unit % HALF;
    let down = unit / HALF;

    let mut rows = Shared::<[f32]>::new_slice(comptime!(DEPTH * EDGE));
    let mut v_rows = Shared::<[f32]>::new_slice(comptime!(DEPTH * EDGE));
    let mut a = 0.0f32;
    let mut b = 0.0f32;
    let mut c = 0.0f32;
    let mut d = 0.0f32;
    let mut row = part * part_rows;
    let end = min(row + part_rows, outputs);
    while row < end {
        #[unroll]
        for step in 0..comptime!(DEPTH * EDGE / UNITS) {
            let at = unit + step * UNITS;
            let own = row + (at / EDGE) as u32;
            let column = (at % EDGE) as u32;
            let mut x = 0.0f32;
            let mut v = 0.0f32;
            if own < end {
                let source = table[k as usize * outputs as usize + own as usize];
                if source != NONE {
                    if first_c + column < wide_in {
                        x = input[source as usize * wide_in as usize + (first_c + column) as usize];
                    }
                    if first_d + column < wide_out {
                        v = v_output[own as usize * wide_out as usize + (first_d + column) as usize];
                    }
                }
            }
            rows[at] = x;
            v_rows[at] = v;
        }
        sync_cube();
        for r in 0..DEPTH {
            let x = rows[r * EDGE + down];
            let y = rows[r * EDGE + down + HALF];
            let v = v_rows[r * EDGE + across];
            let w = v_rows[r * EDGE + across + HALF];
            a += x * v;
            b += x * w;
            c += y * v;
            d += y * w;
        }
        sync_cube();
        row += comptime!(DEPTH as u32);
    }

    let mut weight = k;
    if comptime!(flip) {
        weight = offsets - 1u32 - k;
    }
    let base = (part * offsets + weight) as usize * wide_in as usize * wide_out as usize;
    let upper = first_c as usize + down;
    let lower = upper + HALF;
    let left = first_d as usize + across;
    let right = left + HALF;
    let stride = wide_out as usize;
    if upper < wide_in as usize {
        if left < stride {
            parts[base + upper * stride + left] = a;
        }
        if right < stride {
            parts[base + upper * stride + right] = b;
        }
    }
    if lower < wide_in as usize {
        if left < stride {
            parts[base + lower * stride + left] = c;
        }
        if right < stride {
            parts[base + lower * stride + right] = d;
        }
    }
}

/// One unit a weight: the parts added in order.
#[cube(launch)]
fn sum_kernel(parts: &[f32], sums: &mut [f32], values: u32, count: u32) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index < values {
        let mut sum = 0.0f32;
        for part in 0..count {
            sum += parts[part as usize * values as usize + index as usize];
        }
        sums[index as usize] = sum;
    }
}

/// `[K, C_in, C_out]` from `input` `[inputs, C_in]` and `v_output` `[outputs, C_out]`; the twin of
/// [`crate::cpu::sparse_conv::backward_weights`].
///
/// # Errors
/// When the parts exceed one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn backward_weights(
    client: &Client,
    input: &Buffer,
    v_output: &Buffer,
    table: &Table,
    channels: Channels,
) -> Result<Buffer, CubeError> {
    let Channels { input: wide_in, output: wide_out } = channels;
    let values = table.offsets * wide_in * wide_out;
    check(input, table.inputs, wide_in, values, table, channels);
    assert_eq!(v_output.len(), table.outputs * wide_out, "v_output must be [{}, {wide_out}]", table.outputs);
    // A function of the number of rows alone, so that sums have one order.
    let count = table.outputs.div_ceil(PART).clamp(1, MOST_PARTS);
    let part_rows = table.outputs.div_ceil(count);
    let parts = Buffer::empty(client, "gradients of a convolution's weights", count * values)?;
    if values == 0 {
        return Ok(parts);
    }
    let cubes = count * table.offsets * wide_in.div_ceil(EDGE) * wide_out.div_ceil(EDGE);
    parts_kernel::launch(
        client,
        grid(cubes),
        cube_dim(),
        input.arg(),
        v_output.arg(),
        table.values.arg(),
        parts.arg(),
        table.outputs as u32,
        table.offsets as u32,
        wide_in as u32,
        wide_out as u32,
        part_rows as u32,
        cubes as u32,
        table.flip,
    );
    if count == 1 {
        return Ok(parts);
    }
    let sums = Buffer::empty(client, "gradient of a convolution's weights", values)?;
    sum_kernel::launch(client, grid_for(values), cube_dim(), parts.arg(), sums.arg(), values as u32, count as u32);
    Ok(sums)
}
