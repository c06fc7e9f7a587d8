//! The lists of a tile's Gaussians and of a Gaussian's tiles.

use cubecl::prelude::*;

use super::spans::{columns_in, ellipse, tile_count_kernel};
use crate::config::tile_grid;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for, most_bytes};
use crate::cube::error::CubeError;
use crate::cube::rows::read_row;
use crate::cube::scan::exclusive_scan;
use crate::cube::sort::{first_of_keys, sort_pairs};
use crate::rows::PROJECTED;

/// Tiles and the Gaussians that touch them, on the device; see [`crate::cpu::intersect::Intersections`].
#[derive(Clone, Debug)]
pub struct Intersections {
    /// `[tiles + 1]`. For lists with [places](crate::cpu::intersect::Intersections::places), those `[tiles]` follow in
    /// the same buffer, because the backward kernel has no binding left.
    pub tile_offsets: Buffer,
    /// Number of lists with `places`; 0 if the tiles are those of the image in order.
    pub placed: usize,
    /// `[M]`, by tile, then depth, then index.
    pub gaussian_ids: Buffer,
    /// `[N + 1]`
    pub gaussian_offsets: Buffer,
    /// `[M]`, by Gaussian.
    pub positions: Buffer,
}

/// Lists, and the number of their pairs where the device alone knows it.
#[derive(Clone, Debug)]
pub struct Found {
    /// The lists; `M` is the number of pairs, or the room for them if there are `words`.
    pub lists: Intersections,
    /// `[2]`, `f32`: the higher and the lower 16 bits of the number of pairs.
    pub words: Option<Buffer>,
}

/// One unit per Gaussian and one behind: `counts_in_order[k] = counts[order[k]]` and a copy of `offsets`, all zero if
/// the pairs, whose number the offsets end with, exceed `room`. Unit 0 writes that number's higher and lower 16 bits.
#[cube(launch_unchecked)]
fn admit_kernel(
    counts: &[u32],
    order: &[u32],
    offsets: &[u32],
    counts_in_order: &mut [u32],
    admitted: &mut [u32],
    words: &mut [f32],
    count: u32,
    room: u32,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index > count as usize {
        terminate!();
    }
    let pairs = offsets[count as usize];
    let fit = pairs <= room;
    admitted[index] = select(fit, offsets[index], 0u32);
    if index < count as usize {
        counts_in_order[index] = select(fit, counts[order[index] as usize], 0u32);
    }
    if index == 0 {
        words[0] = f32::cast_from(pairs >> 16u32);
        words[1] = f32::cast_from(pairs & 0xffffu32);
    }
}

/// Pairs that a unit writes: enough to pay for the search for the first one's Gaussian, few enough that a Gaussian over
/// all tiles is written by many units.
pub const PAIRS_OF_A_UNIT: u32 = 16;

/// One unit per [`PAIRS_OF_A_UNIT`] pairs in depth order of their Gaussians: writes them. `pairs` has three parts of
/// one length: the tile of each pair, the pair's slot in the list by Gaussian, and the Gaussian of each slot. The unit
/// searches the Gaussian of its first pair and walks over that Gaussian's tile rows up to the pair, so a unit walks
/// over at most a column of tiles more than it writes. Places behind the last pair, up to `room`, go to a tile behind
/// the last.
#[cube(launch_unchecked)]
fn emit_kernel(
    projected: &[f32],
    opacities: &[f32],
    order: &[u32],
    gaussian_offsets: &[u32],
    emit_offsets: &[u32],
    pairs: &mut [u32],
    count: u32,
    room: u32,
    width: f32,
    height: f32,
    tile_columns: u32,
    tiles: u32,
    start_slots: u32,
    start_owners: u32,
) {
    let first = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    let mut pair = first * PAIRS_OF_A_UNIT;
    if pair >= room {
        terminate!();
    }
    let written = select(room - pair > PAIRS_OF_A_UNIT, pair + PAIRS_OF_A_UNIT, room);
    let pair_count = gaussian_offsets[count as usize];
    let end = select(pair_count < written, pair_count, written);
    // The last Gaussian whose pairs begin at `pair` or before; those without pairs are behind all others.
    let mut rank = 0u32;
    let mut high = count;
    while high - rank > 1u32 {
        let middle = rank + (high - rank) / 2u32;
        if emit_offsets[middle as usize] <= pair {
            rank = middle;
        } else {
            high = middle;
        }
    }
    while pair < end && rank < count {
        let gaussian = order[rank as usize];
        let slot = gaussian_offsets[gaussian as usize];
        let begin = emit_offsets[rank as usize];
        let own_end = begin + (gaussian_offsets[gaussian as usize + 1] - slot);
        let stop = select(own_end < end, own_end, end);
        let row = read_row(projected, gaussian as usize);
        let ellipse = ellipse(row, opacities[gaussian as usize], height);
        // Pairs in the rows above.
        let mut above = begin;
        let mut tile_row = ellipse.rows.first;
        while pair < stop && tile_row <= ellipse.rows.last {
            let columns = columns_in(row, ellipse, tile_row, width, height);
            let below = above + (columns.last + 1u32 - columns.first);
            while pair < stop && pair < below {
                pairs[pair as usize] = tile_row * tile_columns + columns.first + (pair - above);
                pairs[(start_slots + pair) as usize] = slot + (pair - begin);
                pairs[(start_owners + slot + (pair - begin)) as usize] = gaussian;
                pair += 1u32;
            }
            above = below;
            tile_row += 1u32;
        }
        // A compiler may round this kernel and the counting one differently. If a tile is missing now, its pair goes to
        // a tile behind the last, which is never drawn.
        while pair < stop {
            pairs[pair as usize] = tiles;
            pairs[(start_slots + pair) as usize] = slot + (pair - begin);
            pairs[(start_owners + slot + (pair - begin)) as usize] = gaussian;
            pair += 1u32;
        }
        rank += 1u32;
    }
    while pair < written {
        pairs[pair as usize] = tiles;
        pairs[(start_slots + pair) as usize] = pair;
        pairs[(start_owners + pair) as usize] = 0u32;
        pair += 1u32;
    }
}

