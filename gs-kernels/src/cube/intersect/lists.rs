//! The lists of a tile's Gaussians and of a Gaussian's tiles.

use cubecl::prelude::*;

use super::spans::{columns_in, ellipse, tile_count_kernel};
use crate::config::tile_grid;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::error::CubeError;
use crate::cube::rows::read_row;
use crate::cube::scan::exclusive_scan;
use crate::cube::sort::sort_pairs;
use crate::rows::PROJECTED;

/// Tiles and the Gaussians that touch them, on the device; see [`crate::cpu::intersect::Intersections`].
#[derive(Clone, Debug)]
pub struct Intersections {
    /// `[tiles + 1]`. For lists with [places](crate::cpu::intersect::Intersections::places), those `[tiles]` follow in the same
    /// buffer, because the backward kernel has no binding left.
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

/// `out[k] = values[order[k]]`.
#[cube(launch)]
fn gather_kernel(values: &[u32], order: &[u32], out: &mut [u32], count: u32) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < count as usize {
        out[index] = values[order[index] as usize];
    }
}

/// One unit per Gaussian in depth order: writes its pairs. `pairs` has three parts of one length: the tile of each pair, the pair's
/// slot in the list by Gaussian, and the Gaussian of each slot.
#[cube(launch)]
fn emit_kernel(
    projected: &[f32],
    opacities: &[f32],
    order: &[u32],
    gaussian_offsets: &[u32],
    emit_offsets: &[u32],
    pairs: &mut [u32],
    count: u32,
    width: f32,
    height: f32,
    tile_columns: u32,
    tiles: u32,
    start_slots: u32,
    start_owners: u32,
) {
    let rank = CUBE_POS * UNITS + UNIT_POS as usize;
    if rank >= count as usize {
        terminate!();
    }
    let gaussian = order[rank];
    let slot = gaussian_offsets[gaussian as usize];
    let room = gaussian_offsets[gaussian as usize + 1] - slot;
    let to = emit_offsets[rank];
    let mut written = 0u32;
    if room > 0u32 {
        let row = read_row(projected, gaussian as usize);
        let ellipse = ellipse(row, opacities[gaussian as usize], height);
        for tile_row in ellipse.rows.first..ellipse.rows.last + 1u32 {
            let columns = columns_in(row, ellipse, tile_row, width, height);
            for column in columns.first..columns.last + 1u32 {
                if written < room {
                    pairs[(to + written) as usize] = tile_row * tile_columns + column;
                    written += 1u32;
                }
            }
        }
    }
    // A compiler may round this kernel and the counting one differently. If a tile is missing now, its pair goes to a tile behind
    // the last, which is never drawn.
    for pair in 0..room {
        if pair >= written {
            pairs[(to + pair) as usize] = tiles;
        }
        pairs[(start_slots + to + pair) as usize] = slot + pair;
        pairs[(start_owners + slot + pair) as usize] = gaussian;
    }
}

/// One unit per tile: finds the offset of its pairs in the sorted list of tiles, by bisection.
#[cube(launch)]
fn tile_offset_kernel(sorted_tiles: &[u32], tile_offsets: &mut [u32], tiles: u32, pairs: u32) {
    let tile = (CUBE_POS * UNITS) as u32 + UNIT_POS;
    if tile > tiles {
        terminate!();
    }
    let mut low = 0u32;
    let mut high = pairs;
    while low < high {
        let middle = low + (high - low) / 2u32;
        if sorted_tiles[middle as usize] < tile {
            low = middle + 1u32;
        } else {
            high = middle;
        }
    }
    tile_offsets[tile as usize] = low;
}

/// One unit per pair in tile order: writes its Gaussian, and its position into the Gaussian's list.
#[cube(launch)]
fn place_kernel(slots: &[u32], owners: &[u32], gaussian_ids: &mut [u32], positions: &mut [u32], pairs: u32) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < pairs as usize {
        let slot = slots[index] as usize;
        gaussian_ids[index] = owners[slot];
        positions[slot] = index as u32;
    }
}

