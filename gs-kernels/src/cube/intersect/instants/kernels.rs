//! The steps of [`super::intersect_instants`], one kernel each.
//!
//! Classes of rows: 0 moves, at the first instant; `1 + k` moves, at further instant `k`; the last class, `still`, does
//! not move.

use cubecl::prelude::*;

use crate::cube::buffer::UNITS;
use crate::cube::scan::{SUMS, saturating_sum, sums_over_units};
use crate::cube::uniform::of_first_unit;

const UNITS_U32: u32 = UNITS as u32;

/// One unit per row: its class, and its key at its place in the order of numbers in the scene. A Gaussian's rows of
/// further instants follow its own. A stable sort by key then breaks ties as in a list of the whole scene. Its launch
/// is checked, because it indexes by numbers that come from outside.
#[cube(launch)]
pub(super) fn arrange_kernel(
    keys: &[u32],
    moving: &[u32],
    arranged_keys: &mut [u32],
    arranged_rows: &mut [u32],
    classes: &mut [u32],
    count: u32,
    scene: u32,
    movers: u32,
    further: u32,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= count as usize {
        terminate!();
    }
    let row = index as u32;
    let mut low = 0u32;
    let mut class = further + 1u32;
    let mut place = row;
    if row < scene {
        // `low` ends as the number of moving Gaussians before the row.
        let mut high = movers;
        while low < high {
            let middle = low + (high - low) / 2u32;
            if moving[middle as usize] < row {
                low = middle + 1u32;
            } else {
                high = middle;
            }
        }
        place += low * further;
        // Behind the last, which is smaller than the row, there is none.
        let nearest = select(low < movers, low, movers - 1u32);
        if moving[nearest as usize] == row {
            class = 0u32;
        }
    } else {
        let mover = (row - scene) % movers;
        let instant = (row - scene) / movers;
        place = moving[mover as usize] + mover * further + 1u32 + instant;
        class = 1u32 + instant;
    }
    arranged_keys[place as usize] = keys[index];
    arranged_rows[place as usize] = row;
    classes[index] = class;
}

/// One unit per pair in tile order: its row, its class and its slot, three parts of `entries`.
#[cube(launch_unchecked)]
pub(super) fn entry_kernel(
    slots: &[u32],
    owners: &[u32],
    classes: &[u32],
    entries: &mut [u32],
    pairs: u32,
    start_classes: u32,
    start_slots: u32,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < pairs as usize {
        let slot = slots[index];
        let row = owners[slot as usize];
        entries[index] = row;
        entries[start_classes as usize + index] = classes[row as usize];
        entries[start_slots as usize + index] = slot;
    }
}

/// One cube per tile of the image: the number of its pairs of each class, into `table` `[grid, classes]`. A unit counts
/// one class at a time, so that no two write one number.
#[cube(launch_unchecked)]
pub(super) fn class_count_kernel(
    entries: &[u32],
    tile_offsets: &[u32],
    table: &mut [u32],
    grid: u32,
    classes: u32,
    start_classes: u32,
) {
    if CUBE_POS >= grid as usize {
        terminate!();
    }
    let mut staged = Shared::<[u32]>::new_slice(UNITS);
    let mut slot = Shared::<[u32]>::new_slice(1usize);
    let begin = tile_offsets[CUBE_POS];
    let end = tile_offsets[CUBE_POS + 1];
    let batches = of_first_unit((end - begin).div_ceil(UNITS_U32), &mut slot);
    for block in 0..classes.div_ceil(UNITS_U32) {
        let class = block * UNITS_U32 + UNIT_POS;
        let mut total = 0u32;
        for batch in 0..batches {
            let first = begin + batch * UNITS_U32;
            if first + UNIT_POS < end {
                staged[UNIT_POS as usize] = entries[(start_classes + first + UNIT_POS) as usize];
            }
            sync_cube();
            let rest = end - first;
            let count = select(rest < UNITS_U32, rest, UNITS_U32.runtime());
            if class < classes {
                for k in 0..count {
                    total += select(staged[k as usize] == class, 1u32, 0u32);
                }
            }
            sync_cube();
        }
        if class < classes {
            table[CUBE_POS * classes as usize + class as usize] = total;
        }
    }
}

/// The further instants at which something moving touches a tile of the image, and whether the tile has a list without
/// what moves.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
struct TileExtras {
    moved: u32,
    unmoved: u32,
    bare: bool,
}

#[cube]
fn extras_of(table: &[u32], tile: usize, still: u32) -> TileExtras {
    let base = tile * (still as usize + 1);
    let mut moved = 0u32;
    for class in 1u32..still {
        moved += select(table[base + class as usize] > 0u32, 1u32, 0u32);
    }
    let unmoved = still - 1u32 - moved;
    TileExtras { moved, unmoved, bare: table[base] > 0u32 && unmoved > 0u32 }
}