/// One unit per pair in tile order: writes its Gaussian, and its position into the Gaussian's list.
#[cube(launch_unchecked)]
fn place_kernel(slots: &[u32], owners: &[u32], gaussian_ids: &mut [u32], positions: &mut [u32], pairs: u32) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < pairs as usize {
        let slot = slots[index] as usize;
        gaussian_ids[index] = owners[slot];
        positions[slot] = index as u32;
    }
}

/// The rows of a table before their pairs are made: number of tiles, depth as a key, and row number, each `[N]`.
pub(super) struct Counted {
    pub(super) counts: Buffer,
    pub(super) keys: Buffer,
    pub(super) ids: Buffer,
}

/// Counts the tiles of each row; arguments as in [`intersect`].
///
/// # Errors
/// As [`intersect`].
///
/// # Panics
/// As [`intersect`].
pub(super) fn count_tiles(
    client: &Client,
    projected: &Buffer,
    opacities: &Buffer,
    features: &Buffer,
    [width, height]: [u32; 2],
    channels: usize,
) -> Result<Counted, CubeError> {
    let count = projected.len() / PROJECTED;
    assert_eq!(opacities.len(), count, "opacities must be [N] for {count} projected rows");
    assert_eq!(features.len(), count * channels, "features must be [N, {channels}] for {count} projected rows");
    if width > 1 << 20 || height > 1 << 20 {
        return Err(CubeError::ImageTooLarge { width, height });
    }
    let counts = Buffer::empty(client, "tile counts", count)?;
    let keys = Buffer::empty(client, "depth keys", count)?;
    let ids = Buffer::empty(client, "indices", count)?;
    if count > 0 {
        // SAFETY: rows below `count`; the buffers' lengths are checked above.
        unsafe {
            tile_count_kernel::launch_unchecked(
                client,
                grid_for(count),
                cube_dim(),
                projected.arg(),
                opacities.arg(),
                features.arg(),
                counts.arg(),
                keys.arg(),
                ids.arg(),
                count as u32,
                channels as u32,
                width as f32,
                height as f32,
            );
        }
    }
    Ok(Counted { counts, keys, ids })
}

/// All pairs in tile order, within a tile by depth. `M` is their number, or the room for them.
pub(super) struct ByTile {
    /// `[tiles + 1]`
    pub(super) tile_offsets: Buffer,
    /// Tile of each pair, `[M]`; `tiles` for a pair of no tile.
    pub(super) tiles: Buffer,
    /// Place of each pair in the list by Gaussian, `[M]`.
    pub(super) slots: Buffer,
    /// Gaussian of each place in the list by Gaussian, `[M]`.
    pub(super) owners: Buffer,
    /// `[N + 1]`
    pub(super) gaussian_offsets: Buffer,
    /// `[2]`: see [`Found::words`].
    pub(super) words: Buffer,
}

/// The room if the largest buffer of the lists holds it, in which a pair has 12 bytes.
pub(super) fn usable_room(client: &Client, room: Option<usize>) -> Option<usize> {
    room.filter(|room| *room <= i32::MAX as usize && *room as u64 * 12 <= most_bytes(client))
}

