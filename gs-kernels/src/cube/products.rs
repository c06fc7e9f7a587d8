//! Products whose sums run over many rows: by groups of rows, one unit per group and result, then groups of groups. The
//! order of additions depends on the number of rows alone, so results are equal to the bit from run to run.
//!
//! A tensor library on a CPU has these as matrix products; its GPU backends give such a sum to one unit per result.

use cubecl::prelude::*;

use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::error::CubeError;

/// Rows that a unit multiplies and adds.
const GROUP: usize = 256;

/// Groups that a unit adds.
const GROUPS: usize = 1024;

/// `parts[group, i, j] = sum a[row, i] b[row, j]` over the rows of the group; without `factors` every `a` is 1.
#[cube(launch_unchecked)]
fn group_product_kernel(
    a: &[f32],
    b: &[f32],
    parts: &mut [f32],
    values: u32,
    rows: u32,
    inner: u32,
    outer: u32,
    #[comptime] factors: bool,
) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index >= values {
        terminate!();
    }
    let j = index % outer;
    let i = index / outer % inner;
    let first = index / outer / inner * comptime!(GROUP as u32);
    let rest = rows - first;
    let count = select(rest < comptime!(GROUP as u32), rest, comptime!(GROUP as u32).runtime());
    let mut sum = 0.0f32;
    for row in first..first + count {
        let right = b[row as usize * outer as usize + j as usize];
        if comptime!(factors) {
            sum += a[row as usize * inner as usize + i as usize] * right;
        } else {
            sum += right;
        }
    }
    parts[index as usize] = sum;
}

/// `parts[group, s] = sum v[s, k] factors[k]` over the numbers of the group.
#[cube(launch_unchecked)]
fn group_dot_kernel(v: &[f32], factors: &[f32], parts: &mut [f32], values: u32, length: u32, lines: u32) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index >= values {
        terminate!();
    }
    let line = (index % lines) as usize;
    let first = index / lines * comptime!(GROUP as u32);
    let rest = length - first;
    let count = select(rest < comptime!(GROUP as u32), rest, comptime!(GROUP as u32).runtime());
    let mut sum = 0.0f32;
    for k in first..first + count {
        sum += v[line * length as usize + k as usize] * factors[k as usize];
    }
    parts[index as usize] = sum;
}

/// `sums[group, c] = sum parts[g, c]` over [`GROUPS`] groups.
#[cube(launch_unchecked)]
fn group_sum_kernel(parts: &[f32], sums: &mut [f32], values: u32, groups: u32, columns: u32) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if index >= values {
        terminate!();
    }
    let column = (index % columns) as usize;
    let first = index / columns * comptime!(GROUPS as u32);
    let rest = groups - first;
    let count = select(rest < comptime!(GROUPS as u32), rest, comptime!(GROUPS as u32).runtime());
    let mut sum = 0.0f32;
    for group in first..first + count {
        sum += parts[group as usize * columns as usize + column];
    }
    sums[index as usize] = sum;
}

/// Adds `[groups, columns]` to `[columns]`, zeros without a group.
fn added(client: &Client, mut parts: Buffer, mut groups: usize, columns: usize) -> Result<Buffer, CubeError> {
    while groups != 1 {
        let next = groups.div_ceil(GROUPS).max(1);
        let sums = Buffer::empty(client, "sums of groups of rows", next * columns)?;
        if !sums.is_empty() {
            let (grid, values) = (grid_for(sums.len()), sums.len() as u32);
            let (from, to) = (parts.arg(), sums.arg());
            // SAFETY: `parts` holds `groups` rows; sums are below `values`.
            unsafe {
                group_sum_kernel::launch_unchecked(
                    client,
                    grid,
                    cube_dim(),
                    from,
                    to,
                    values,
                    groups as u32,
                    columns as u32,
                );
            }
        }
        (parts, groups) = (sums, next);
    }
    Ok(parts)
}

/// `a^T b`, `[inner, outer]`, of `a` `[rows, inner]` and `b` `[rows, outer]`.
///
/// # Errors
/// When the groups' sums exceed one buffer.
///
/// # Panics
/// When the buffers disagree in length.
pub fn transposed(client: &Client, a: &Buffer, b: &Buffer, inner: usize, outer: usize) -> Result<Buffer, CubeError> {
    let rows = b.len() / outer.max(1);
    assert_eq!(a.len(), rows * inner, "as many rows of a as of b");
    by_groups(client, Some(a), b, rows, inner, outer)
}

/// The sum of the rows of `b` `[rows, outer]`, `[outer]`.
///
/// # Errors
/// As [`transposed`].
pub fn column_sums(client: &Client, b: &Buffer, outer: usize) -> Result<Buffer, CubeError> {
    by_groups(client, None, b, b.len() / outer.max(1), 1, outer)
}

fn by_groups(
    client: &Client,
    a: Option<&Buffer>,
    b: &Buffer,
    rows: usize,
    inner: usize,
    outer: usize,
) -> Result<Buffer, CubeError> {
    let groups = rows.div_ceil(GROUP);
    let none = Buffer::empty(client, "no factors", 1)?;
    let parts = Buffer::empty(client, "products of groups of rows", groups * inner * outer)?;
    if !parts.is_empty() {
        let (grid, values) = (grid_for(parts.len()), parts.len() as u32);
        let (factors, to) = (a.unwrap_or(&none).arg(), parts.arg());
        let (rows, inner, outer) = (rows as u32, inner as u32, outer as u32);
        // SAFETY: rows below `rows`, which both hold; parts below `values`.
        unsafe {
            group_product_kernel::launch_unchecked(
                client,
                grid,
                cube_dim(),
                factors,
                b.arg(),
                to,
                values,
                rows,
                inner,
                outer,
                a.is_some(),
            );
        }
    }
    added(client, parts, groups, inner * outer)
}

/// For each line of `v` `[lines, length]` its product with `factors` `[length]`, `[lines]`.
///
/// # Errors
/// As [`transposed`].
///
/// # Panics
/// When the buffers disagree in length.
pub fn dots(client: &Client, v: &Buffer, factors: &Buffer, lines: usize) -> Result<Buffer, CubeError> {
    let length = factors.len();
    assert_eq!(v.len(), lines * length, "a number for each line and factor");
    let groups = length.div_ceil(GROUP);
    let parts = Buffer::empty(client, "products of groups of numbers", groups * lines)?;
    if !parts.is_empty() {
        let (grid, values) = (grid_for(parts.len()), parts.len() as u32);
        let (v, factors, to) = (v.arg(), factors.arg(), parts.arg());
        // SAFETY: lines below `lines`, numbers below `length`, parts below `values`.
        unsafe {
            group_dot_kernel::launch_unchecked(
                client,
                grid,
                cube_dim(),
                v,
                factors,
                to,
                values,
                length as u32,
                lines as u32,
            );
        }
    }
    added(client, parts, groups, lines)
}
