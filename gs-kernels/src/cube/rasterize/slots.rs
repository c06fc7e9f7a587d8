//! Sums over the units of a backward cube, for many values at once, through shared memory.

use cubecl::prelude::*;

/// Units of the cube.
pub(super) const UNITS: usize = 64;
/// Values that are added in shared memory at once: two rows of three channels.
pub(super) const SLOTS: usize = 24;
/// One more than the units, so that units adding different values touch different banks.
pub(super) const SLOT: usize = UNITS + 1;
/// Partial sums of a value. One chain of additions would be four times as long, and a cube waits for the chain with
/// nothing else to do.
const PARTS: usize = 4;

/// Adds `count` values over the units of the cube and writes them to `out` from `to` on, in order. `slots` holds them
/// as `[value][unit]`. All units must call this.
#[cube]
pub(super) fn sum_slots(slots: &Shared<[f32]>, count: u32, out: &mut [f32], to: usize) {
    sync_cube();
    let mut value = UNIT_POS;
    while value < count {
        let base = value as usize * SLOT;
        let mut parts = Array::<f32>::new(PARTS);
        #[unroll]
        for part in 0..PARTS {
            parts[part] = slots[base + part];
        }
        // Unrolled, because a shader compiler that bounds every loop would more than double this one.
        #[unroll]
        for unit in PARTS..UNITS {
            parts[unit % PARTS] += slots[base + unit];
        }
        out[to + value as usize] = (parts[0] + parts[1]) + (parts[2] + parts[3]);
        value += comptime!(UNITS as u32);
    }
    sync_cube();
}
