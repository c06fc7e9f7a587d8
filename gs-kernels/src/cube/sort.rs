//! Stable radix sort of `u32` keys with `u32` values, any length, eight bits per pass.
//!
//! A pass counts digits in blocks of 4096 keys, turns the counts into positions by one prefix sum, and moves every key to its
//! digit's position plus its rank among equal digits before it in the block. The rank is computed from bit masks in shared memory,
//! one bit per unit and one mask per digit. It assumes neither the width of a plane nor an order of arrival, so the result is the
//! same on every device.

use cubecl::prelude::*;

use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid, grid_for};
use crate::cube::error::CubeError;
use crate::cube::scan::exclusive_scan;

/// Bits of a digit.
const DIGIT_BITS: u32 = 8;
/// Digits: one for each unit of a cube.
const DIGITS: usize = 1 << DIGIT_BITS;
/// Rows of [`UNITS`] keys in a block.
const ROWS: usize = 16;
/// Keys a cube handles.
const BLOCK: usize = UNITS * ROWS;
/// Words of 32 bits in a mask with a bit for each unit.
const WORDS: usize = UNITS / 32;

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
    let own_word = unit / 32;
    let own_bit = 1u32 << (UNIT_POS % 32);
    // `[word, digit]`, so that units walking over digits touch neighbouring banks.
    let masks = Shared::<[Atomic<u32>]>::new_slice(comptime!(WORDS * DIGITS));
    let mut next = Shared::<[u32]>::new_slice(DIGITS);
    next[unit] = offsets[unit * blocks as usize + CUBE_POS];
    #[unroll]
    for word in 0..WORDS {
        masks[word * DIGITS + unit].store(0u32);
    }
    sync_cube();

    for row in 0..ROWS {
        let index = CUBE_POS * BLOCK + row * UNITS + unit;
        let inside = index < count as usize;
        let mut key = 0u32;
        if inside {
            key = keys[index];
            masks[own_word * DIGITS + digit(key, shift)].fetch_or(own_bit);
        }
        sync_cube();
        if inside {
            let bin = digit(key, shift);
            let mut position = next[bin];
            #[unroll]
            for word in 0..WORDS {
                let bits = masks[word * DIGITS + bin].load();
                if word < own_word {
                    position += bits.count_ones();
                }
                if word == own_word {
                    position += (bits & (own_bit - 1u32)).count_ones();
                }
            }
            keys_out[position as usize] = key;
            values_out[position as usize] = values[index];
        }
        sync_cube();
        // Unit `d` closes digit `d`: advances its position and clears its masks for the next row.
        let mut moved = 0u32;
        #[unroll]
        for word in 0..WORDS {
            moved += masks[word * DIGITS + unit].load().count_ones();
            masks[word * DIGITS + unit].store(0u32);
        }
        let position = next[unit] + moved;
        next[unit] = position;
        sync_cube();
    }
}

/// Sorts `keys` by their lowest `bits` bits and moves `values` along; equal keys keep their order. The buffers given are
/// used as scratch.
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
        // SAFETY: as above; positions are a permutation of the `count` pairs, because the offsets are the sums of their digits' counts.
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