/// Sorts the pairs of `counted` rows; ties in depth keep the order of `counted.keys`. `room` is a [`usable_room`].
///
/// # Errors
/// As [`intersect`].
pub(super) fn by_tile(
    client: &Client,
    projected: &Buffer,
    opacities: &Buffer,
    Counted { counts, keys, ids }: Counted,
    [width, height]: [u32; 2],
    room: Option<usize>,
) -> Result<ByTile, CubeError> {
    let count = counts.len();
    let (columns, rows) = tile_grid(width, height);
    let tiles = columns * rows;
    let all_offsets = exclusive_scan(client, &counts, count + 1)?;
    let (_, order) = sort_pairs(client, keys, ids, u32::BITS)?;
    let counts_in_order = Buffer::empty(client, "tile counts in depth order", count)?;
    let gaussian_offsets = Buffer::empty(client, "offsets of Gaussians", count + 1)?;
    let words = Buffer::empty(client, "number of pairs", 2)?;
    // SAFETY: `order` is a permutation of the `count` rows; both offsets hold `count + 1` values.
    unsafe {
        admit_kernel::launch_unchecked(
            client,
            grid_for(count + 1),
            cube_dim(),
            counts.arg(),
            order.arg(),
            all_offsets.arg(),
            counts_in_order.arg(),
            gaussian_offsets.arg(),
            words.arg(),
            count as u32,
            room.map_or(u32::MAX, |room| room as u32),
        );
    }
    let emit_offsets = exclusive_scan(client, &counts_in_order, count)?;

    let pairs = match room {
        Some(room) => room,
        None => gaussian_offsets.part(count, 1).download::<u32>(client)?[0] as usize,
    };
    if pairs > i32::MAX as usize {
        return Err(CubeError::TooManyIntersections);
    }

    let slab = Buffer::slab(client, "pairs of tile and Gaussian", [pairs; 3])?;
    if pairs > 0 {
        // SAFETY: ranks and Gaussians are below `count`, as the sort permutes them; pairs and slots are below `pairs`,
        // because the admitted offsets end there or before; the slab's parts are that long.
        unsafe {
            emit_kernel::launch_unchecked(
                client,
                grid_for(pairs.div_ceil(PAIRS_OF_A_UNIT as usize)),
                cube_dim(),
                projected.arg(),
                opacities.arg(),
                order.arg(),
                gaussian_offsets.arg(),
                emit_offsets.arg(),
                slab.whole.arg(),
                count as u32,
                pairs as u32,
                width as f32,
                height as f32,
                columns as u32,
                tiles as u32,
                slab.starts[1] as u32,
                slab.starts[2] as u32,
            );
        }
    }
    let [pair_tiles, slots, owners] = slab.parts;
    let (sorted, slots) = sort_pairs(client, pair_tiles, slots, u32::BITS - (tiles as u32).leading_zeros())?;
    let tile_offsets = first_of_keys(client, &sorted, tiles)?;
    Ok(ByTile { tile_offsets, tiles: sorted, slots, owners, gaussian_offsets, words })
}

/// Finds all (tile, Gaussian) pairs: `projected` `[N, 8]`, `opacities` `[N]`, `features` `[N, C]`; the twin of
/// [`crate::cpu::intersect::intersect`].
///
/// Without `room` the number of pairs is read back. With it, the lists have this length and nothing waits for the
/// device: places behind the last pair belong to no tile and no Gaussian, and if there are more pairs than `room`, all
/// lists are empty. Room that does not fit into a buffer is not used.
///
/// # Errors
/// When there are 2^31 pairs or more, a buffer would be too large, an image side exceeds 2^20 pixels, or the device
/// fails while the number of pairs is read.
///
/// # Panics
/// When the buffers disagree in length.
pub fn intersect(
    client: &Client,
    projected: &Buffer,
    opacities: &Buffer,
    features: &Buffer,
    size: [u32; 2],
    channels: usize,
    room: Option<usize>,
) -> Result<Found, CubeError> {
    let room = usable_room(client, room);
    let counted = count_tiles(client, projected, opacities, features, size, channels)?;
    let by_tile = by_tile(client, projected, opacities, counted, size, room)?;
    let pairs = by_tile.slots.len();
    let gaussian_ids = Buffer::empty(client, "Gaussians by tile", pairs)?;
    let positions = Buffer::empty(client, "places by Gaussian", pairs)?;
    if pairs > 0 {
        // SAFETY: slots are a permutation of the pairs.
        unsafe {
            place_kernel::launch_unchecked(
                client,
                grid_for(pairs),
                cube_dim(),
                by_tile.slots.arg(),
                by_tile.owners.arg(),
                gaussian_ids.arg(),
                positions.arg(),
                pairs as u32,
            );
        }
    }
    let ByTile { tile_offsets, gaussian_offsets, words, .. } = by_tile;
    let lists = Intersections { tile_offsets, placed: 0, gaussian_ids, gaussian_offsets, positions };
    Ok(Found { lists, words: room.map(|_| words) })
}
