//! Stable radix sort of `u32` keys with `u32` values, any length, eight bits per pass.
//!
//! A pass counts digits in blocks of 2048 keys, turns the counts into positions by one prefix sum, and moves every key
//! to its digit's position plus its rank among equal digits before it in the block. A cube first sorts its block by the
//! digit in shared memory, four bits at a time, so that the keys of a digit are written side by side. Ranks are prefix
//! sums over units and assume neither the width of a plane nor an order of arrival, so the result is the same on every
//! device.

use cubecl::prelude::*;

use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid, grid_for};
use crate::cube::error::CubeError;
use crate::cube::scan::{SUMS, exclusive_scan, sums_over_units};

/// Bits of a digit.
const DIGIT_BITS: u32 = 8;
/// Digits: one for each unit of a cube.
const DIGITS: usize = 1 << DIGIT_BITS;
/// Keys of a unit.
const ROWS: usize = 8;
/// Keys a cube handles. With the counters they take 16 KiB of shared memory, the least that WebGPU promises.
const BLOCK: usize = UNITS * ROWS;
/// Bits of half a digit, by which a cube sorts its block at once.
const HALF_BITS: u32 = DIGIT_BITS / 2;
/// Words of counters for each unit: two counters of 16 bits in one, for the values of half a digit and for those with
/// its highest bit. A counter is at most [`BLOCK`].
const WORDS: usize = 1 << (HALF_BITS - 1);

#[cube]
fn digit(key: u32, shift: u32) -> usize {
    ((key >> shift) & comptime!(DIGITS as u32 - 1)) as usize
}

/// Each cube counts the digits of its block; `counts` is `[digit, block]`.
#[cube(launch_unchecked)]
fn sort_count_kernel(keys: &[u32], counts: &mut [u32], count: u32, blocks: u32, shift: u32) {
    if CUBE_POS >= blocks as usize {
        terminate!();
    }
    let unit = UNIT_POS as usize;
    let bins = Shared::<[Atomic<u32>]>::new_slice(DIGITS);
    bins[unit].store(0u32);
    sync_cube();
    for row in 0..ROWS {
        let index = CUBE_POS * BLOCK + row * UNITS + unit;
        if index < count as usize {
            bins[digit(keys[index], shift)].fetch_add(1u32);
        }
    }
    sync_cube();
    counts[unit * blocks as usize + CUBE_POS] = bins[unit].load();
}

/// The stable places in the block of a unit's `keys`, sorted by the four bits from `shift` on. `counters` and `scratch`
/// are shared; a barrier is behind the last use of both.
#[cube]
fn places_by_half(
    keys: &Array<u32>,
    places: &mut Array<u32>,
    counters: &mut Shared<[u32]>,
    scratch: &mut Shared<[u32]>,
    shift: u32,
) {
    let unit = UNIT_POS as usize;
    #[unroll]
    for word in 0..WORDS {
        counters[word * UNITS + unit] = 0u32;
    }
    // Counters are `[word, unit]`: those of a unit are its own until the barrier.
    #[unroll]
    for k in 0..ROWS {
        let value = (keys[k] >> shift) & comptime!((1u32 << HALF_BITS) - 1);
        let at = (value as usize % WORDS) * UNITS + unit;
        let up = (value >> comptime!(HALF_BITS - 1)) * 16u32;
        let counted = counters[at];
        places[k] = (counted >> up) & 0xffffu32;
        counters[at] = counted + (1u32 << up);
    }
    sync_cube();
    // A unit adds up `WORDS` counters that follow one another, a scan over units adds what is before them.
    let first = unit * WORDS;
    let mut own = 0u32;
    #[unroll]
    for word in 0..WORDS {
        own += counters[first + word];
    }
    sums_over_units(own, scratch);
    // The counters in the higher bits come behind all in the lower.
    let mut running = (scratch[SUMS + UNITS - 1] & 0xffffu32) << 16u32;
    if unit > 0 {
        running += scratch[SUMS + unit - 1];
    }
    #[unroll]
    for word in 0..WORDS {
        let counted = counters[first + word];
        counters[first + word] = running;
        running += counted;
    }
    sync_cube();
    #[unroll]
    for k in 0..ROWS {
        let value = (keys[k] >> shift) & comptime!((1u32 << HALF_BITS) - 1);
        let up = (value >> comptime!(HALF_BITS - 1)) * 16u32;
        places[k] += (counters[(value as usize % WORDS) * UNITS + unit] >> up) & 0xffffu32;
    }
    sync_cube();
}

/// Moves a block's `items` to their `places` through `shared`; unit `u` then holds the items from place `u ROWS` on.
#[cube]
fn move_within(items: &mut Array<u32>, places: &Array<u32>, shared: &mut Shared<[u32]>) {
    #[unroll]
    for k in 0..ROWS {
        shared[places[k] as usize] = items[k];
    }
    sync_cube();
    #[unroll]
    for k in 0..ROWS {
        items[k] = shared[UNIT_POS as usize * ROWS + k];
    }
    sync_cube();
}

