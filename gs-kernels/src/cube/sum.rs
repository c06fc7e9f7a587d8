//! The sum of many numbers in a fixed order, and the search for a number that is not finite; the twin of [`crate::cpu::sum`].
//!
//! A sum takes two launches: at most [`PARTS`] cubes add parts of equal length, then one cube adds the parts. The order depends on
//! the length alone.

use cubecl::prelude::*;

use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid};
use crate::cube::error::CubeError;
use crate::cube::math::finite;
use crate::cube::reduce::cube_sum;

/// Most cubes of the first launch, and so the work of the second: four numbers a unit.
const PARTS: usize = 1024;

/// Fewest numbers a unit adds: with less, launching the cube would cost more than its work.
const ITEMS: usize = 4;

/// Each cube adds `rows` rows of [`UNITS`] numbers, from row `rows * CUBE_POS` on. Neighbouring units read neighbouring numbers.
#[cube(launch_unchecked)]
fn sum_kernel(values: &[f32], parts: &mut [f32], count: u32, rows: u32, cubes: u32) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let mut slots = Shared::<[f32]>::new_slice(UNITS);
    let mut index = CUBE_POS * rows as usize * UNITS + UNIT_POS as usize;
    let mut sum = 0.0f32;
    for _ in 0..rows {
        if index < count as usize {
            sum += values[index];
        }
        index += UNITS;
    }
    let total = cube_sum(sum, &mut slots);
    if UNIT_POS == 0 {
        parts[CUBE_POS] = total;
    }
}

fn level(client: &Client, values: &Buffer, most: usize) -> Result<Buffer, CubeError> {
    let rows = values.len().div_ceil(UNITS).div_ceil(most).max(ITEMS);
    let cubes = values.len().div_ceil(rows * UNITS).max(1);
    let parts = Buffer::empty(client, "parts of a sum", cubes)?;
    let (count, rows, all) = (values.len() as u32, rows as u32, cubes as u32);
    // SAFETY: `values` is read below `count`, `parts` is written below `cubes`.
    unsafe {
        sum_kernel::launch_unchecked(client, grid(cubes), cube_dim(), values.arg(), parts.arg(), count, rows, all);
    }
    Ok(parts)
}

/// The sum of `values`, `[1]`; 0 without values.
///
/// # Errors
/// When the parts exceed one buffer.
pub fn sum(client: &Client, values: &Buffer) -> Result<Buffer, CubeError> {
    let parts = level(client, values, PARTS)?;
    if parts.len() == 1 { Ok(parts) } else { level(client, &parts, 1) }
}

/// Numbers that a unit of [`mark_kernel`] looks at.
const LOOKED_AT: usize = 8;

/// Sets the bits of NaN in `flag[0]` if a number is not finite.
#[cube(launch_unchecked)]
fn mark_kernel(values: &[f32], flag: &[Atomic<u32>], count: u32, cubes: u32) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let mut index = CUBE_POS * comptime!(UNITS * LOOKED_AT) + UNIT_POS as usize;
    let mut broken = false;
    #[unroll]
    for _ in 0..LOOKED_AT {
        if index < count as usize {
            broken = broken || !finite(values[index]);
        }
        index += UNITS;
    }
    if broken {
        flag[0].fetch_or(0x7fc0_0000u32);
    }
}

/// Makes `flag` `[1]`, which holds 0 or NaN, NaN if a number of `values` is not finite. The order of the units does not matter.
pub fn mark_not_finite(client: &Client, values: &Buffer, flag: &Buffer) {
    if values.is_empty() {
        return;
    }
    let cubes = values.len().div_ceil(UNITS * LOOKED_AT);
    let (count, all) = (values.len() as u32, cubes as u32);
    // SAFETY: `values` is read below `count`; `flag` holds one number.
    unsafe {
        mark_kernel::launch_unchecked(client, grid(cubes), cube_dim(), values.arg(), flag.arg(), count, all);
    }
}
