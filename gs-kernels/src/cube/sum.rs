//! The sum of many numbers in a fixed order, and the search for a number that is not finite; the twin of
//! [`crate::cpu::sum`].
//!
//! A sum takes two launches: at most 1,024 cubes add parts of equal length, then one cube adds the parts. The order
//! depends on the length alone.

use cubecl::prelude::*;

use crate::config::Activation;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid, grid_for};
use crate::cube::error::CubeError;
use crate::cube::math::finite;
use crate::cube::opacity::{opacity_of, slope_of};
use crate::cube::reduce::cube_sum;

/// Most cubes of the first launch, and so the work of the second: four numbers a unit.
const PARTS: usize = 1024;

/// Fewest numbers a unit adds: with less, launching the cube would cost more than its work.
const ITEMS: usize = 4;

/// Each cube adds `rows` rows of [`UNITS`] numbers, from row `rows * CUBE_POS` on, each through the activation, and
/// multiplies the sum by `factor`. Neighbouring units read neighbouring numbers.
#[cube(launch_unchecked)]
fn sum_kernel(
    values: &[f32],
    parts: &mut [f32],
    count: u32,
    rows: u32,
    cubes: u32,
    factor: f32,
    #[comptime] activation: Option<Activation>,
) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let mut slots = Shared::<[f32]>::new_slice(UNITS);
    let mut index = CUBE_POS * rows as usize * UNITS + UNIT_POS as usize;
    let mut sum = 0.0f32;
    for _ in 0..rows {
        if index < count as usize {
            let value = values[index];
            if comptime!(activation == Some(Activation::Exp)) {
                sum += value.exp();
            }
            if comptime!(activation == Some(Activation::Sigmoid)) {
                sum += opacity_of(value);
            }
            if comptime!(activation.is_none()) {
                sum += value;
            }
        }
        index += UNITS;
    }
    let total = cube_sum(sum, &mut slots);
    if UNIT_POS == 0 {
        parts[CUBE_POS] = total * factor;
    }
}

fn level(
    client: &Client,
    values: &Buffer,
    most: usize,
    factor: f32,
    activation: Option<Activation>,
) -> Result<Buffer, CubeError> {
    let rows = values.len().div_ceil(UNITS).div_ceil(most).max(ITEMS);
    let cubes = values.len().div_ceil(rows * UNITS).max(1);
    let parts = Buffer::empty(client, "parts of a sum", cubes)?;
    let (count, rows, all) = (values.len() as u32, rows as u32, cubes as u32);
    let (grid, dim) = (grid(cubes), cube_dim());
    // SAFETY: `values` is read below `count`, `parts` is written below `cubes`.
    unsafe {
        let (values, parts) = (values.arg(), parts.arg());
        sum_kernel::launch_unchecked(client, grid, dim, values, parts, count, rows, all, factor, activation);
    }
    Ok(parts)
}

fn levels(client: &Client, values: &Buffer, factor: f32, activation: Option<Activation>) -> Result<Buffer, CubeError> {
    if values.len() <= UNITS * ITEMS {
        return level(client, values, 1, factor, activation);
    }
    let parts = level(client, values, PARTS, 1.0, activation)?;
    level(client, &parts, 1, factor, None)
}

/// The sum of `values`, `[1]`; 0 without values.
///
/// # Errors
/// When the parts exceed one buffer.
pub fn sum(client: &Client, values: &Buffer) -> Result<Buffer, CubeError> {
    levels(client, values, 1.0, None)
}

/// `factor` times the sum of the activations of `values`, `[1]`.
///
/// # Errors
/// When the parts exceed one buffer.
pub fn activated(client: &Client, values: &Buffer, activation: Activation, factor: f32) -> Result<Buffer, CubeError> {
    levels(client, values, factor, Some(activation))
}

/// One unit per value: `factor v f'(value)`.
#[cube(launch_unchecked)]
fn activated_backward_kernel(
    values: &[f32],
    v: &[f32],
    out: &mut [f32],
    count: u32,
    factor: f32,
    #[comptime] activation: Activation,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < count as usize {
        let scale = v[0] * factor;
        if comptime!(activation == Activation::Exp) {
            out[index] = scale * values[index].exp();
        }
        if comptime!(activation == Activation::Sigmoid) {
            out[index] = scale * slope_of(values[index]);
        }
    }
}

/// The gradient by `values` of [`activated`] from `v` `[1]`.
///
/// # Errors
/// When the result exceeds one buffer.
pub fn activated_backward(
    client: &Client,
    values: &Buffer,
    v: &Buffer,
    activation: Activation,
    factor: f32,
) -> Result<Buffer, CubeError> {
    let count = values.len();
    let out = Buffer::empty(client, "gradient of a sum", count)?;
    if count > 0 {
        let (grid, dim, len) = (grid_for(count), cube_dim(), count as u32);
        // SAFETY: `values` and `out` hold `count` numbers, `v` one.
        unsafe {
            let (values, v, out) = (values.arg(), v.arg(), out.arg());
            activated_backward_kernel::launch_unchecked(client, grid, dim, values, v, out, len, factor, activation);
        }
    }
    Ok(out)
}

/// Below every number.
const LOWEST: f32 = f32::MIN;

/// Each cube finds the largest of `rows` rows of [`UNITS`] numbers. A number that is none is never the largest.
#[cube(launch_unchecked)]
fn largest_kernel(values: &[f32], parts: &mut [f32], count: u32, rows: u32, cubes: u32) {
    if CUBE_POS >= cubes as usize {
        terminate!();
    }
    let unit = UNIT_POS as usize;
    let mut slots = Shared::<[f32]>::new_slice(UNITS);
    let mut index = CUBE_POS * rows as usize * UNITS + unit;
    let mut largest = LOWEST.runtime();
    for _ in 0..rows {
        if index < count as usize {
            let value = values[index];
            largest = select(value > largest, value, largest);
        }
        index += UNITS;
    }
    slots[unit] = largest;
    sync_cube();
    #[unroll]
    for step in 0..comptime!(UNITS.ilog2() as usize) {
        let half = comptime!(UNITS >> (step + 1));
        if unit < half {
            let (one, other) = (slots[unit], slots[unit + half]);
            slots[unit] = select(other > one, other, one);
        }
        sync_cube();
    }
    if unit == 0 {
        parts[CUBE_POS] = slots[0];
    }
}

/// The largest of `values`, `[1]`; the smallest finite number without values.
///
/// # Errors
/// When the parts exceed one buffer.
pub fn largest(client: &Client, values: &Buffer) -> Result<Buffer, CubeError> {
    let mut from = values.clone();
    loop {
        let most = if from.len() <= UNITS * ITEMS { 1 } else { PARTS };
        let rows = from.len().div_ceil(UNITS).div_ceil(most).max(ITEMS);
        let cubes = from.len().div_ceil(rows * UNITS).max(1);
        let parts = Buffer::empty(client, "parts of a maximum", cubes)?;
        let (count, rows, all) = (from.len() as u32, rows as u32, cubes as u32);
        // SAFETY: numbers are read below `count`, parts are written below `cubes`.
        unsafe {
            let (values, out) = (from.arg(), parts.arg());
            largest_kernel::launch_unchecked(client, grid(cubes), cube_dim(), values, out, count, rows, all);
        }
        if cubes == 1 {
            return Ok(parts);
        }
        from = parts;
    }
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

/// Makes `flag` `[1]`, which holds 0 or NaN, NaN if a number of `values` is not finite. The order of the units does not
/// matter.
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