/// Each cube moves the pairs of its block to their positions; `offsets` is the prefix sum of the counts.
#[cube(launch_unchecked)]
fn sort_move_kernel(
    keys: &[u32],
    values: &[u32],
    offsets: &[u32],
    keys_out: &mut [u32],
    values_out: &mut [u32],
    count: u32,
    blocks: u32,
    shift: u32,
) {
    if CUBE_POS >= blocks as usize {
        terminate!();
    }
    let unit = UNIT_POS as usize;
    let begin = CUBE_POS * BLOCK;
    let left = count - begin as u32;
    let inside = select(left < comptime!(BLOCK as u32), left, comptime!(BLOCK as u32)) as usize;
    let mut shared = Shared::<[u32]>::new_slice(BLOCK);
    let mut counters = Shared::<[u32]>::new_slice(comptime!(WORDS * UNITS));
    let mut own_keys = Array::<u32>::new(ROWS);
    let mut own_values = Array::<u32>::new(ROWS);
    let mut places = Array::<u32>::new(ROWS);

    // Neighbouring units read neighbouring keys; then each unit has keys that follow one another. Keys behind the last
    // have the largest digit and come behind all others of it.
    #[unroll]
    for k in 0..ROWS {
        let index = k * UNITS + unit;
        places[k] = index as u32;
        own_keys[k] = 0xffff_ffffu32;
        own_values[k] = 0u32;
        if index < inside {
            own_keys[k] = keys[begin + index];
            own_values[k] = values[begin + index];
        }
    }
    move_within(&mut own_keys, &places, &mut shared);
    move_within(&mut own_values, &places, &mut shared);
    #[unroll]
    for half in 0..2u32 {
        let by = shift + half * HALF_BITS;
        places_by_half(&own_keys, &mut places, &mut counters, &mut shared, by);
        move_within(&mut own_keys, &places, &mut shared);
        move_within(&mut own_values, &places, &mut shared);
    }

    // Where each digit's keys begin in the block, less where they begin in the output.
    #[unroll]
    for k in 0..ROWS {
        shared[unit * ROWS + k] = own_keys[k];
    }
    sync_cube();
    #[unroll]
    for k in 0..ROWS {
        let index = unit * ROWS + k;
        let bin = digit(own_keys[k], shift);
        let mut starts = index == 0;
        if !starts {
            starts = digit(shared[index - 1], shift) != bin;
        }
        if starts {
            counters[bin] = offsets[bin * blocks as usize + CUBE_POS] - index as u32;
        }
    }
    sync_cube();
    #[unroll]
    for k in 0..ROWS {
        let index = k * UNITS + unit;
        let key = shared[index];
        places[k] = counters[digit(key, shift)] + index as u32;
        if index < inside {
            keys_out[places[k] as usize] = key;
        }
    }
    sync_cube();
    #[unroll]
    for k in 0..ROWS {
        shared[unit * ROWS + k] = own_values[k];
    }
    sync_cube();
    #[unroll]
    for k in 0..ROWS {
        let index = k * UNITS + unit;
        if index < inside {
            values_out[places[k] as usize] = shared[index];
        }
    }
}

/// Sorts `keys` by their lowest `bits` bits and moves `values` along; equal keys keep their order. The buffers given
/// are used as scratch.
///
/// # Errors
/// When a buffer would be too large.
///
/// # Panics
/// When keys and values differ in number.
pub fn sort_pairs(
    client: &Client,
    mut keys: Buffer,
    mut values: Buffer,
    bits: u32,
) -> Result<(Buffer, Buffer), CubeError> {
    assert_eq!(keys.len(), values.len(), "as many values as keys");
    let count = keys.len();
    if count < 2 || bits == 0 {
        return Ok((keys, values));
    }
    let blocks = count.div_ceil(BLOCK);
    let counts = Buffer::empty(client, "digit counts of a sort", DIGITS * blocks)?;
    let mut keys_out = Buffer::empty(client, "sorted keys", count)?;
    let mut values_out = Buffer::empty(client, "sorted values", count)?;
    for shift in (0..bits).step_by(DIGIT_BITS as usize) {
        // SAFETY: keys below `count`; `counts` holds a value for each digit and block.
        unsafe {
            sort_count_kernel::launch_unchecked(
                client,
                grid(blocks),
                cube_dim(),
                keys.arg(),
                counts.arg(),
                count as u32,
                blocks as u32,
                shift,
            );
        }
        let offsets = exclusive_scan(client, &counts, DIGITS * blocks)?;
        // SAFETY: as above; positions are a permutation of the `count` pairs, because the offsets are the sums of their
        // digits' counts.
        unsafe {
            sort_move_kernel::launch_unchecked(
                client,
                grid(blocks),
                cube_dim(),
                keys.arg(),
                values.arg(),
                offsets.arg(),
                keys_out.arg(),
                values_out.arg(),
                count as u32,
                blocks as u32,
                shift,
            );
        }
        std::mem::swap(&mut keys, &mut keys_out);
        std::mem::swap(&mut values, &mut values_out);
    }
    Ok((keys, values))
}

/// One unit per key that may occur, and one behind: finds the first place of a key that is not below it, by bisection.
#[cube(launch_unchecked)]
fn first_of_keys_kernel(sorted: &[u32], starts: &mut [u32], keys: u32, count: u32) {
    let key = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if key > keys {
        terminate!();
    }
    let mut low = 0u32;
    let mut high = count;
    while low < high {
        let middle = low + (high - low) / 2u32;
        if sorted[middle as usize] < key {
            low = middle + 1u32;
        } else {
            high = middle;
        }
    }
    starts[key as usize] = low;
}

/// Where each of the keys `0..keys` begins in `sorted`, and where the last ends: `[keys + 1]`.
///
/// # Errors
/// When the result exceeds one buffer.
pub fn first_of_keys(client: &Client, sorted: &Buffer, keys: usize) -> Result<Buffer, CubeError> {
    let starts = Buffer::empty(client, "offsets of sorted keys", keys + 1)?;
    let (cubes, key_count, count) = (grid_for(keys + 1), keys as u32, sorted.len() as u32);
    let (sorted, out) = (sorted.arg(), starts.arg());
    // SAFETY: `sorted` is read below `count`; `starts` is written up to `keys`.
    unsafe { first_of_keys_kernel::launch_unchecked(client, cubes, cube_dim(), sorted, out, key_count, count) };
    Ok(starts)
}