/// One unit per tile of the image: the number of its further lists.
#[cube(launch_unchecked)]
pub(super) fn extra_count_kernel(table: &[u32], extras: &mut [u32], grid: u32, still: u32) {
    let tile = CUBE_POS * UNITS + UNIT_POS as usize;
    if tile < grid as usize {
        let own = extras_of(table, tile, still);
        extras[tile] = own.moved + select(own.bare, 1u32, 0u32);
    }
}

/// One unit per pair in tile order: in how many further lists of its tile the pair's row stands, by slot.
#[cube(launch_unchecked)]
pub(super) fn copy_count_kernel(
    entries: &[u32],
    tiles: &[u32],
    extra_offsets: &[u32],
    copies: &mut [u32],
    pairs: u32,
    grid: u32,
    still: u32,
    start_classes: u32,
    start_slots: u32,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < pairs as usize {
        let tile = tiles[index] as usize;
        let mut count = 0u32;
        if tile < grid as usize && entries[start_classes as usize + index] == still {
            count = extra_offsets[tile + 1] - extra_offsets[tile];
        }
        copies[entries[start_slots as usize + index] as usize] = count;
    }
}

/// The numbers that need room, and whether they have it.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
struct Totals {
    pairs: u32,
    extras: u32,
    fit: bool,
}

#[cube]
fn totals(
    base_offsets: &[u32],
    copy_offsets: &[u32],
    extra_offsets: &[u32],
    rows: u32,
    base_pairs: u32,
    grid: u32,
    room_pairs: u32,
    room_extras: u32,
) -> Totals {
    let pairs = saturating_sum(base_offsets[rows as usize], copy_offsets[base_pairs as usize]);
    let extras = extra_offsets[grid as usize];
    Totals { pairs, extras, fit: pairs <= room_pairs && extras <= room_extras }
}

/// One unit per tile of the image or place for a further list, whichever are more: the image's tile, class and length
/// of each list, three parts of `drawn`, and into `shares` the offsets of further lists and the number of instants of
/// each list. A tile's lists are: the one of the first instant, the one without what moves, and one for each instant at
/// which something moving touches the tile. Without room for all lists every list is empty and no tile has further
/// ones.
#[cube(launch_unchecked)]
pub(super) fn drawn_kernel(
    table: &[u32],
    base_offsets: &[u32],
    copy_offsets: &[u32],
    extra_offsets: &[u32],
    drawn: &mut [u32],
    shares: &mut [u32],
    rows: u32,
    base_pairs: u32,
    grid: u32,
    still: u32,
    room_pairs: u32,
    room_extras: u32,
    start_classes: u32,
    start_lengths: u32,
) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    let total = totals(base_offsets, copy_offsets, extra_offsets, rows, base_pairs, grid, room_pairs, room_extras);
    let counts = grid + 1u32;
    let used = select(total.fit, total.extras, 0u32);
    if index < room_extras && index >= used {
        let list = grid + index;
        drawn[list as usize] = 0u32;
        drawn[(start_classes + list) as usize] = still;
        drawn[(start_lengths + list) as usize] = 0u32;
        shares[(counts + list) as usize] = 0u32;
    }
    if index == 0u32 {
        shares[grid as usize] = used;
    }
    if index < grid {
        let tile = index as usize;
        let base = tile * (still as usize + 1);
        let own = extras_of(table, tile, still);
        let still_rows = table[base + still as usize];
        let mut list = extra_offsets[tile];
        shares[tile] = select(total.fit, list, 0u32);
        let alike = select(table[base] == 0u32, own.unmoved, 0u32);
        shares[(counts + index) as usize] = select(total.fit, 1u32 + alike, still);
        drawn[tile] = index;
        drawn[start_classes as usize + tile] = 0u32;
        drawn[start_lengths as usize + tile] = select(total.fit, still_rows + table[base], 0u32);
        if total.fit {
            list += grid;
            if own.bare {
                drawn[list as usize] = index;
                drawn[(start_classes + list) as usize] = still;
                drawn[(start_lengths + list) as usize] = still_rows;
                shares[(counts + list) as usize] = own.unmoved;
                list += 1u32;
            }
            for class in 1u32..still {
                let movers = table[base + class as usize];
                if movers > 0u32 {
                    drawn[list as usize] = index;
                    drawn[(start_classes + list) as usize] = class;
                    drawn[(start_lengths + list) as usize] = still_rows + movers;
                    shares[(counts + list) as usize] = 1u32;
                    list += 1u32;
                }
            }
        }
    }
}