/// Finds all (tile, Gaussian) pairs: `projected` `[N, 8]`, `opacities` `[N]`, `features` `[N, C]`; the twin of
/// [`crate::cpu::intersect::intersect`].
///
/// # Errors
/// When there are 2^31 pairs or more, a buffer would be too large, an image side exceeds 2^20 pixels, or the device fails
/// while the number of pairs is read.
///
/// # Panics
/// When the buffers disagree in length.
pub fn intersect(
    client: &Client,
    projected: &Buffer,
    opacities: &Buffer,
    features: &Buffer,
    width: u32,
    height: u32,
    channels: usize,
) -> Result<Intersections, CubeError> {
    let count = projected.len() / PROJECTED;
    assert_eq!(opacities.len(), count, "opacities must be [N] for {count} projected rows");
    assert_eq!(features.len(), count * channels, "features must be [N, {channels}] for {count} projected rows");
    if width > 1 << 20 || height > 1 << 20 {
        return Err(CubeError::ImageTooLarge { width, height });
    }
    let (columns, rows) = tile_grid(width, height);
    let tiles = columns * rows;
    let (width, height) = (width as f32, height as f32);

    let counts = Buffer::empty(client, "tile counts", count)?;
    let keys = Buffer::empty(client, "depth keys", count)?;
    let ids = Buffer::empty(client, "indices", count)?;
    if count > 0 {
        tile_count_kernel::launch(
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
            width,
            height,
        );
    }
    let gaussian_offsets = exclusive_scan(client, &counts, count + 1)?;
    let (_, order) = sort_pairs(client, keys, ids, u32::BITS)?;
    let counts_in_order = Buffer::empty(client, "tile counts in depth order", count)?;
    if count > 0 {
        let out = counts_in_order.arg();
        gather_kernel::launch(client, grid_for(count), cube_dim(), counts.arg(), order.arg(), out, count as u32);
    }
    let emit_offsets = exclusive_scan(client, &counts_in_order, count)?;

    let pairs = gaussian_offsets.part(count, 1).download::<u32>(client)?[0] as usize;
    if pairs > i32::MAX as usize {
        return Err(CubeError::TooManyIntersections);
    }

    let slab = Buffer::slab(client, "pairs of tile and Gaussian", [pairs; 3])?;
    if pairs > 0 {
        emit_kernel::launch(
            client,
            grid_for(count),
            cube_dim(),
            projected.arg(),
            opacities.arg(),
            order.arg(),
            gaussian_offsets.arg(),
            emit_offsets.arg(),
            slab.whole.arg(),
            count as u32,
            width,
            height,
            columns as u32,
            tiles as u32,
            slab.starts[1] as u32,
            slab.starts[2] as u32,
        );
    }
    let [pair_tiles, slots, owners] = slab.parts;
    let (sorted_tiles, slots) = sort_pairs(client, pair_tiles, slots, u32::BITS - (tiles as u32).leading_zeros())?;

    let tile_offsets = Buffer::empty(client, "tile offsets", tiles + 1)?;
    let tile_arg = tile_offsets.arg();
    let (tile_count, pair_count) = (tiles as u32, pairs as u32);
    tile_offset_kernel::launch(
        client,
        grid_for(tiles + 1),
        cube_dim(),
        sorted_tiles.arg(),
        tile_arg,
        tile_count,
        pair_count,
    );
    let gaussian_ids = Buffer::empty(client, "Gaussians by tile", pairs)?;
    let positions = Buffer::empty(client, "places by Gaussian", pairs)?;
    if pairs > 0 {
        place_kernel::launch(
            client,
            grid_for(pairs),
            cube_dim(),
            slots.arg(),
            owners.arg(),
            gaussian_ids.arg(),
            positions.arg(),
            pair_count,
        );
    }
    Ok(Intersections { tile_offsets, placed: 0, gaussian_ids, gaussian_offsets, positions })
}
