//! Rows of coefficients between device memory and a unit, through shared memory.
//!
//! A unit that reads its own row touches another line of memory than its neighbours with every value, 48 times at
//! degree 3. Here neighbouring units read neighbouring values, and a line is touched once.

use cubecl::prelude::*;

use crate::cube::buffer::UNITS;

/// Rows in shared memory at a time: 12.25 KiB at degree 3, of the 16 KiB that WebGPU promises.
const BATCH: usize = 64;

/// Values from one row to the next in shared memory: odd, so that units at one column of their rows use different
/// banks.
const fn stride(columns: usize) -> usize {
    columns | 1
}

/// Length of the shared memory for rows of `columns` values.
pub(super) const fn shared_len(columns: usize) -> usize {
    BATCH * stride(columns)
}

/// Where value `index` of a batch of rows is in shared memory.
#[cube]
fn place(index: usize, #[comptime] columns: usize) -> usize {
    index / columns * comptime!(stride(columns)) + index % columns
}

/// Each unit of a cube reads the first `used` of the `columns` values of its row. A row from `count` on gets numbers of
/// no meaning: the shared memory is not written for it. The whole cube takes part.
#[cube]
pub(super) fn read_rows(
    table: &[f32],
    row: &mut Array<f32>,
    shared: &mut Shared<[f32]>,
    count: u32,
    #[comptime] columns: usize,
    #[comptime] used: usize,
) {
    let unit = UNIT_POS as usize;
    let values = count as usize * columns;
    for batch in 0..comptime!(UNITS / BATCH) {
        let begin = (CUBE_POS * UNITS + batch * BATCH) * columns;
        let mut index = unit;
        while index < comptime!(BATCH * columns) {
            if begin + index < values {
                shared[place(index, columns)] = table[begin + index];
            }
            index += UNITS;
        }
        sync_cube();
        if unit / BATCH == batch {
            let own = unit % BATCH * comptime!(stride(columns));
            #[unroll]
            for k in 0..used {
                row[k] = shared[own + k];
            }
        }
        sync_cube();
    }
}

/// Each unit of a cube writes its row: the first `used` values from `row`, zeros behind. The whole cube takes part.
#[cube]
pub(super) fn write_rows(
    table: &mut [f32],
    row: &Array<f32>,
    shared: &mut Shared<[f32]>,
    count: u32,
    #[comptime] columns: usize,
    #[comptime] used: usize,
) {
    let unit = UNIT_POS as usize;
    let values = count as usize * columns;
    for batch in 0..comptime!(UNITS / BATCH) {
        if unit / BATCH == batch {
            let own = unit % BATCH * comptime!(stride(columns));
            #[unroll]
            for k in 0..used {
                shared[own + k] = row[k];
            }
            #[unroll]
            for k in used..columns {
                shared[own + k] = 0.0f32;
            }
        }
        sync_cube();
        let begin = (CUBE_POS * UNITS + batch * BATCH) * columns;
        let mut index = unit;
        while index < comptime!(BATCH * columns) {
            if begin + index < values {
                table[begin + index] = shared[place(index, columns)];
            }
            index += UNITS;
        }
        sync_cube();
    }
}
