//! Forward, and backward by the input: a cube computes 64 rows and 32 columns, a unit 4 rows and 2 columns.

// Kernels have no `div_ceil`.
#![allow(clippy::manual_div_ceil)]

use cubecl::prelude::*;

use super::{ROWS, Table, check};
use crate::cpu::sparse_conv::Channels;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid};
use crate::cube::error::CubeError;
use crate::cube::uniform::of_first_unit;

/// Output columns of a tile.
const COLUMNS: usize = 32;
/// Input columns staged at a time.
const DEPTH: usize = 16;
/// Units side by side over the columns; each has a second column so many further on.
const ACROSS: usize = COLUMNS / 2;
/// Rows of a unit.
const OWN: usize = ROWS / (UNITS / ACROSS);
/// A missing neighbour.
const NONE: u32 = u32::MAX;

/// Walks the offsets of a tile; `transposed` reads the matrix of an offset by columns.
#[cube(launch)]
fn rows_kernel(
    input: &[f32],
    weights: &[f32],
    table: &[u32],
    output: &mut [f32],
    outputs: u32,
    offsets: u32,
    inner: u32,
    wide: u32,
    column_tiles: u32,
    cubes: u32,
    #[comptime] flip: bool,
    #[comptime] transposed: bool,
) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let tile = CUBE_POS as u32 / column_tiles;
    let first_row = tile * comptime!(ROWS as u32);
    let first_column = CUBE_POS as u32 % column_tiles * comptime!(COLUMNS as u32);
    let words = (offsets + 31u32) / 32u32;
    let masks = offsets as usize * outputs as usize + (tile * words) as usize;
    let unit = UNIT_POS as usize;
    let across = unit % ACROSS;
    let down = unit / ACROSS * OWN;

    let mut slot = Shared::<[u32]>::new_slice(1usize);
    let mut sources = Shared::<[u32]>::new_slice(ROWS);
    let mut rows = Shared::<[f32]>::new_slice(comptime!(ROWS * DEPTH));
    let mut matrix = Shared::<[f32]>::new_slice(comptime!(DEPTH * COLUMNS));
    let mut left = Array::<f32>::new(OWN);
    let mut right = Array::<f32>::new(OWN);
    #[unroll]
    for r in 0..OWN {
        left[r] = 0.0f32;
        right[r] = 0.0f32;
    }

    for word in 0..words {
        // All units have the previous word.
        sync_cube();
        let mut bits = of_first_unit(table[masks + word as usize], &mut slot);
        while bits != 0u32 {
            let k = word * 32u32 + bits.trailing_zeros();
            bits &= bits - 1u32;
            if unit < ROWS {
                let row = first_row + UNIT_POS;
                let mut source = 0xffff_ffffu32;
                if row < outputs {
                    source = table[k as usize * outputs as usize + row as usize];
                }
                sources[unit] = source;
            }
            sync_cube();
            let mut weight = k;
            if comptime!(flip) {
                weight = offsets - 1u32 - k;
            }
            let base = weight as usize * inner as usize * wide as usize;
            let mut depth = 0u32;
            while depth < inner {
                #[unroll]
                for step in 0..comptime!(ROWS * DEPTH / UNITS) {
                    let at = unit + step * UNITS;
                    let column = depth + (at % DEPTH) as u32;
                    let source = sources[at / DEPTH];
                    let mut x = 0.0f32;
                    if source != NONE && column < inner {
                        x = input[source as usize * inner as usize + column as usize];
                    }
                    rows[at] = x;
                }
                #[unroll]
                for step in 0..comptime!(DEPTH * COLUMNS / UNITS) {
                    let at = unit + step * UNITS;
                    let c = depth + (at / COLUMNS) as u32;
                    let d = first_column + (at % COLUMNS) as u32;
                    let mut w = 0.0f32;
                    if c < inner && d < wide {
                        if comptime!(transposed) {
                            w = weights[base + d as usize * inner as usize + c as usize];
                        } else {
                            w = weights[base + c as usize * wide as usize + d as usize];
                        }
                    }
                    matrix[at] = w;
                }
                sync_cube();
                for c in 0..DEPTH {
                    let w = matrix[c * COLUMNS + across];
                    let z = matrix[c * COLUMNS + across + ACROSS];
                    #[unroll]
                    for r in 0..OWN {
                        let x = rows[(down + r) * DEPTH + c];
                        left[r] += x * w;
                        right[r] += x * z;
                    }
                }
                sync_cube();
                depth += comptime!(DEPTH as u32);
            }
        }
    }

    let column = first_column + across as u32;
    let second = column + comptime!(ACROSS as u32);
    #[unroll]
    for r in 0..OWN {
        let row = first_row as usize + down + r;
        if row < outputs as usize {
            if column < wide {
                output[row * wide as usize + column as usize] = left[r];
            }
            if second < wide {
                output[row * wide as usize + second as usize] = right[r];
            }
        }
    }
}

/// `[outputs, C_out]` from `input` `[inputs, C_in]` and `weights` `[K, C_in, C_out]`; the twin of
/// [`crate::cpu::sparse_conv::forward`].
///
/// # Errors
/// When the result exceeds one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn forward(
    client: &Client,
    input: &Buffer,
    weights: &Buffer,
    table: &Table,
    channels: Channels,
) -> Result<Buffer, CubeError> {
    check(input, table.inputs, channels.input, weights.len(), table, channels);
    launch(client, input, weights, table, [channels.input, channels.output], false)
}

/// `[outputs, C_in]`, the gradient with respect to the input, from `v_output` `[inputs, C_out]`; `table` is that of
/// the reverse direction, whose input is the convolution's output.
///
/// # Errors
/// When the result exceeds one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn backward_input(
    client: &Client,
    v_output: &Buffer,
    weights: &Buffer,
    table: &Table,
    channels: Channels,
) -> Result<Buffer, CubeError> {
    check(v_output, table.inputs, channels.output, weights.len(), table, channels);
    launch(client, v_output, weights, table, [channels.output, channels.input], true)
}

fn launch(
    client: &Client,
    input: &Buffer,
    weights: &Buffer,
    table: &Table,
    [inner, wide]: [usize; 2],
    transposed: bool,
) -> Result<Buffer, CubeError> {
    let output = Buffer::empty(client, "rows of a sparse convolution", table.outputs * wide)?;
    if output.is_empty() {
        return Ok(output);
    }
    let column_tiles = wide.div_ceil(COLUMNS);
    let cubes = table.outputs.div_ceil(ROWS) * column_tiles;
    rows_kernel::launch(
        client,
        grid(cubes),
        cube_dim(),
        input.arg(),
        weights.arg(),
        table.values.arg(),
        output.arg(),
        table.outputs as u32,
        table.offsets as u32,
        inner as u32,
        wide as u32,
        column_tiles as u32,
        cubes as u32,
        table.flip,
        transposed,
    );
    Ok(output)
}
