//! Sums over a cube and over columns, always in one order, so that equal inputs give equal bits.

use cubecl::prelude::*;

use crate::cube::buffer::UNITS;

/// Sum of `value` over the [`UNITS`] units of the cube, returned to all of them. `slots` holds [`UNITS`] values. All
/// units must call this.
#[cube]
pub(crate) fn cube_sum(value: f32, slots: &mut Shared<[f32]>) -> f32 {
    let unit = UNIT_POS as usize;
    slots[unit] = value;
    sync_cube();
    #[unroll]
    for step in 0..comptime!(UNITS.ilog2() as usize) {
        let half = comptime!(UNITS >> (step + 1));
        if unit < half {
            let sum = slots[unit] + slots[unit + half];
            slots[unit] = sum;
        }
        sync_cube();
    }
    let total = slots[0];
    // The slots may be overwritten once all units have read them.
    sync_cube();
    total
}

/// Sum of one column of `values` `[rows, columns]`, by one cube of [`UNITS`] units.
#[cube]
pub(crate) fn column_sum(
    values: &[f32],
    rows: u32,
    column: u32,
    #[comptime] columns: usize,
    slots: &mut Shared<[f32]>,
) -> f32 {
    let mut sum = 0.0f32;
    let mut row = UNIT_POS;
    while row < rows {
        sum += values[row as usize * columns + column as usize];
        row += comptime!(UNITS as u32);
    }
    cube_sum(sum, slots)
}
