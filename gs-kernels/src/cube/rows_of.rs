//! Rows of a table taken out, and put back, one unit per value; the twin of [`crate::cpu::rows`]. The rows are
//! distinct, so no two units write one number, and results are equal to the bit from run to run. Accesses are checked,
//! because numbers of rows are data.

use cubecl::prelude::*;

use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::error::CubeError;

/// `out[k, ..] = table[rows[k], ..]`.
#[cube(launch)]
fn take_rows_kernel(table: &[f32], rows: &[u32], out: &mut [f32], values: u32, columns: u32) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index < values {
        let row = rows[(index / columns) as usize];
        out[index as usize] = table[row as usize * columns as usize + (index % columns) as usize];
    }
}

/// `table[rows[k], ..] += more[k, ..]`.
#[cube(launch)]
fn add_rows_kernel(table: &mut [f32], rows: &[u32], more: &[f32], values: u32, columns: u32) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index < values {
        let row = rows[(index / columns) as usize];
        table[row as usize * columns as usize + (index % columns) as usize] += more[index as usize];
    }
}

/// `out[i] = 0`.
#[cube(launch_unchecked)]
fn zero_kernel(out: &mut [f32], values: u32) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < values as usize {
        out[index] = 0.0f32;
    }
}

/// `[M, columns]` from `table` `[N, columns]` and `rows` `[M]`.
///
/// # Errors
/// When the result exceeds one buffer.
pub fn take(client: &Client, table: &Buffer, columns: usize, rows: &Buffer) -> Result<Buffer, CubeError> {
    let values = rows.len() * columns;
    let out = Buffer::empty(client, "rows of a table", values)?;
    if values > 0 {
        let (grid, dim, columns) = (grid_for(values), cube_dim(), columns as u32);
        take_rows_kernel::launch(client, grid, dim, table.arg(), rows.arg(), out.arg(), values as u32, columns);
    }
    Ok(out)
}

/// Adds `more` `[M, columns]` to `rows` `[M]` of `table` `[N, columns]`, in place.
///
/// # Panics
/// When the buffers disagree in length.
pub fn add(client: &Client, table: &Buffer, columns: usize, rows: &Buffer, more: &Buffer) {
    let values = rows.len() * columns;
    assert_eq!(more.len(), values, "one row of numbers for each row");
    if values > 0 {
        let (grid, dim, columns) = (grid_for(values), cube_dim(), columns as u32);
        add_rows_kernel::launch(client, grid, dim, table.arg(), rows.arg(), more.arg(), values as u32, columns);
    }
}

/// `len` zeros.
///
/// # Errors
/// When they exceed one buffer.
pub fn zeros(client: &Client, what: &'static str, len: usize) -> Result<Buffer, CubeError> {
    let out = Buffer::empty(client, what, len)?;
    if len > 0 {
        // SAFETY: `out` holds `len` numbers.
        unsafe { zero_kernel::launch_unchecked(client, grid_for(len), cube_dim(), out.arg(), len as u32) };
    }
    Ok(out)
}
