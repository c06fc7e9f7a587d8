//! Sparse convolution on a grid; formulas as in [`crate::cpu::sparse_conv`].
//!
//! Kernels read through the table of neighbours and write each row once. A cube holds a tile of output rows and walks
//! the offsets that any of its rows has; products with missing neighbours are multiplied as zeros.

mod rows;
mod weights;

pub use rows::{backward_input, forward};
pub use weights::backward_weights;

use crate::cpu::sparse_conv::{Channels, Neighbours};
use crate::cube::buffer::Buffer;

/// Output rows of a tile.
const ROWS: usize = 64;

/// A table on the device and its shape.
#[derive(Debug, Clone)]
pub struct Table<'a> {
    /// From [`device_table`].
    pub values: &'a Buffer,
    /// Rows of the input.
    pub inputs: usize,
    /// Rows of the output.
    pub outputs: usize,
    /// Offsets of the kernel.
    pub offsets: usize,
    /// Whether offset `k` takes the weights of offset `K - 1 - k`.
    pub flip: bool,
}

impl Table<'_> {
    fn check(&self) {
        let Self { values, outputs, offsets, .. } = self;
        let masks = outputs.div_ceil(ROWS) * offsets.div_ceil(32);
        assert_eq!(values.len(), offsets * outputs + masks, "a table of {outputs} rows and {offsets} offsets");
    }
}

/// Neighbours as the kernels read them: `[K, outputs]` input rows or -1, then for each tile of rows one bit for each
/// offset that any of its rows has, in words of 32.
pub fn device_table(neighbours: &Neighbours) -> Vec<i32> {
    let Neighbours { outputs, offsets, table, .. } = neighbours;
    let words = offsets.div_ceil(32);
    let mut values = vec![-1; outputs * offsets];
    let mut masks = vec![0_u32; outputs.div_ceil(ROWS) * words];
    for (row, from) in table.chunks_exact(*offsets).enumerate() {
        for (k, &from) in from.iter().enumerate().filter(|(_, from)| **from >= 0) {
            values[k * outputs + row] = from;
            masks[row / ROWS * words + k / 32] |= 1 << (k % 32);
        }
    }
    values.extend(masks.into_iter().map(|mask| mask as i32));
    values
}

/// # Panics
/// When the buffers disagree with the table.
fn check(rows: &Buffer, count: usize, columns: usize, weights: usize, table: &Table, channels: Channels) {
    table.check();
    assert_eq!(rows.len(), count * columns, "rows must be [{count}, {columns}]");
    assert_eq!(weights, table.offsets * channels.input * channels.output, "weights must be [K, C_in, C_out]");
}
