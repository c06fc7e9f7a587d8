//! Exclusive prefix sums of any length.
//!
//! One cube scans 2048 values in shared memory and writes their sum. Up to 2048 sums are added up by each cube that
//! needs them; more are scanned in the same way, level by level, and added back. Sums saturate at `u32::MAX`, so that
//! an overflow is detected instead of wrapping round.

use cubecl::prelude::*;

use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid};
use crate::cube::error::CubeError;

/// Consecutive values that one unit adds.
const ITEMS: usize = 8;
/// Values a cube scans.
const BLOCK: usize = UNITS * ITEMS;
/// `log2(UNITS)`: doubling steps of the scan over a cube's units.
const STEPS: usize = UNITS.ilog2() as usize;

/// The sum, or `u32::MAX` where it does not fit.
#[cube]
pub(super) fn saturating_sum(a: u32, b: u32) -> u32 {
    let sum = a + b;
    select(sum < a, 0xffff_ffffu32, sum)
}

/// Where [`sums_over_units`] leaves its sums.
pub(super) const SUMS: usize = (STEPS % 2) * UNITS;

/// Sums of `own` over each unit of a cube and those before it, from [`SUMS`] on in `totals`, which holds `2 UNITS`
/// values: two halves, read from one and written to the other, so that one barrier a step is enough. All units must
/// call this.
#[cube]
pub(super) fn sums_over_units(own: u32, totals: &mut Shared<[u32]>) {
    let unit = UNIT_POS as usize;
    totals[unit] = own;
    sync_cube();
    #[unroll]
    for step in 0..STEPS {
        let reach = comptime!(1usize << step);
        let from = comptime!((step % 2) * UNITS);
        let to = comptime!(UNITS - (step % 2) * UNITS);
        let mut total = totals[from + unit];
        if unit >= reach {
            total = saturating_sum(total, totals[from + unit - reach]);
        }
        totals[to + unit] = total;
        sync_cube();
    }
}

/// Each cube scans its block of `input` (0 beyond `count`) into `output`, and writes the block's sum.
#[cube(launch_unchecked)]
fn scan_block_kernel(input: &[u32], output: &mut [u32], sums: &mut [u32], count: u32, out_count: u32, blocks: u32) {
    if CUBE_POS >= blocks as usize {
        terminate!();
    }
    let unit = UNIT_POS as usize;
    let first = CUBE_POS * BLOCK + unit * ITEMS;
    let mut values = Array::<u32>::new(ITEMS);
    let mut own = 0u32;
    #[unroll]
    for k in 0..ITEMS {
        let mut value = 0u32;
        if first + k < count as usize {
            value = input[first + k];
        }
        values[k] = value;
        own = saturating_sum(own, value);
    }

    let mut totals = Shared::<[u32]>::new_slice(comptime!(2 * UNITS));
    sums_over_units(own, &mut totals);
    let mut running = 0u32;
    if unit > 0 {
        running = totals[SUMS + unit - 1];
    }
    #[unroll]
    for k in 0..ITEMS {
        if first + k < out_count as usize {
            output[first + k] = running;
        }
        running = saturating_sum(running, values[k]);
    }
    if unit == comptime!(UNITS - 1) {
        sums[CUBE_POS] = running;
    }
}

/// Most blocks whose sums each cube adds by itself: eight a unit. It saves the launch that would scan them.
const ADDED_BY_CUBES: usize = UNITS * ITEMS;

/// Each cube adds to its block of `output` the sum of all blocks before it, from the blocks' own `sums`.
#[cube(launch_unchecked)]
fn scan_finish_kernel(output: &mut [u32], sums: &[u32], count: u32, blocks: u32) {
    if CUBE_POS >= blocks as usize {
        terminate!();
    }
    let unit = UNIT_POS as usize;
    let mut before = 0u32;
    #[unroll]
    for k in 0..ITEMS {
        let block = k * UNITS + unit;
        if block < CUBE_POS {
            before = saturating_sum(before, sums[block]);
        }
    }
    let mut totals = Shared::<[u32]>::new_slice(UNITS);
    totals[unit] = before;
    sync_cube();
    #[unroll]
    for step in 0..STEPS {
        let half = comptime!(UNITS >> (step + 1));
        if unit < half {
            let total = saturating_sum(totals[unit], totals[unit + half]);
            totals[unit] = total;
        }
        sync_cube();
    }
    let total = totals[0];
    #[unroll]
    for k in 0..ITEMS {
        let index = CUBE_POS * BLOCK + k * UNITS + unit;
        if index < count as usize {
            output[index] = saturating_sum(output[index], total);
        }
    }
}

/// Adds to every value of block `b` the sum of all blocks before it.
#[cube(launch_unchecked)]
fn scan_add_kernel(output: &mut [u32], sums: &[u32], count: u32) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < count as usize {
        output[index] = saturating_sum(output[index], sums[index / BLOCK]);
    }
}

/// Exclusive prefix sums of `input`: `out_len` of them, where the input counts as 0 beyond its end. With
/// `out_len = input.len() + 1` the last one is the total.
///
/// # Errors
/// When the result exceeds one buffer.
pub fn exclusive_scan(client: &Client, input: &Buffer, out_len: usize) -> Result<Buffer, CubeError> {
    let output = Buffer::empty(client, "prefix sums", out_len)?;
    if out_len == 0 {
        return Ok(output);
    }
    let blocks = out_len.div_ceil(BLOCK);
    let sums = Buffer::empty(client, "prefix sums of blocks", blocks)?;
    // SAFETY: `input` is read below its length, `output` written below `out_len`, `sums` below `blocks`.
    unsafe {
        scan_block_kernel::launch_unchecked(
            client,
            grid(blocks),
            cube_dim(),
            input.arg(),
            output.arg(),
            sums.arg(),
            input.len() as u32,
            out_len as u32,
            blocks as u32,
        );
    }
    if (2..=ADDED_BY_CUBES).contains(&blocks) {
        let (count, blocks_u32) = (out_len as u32, blocks as u32);
        // SAFETY: `output` is indexed below `count`, `sums` below `blocks`.
        unsafe {
            let (output, sums) = (output.arg(), sums.arg());
            scan_finish_kernel::launch_unchecked(client, grid(blocks), cube_dim(), output, sums, count, blocks_u32);
        }
    } else if blocks > 1 {
        let sums = exclusive_scan(client, &sums, blocks)?;
        let cubes = out_len.div_ceil(UNITS);
        // SAFETY: `output` is indexed below `out_len`; `sums` holds a value for each block of it.
        unsafe {
            scan_add_kernel::launch_unchecked(
                client,
                grid(cubes),
                cube_dim(),
                output.arg(),
                sums.arg(),
                out_len as u32,
            );
        }
    }
    Ok(output)
}