/// One unit per row and one behind: the offsets of rows with their pairs of all lists, zero without room. Unit 0 writes
/// the higher and lower 16 bits of the numbers of pairs and, from `start_tiles` on, of lists.
#[cube(launch_unchecked)]
pub(super) fn offset_kernel(
    base_offsets: &[u32],
    copy_offsets: &[u32],
    extra_offsets: &[u32],
    base_words: &[f32],
    offsets: &mut [u32],
    words: &mut [f32],
    rows: u32,
    base_pairs: u32,
    grid: u32,
    room_pairs: u32,
    room_extras: u32,
    start_tiles: u32,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index > rows as usize {
        terminate!();
    }
    let total = totals(base_offsets, copy_offsets, extra_offsets, rows, base_pairs, grid, room_pairs, room_extras);
    let base = base_offsets[index];
    offsets[index] = select(total.fit, base + copy_offsets[base as usize], 0u32);
    if index == 0 {
        // If the pairs of one list a tile had no room already, their number is all that is known.
        let base_pairs = (u32::cast_from(base_words[0]) << 16u32) + u32::cast_from(base_words[1]);
        let pairs = select(total.pairs > base_pairs, total.pairs, base_pairs);
        words[0] = f32::cast_from(pairs >> 16u32);
        words[1] = f32::cast_from(pairs & 0xffffu32);
        let lists = grid + total.extras;
        words[start_tiles as usize] = f32::cast_from(lists >> 16u32);
        words[start_tiles as usize + 1] = f32::cast_from(lists & 0xffffu32);
    }
}

/// One unit per place in the final lists. Of a pair of the first lists it writes where its own pair and its first copy
/// stand in the list by row, two parts of `targets`. Pairs of no tile, and places behind the last pair, get an entry
/// behind all tiles' lists.
#[cube(launch_unchecked)]
pub(super) fn target_kernel(
    entries: &[u32],
    base_offsets: &[u32],
    copy_offsets: &[u32],
    base_tile_offsets: &[u32],
    offsets: &[u32],
    targets: &mut [u32],
    lists: &mut [u32],
    rows: u32,
    base_pairs: u32,
    pairs: u32,
    grid: u32,
    start_slots: u32,
    start_copies: u32,
    start_positions: u32,
) {
    let index = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    let total = offsets[rows as usize];
    let base_total = base_offsets[rows as usize];
    let behind_tiles = base_tile_offsets[grid as usize];
    if index < base_pairs {
        let row = entries[index as usize];
        let slot = entries[(start_slots + index) as usize];
        let own = slot + (offsets[row as usize] - base_offsets[row as usize]);
        targets[index as usize] = own;
        targets[(start_copies + index) as usize] = base_offsets[row as usize + 1] + copy_offsets[slot as usize];
        // Rounding may send a pair to a tile behind the last. Its row keeps it, as one of no tile.
        if total > 0u32 && index >= behind_tiles && index < base_total {
            let position = total - (base_total - behind_tiles) + (index - behind_tiles);
            lists[position as usize] = row;
            lists[(start_positions + own) as usize] = position;
        }
    }
    if index < pairs && index >= total {
        lists[index as usize] = 0u32;
        lists[(start_positions + index) as usize] = index;
    }
}

/// One cube per list: the rows of its tile that stand still or move at its instant, in the order of the tile, and the
/// places of these pairs in the list by row.
#[cube(launch_unchecked)]
pub(super) fn fill_kernel(
    entries: &[u32],
    targets: &[u32],
    base_tile_offsets: &[u32],
    drawn: &[u32],
    tile_offsets: &[u32],
    shares: &[u32],
    lists: &mut [u32],
    tiles: u32,
    grid: u32,
    still: u32,
    start_entry_classes: u32,
    start_copies: u32,
    start_drawn_classes: u32,
    start_positions: u32,
) {
    if CUBE_POS >= tiles as usize {
        terminate!();
    }
    let mut sums = Shared::<[u32]>::new_slice(comptime!(2 * UNITS));
    let mut slot = Shared::<[u32]>::new_slice(1usize);
    let mut position = tile_offsets[CUBE_POS];
    let list_end = tile_offsets[CUBE_POS + 1];
    let tile = drawn[CUBE_POS] as usize;
    let class = drawn[start_drawn_classes as usize + CUBE_POS];
    let list = CUBE_POS as u32;
    let is_extra = list >= grid;
    let mut copy = 0u32;
    if is_extra {
        copy = list - grid - shares[tile];
    }
    let begin = base_tile_offsets[tile];
    let end = select(list_end > position, base_tile_offsets[tile + 1], begin);
    let batches = of_first_unit((end - begin).div_ceil(UNITS_U32), &mut slot);
    for batch in 0..batches {
        let entry = begin + batch * UNITS_U32 + UNIT_POS;
        let mut kept = 0u32;
        let mut stands = false;
        if entry < end {
            let own = entries[(start_entry_classes + entry) as usize];
            stands = own == still;
            kept = select(stands || own == class, 1u32, 0u32);
        }
        sums_over_units(kept, &mut sums);
        let place = position + sums[SUMS + UNIT_POS as usize] - kept;
        position += sums[comptime!(SUMS + UNITS - 1)];
        // The next batch writes these sums.
        sync_cube();
        if kept == 1u32 {
            let mut target = targets[entry as usize];
            if is_extra && stands {
                target = targets[(start_copies + entry) as usize] + copy;
            }
            lists[place as usize] = entries[entry as usize];
            lists[(start_positions + target) as usize] = place;
        }
    }
}
