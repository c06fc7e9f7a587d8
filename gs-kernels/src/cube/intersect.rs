//! Which Gaussian touches which tile, in depth order.
//!
//! The test is the exact one of [`crate::cpu::intersect`]: in a row of tiles the part of the cut-off ellipse is convex,
//! so the pixels it can reach there are one interval. Steps: count the tiles of every Gaussian; sort the Gaussians by
//! depth (stable, so that ties keep their index order); emit their pairs in that order; sort the pairs by tile (stable
//! again, so that a tile's list is in depth order); find where each tile begins. One number is read back, the number of
//! pairs, because it sizes the buffers.

use cubecl::prelude::*;

use crate::config::tile_grid;
use crate::constants;
use crate::constants::TILE;
use crate::cpu::intersect::{PIXEL_SLACK, SLACK};
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::error::CubeError;
use crate::cube::math::finite;
use crate::cube::rows::{DeviceRow, read_row};
use crate::cube::scan::exclusive_scan;
use crate::cube::sort::sort_pairs;
use crate::rows::PROJECTED;

const ALPHA_MIN: f32 = constants::ALPHA_MIN as f32;
const FEATURE_MAX: f32 = constants::FEATURE_MAX as f32;
const SLACK_FACTOR: f32 = (1.0 + SLACK.0) as f32;
const SLACK_OFFSET: f32 = SLACK.1 as f32;
const STRIP_SLACK: f32 = PIXEL_SLACK as f32;
const CENTRE_SLACK: f32 = (PIXEL_SLACK + 0.5) as f32;
const EDGE: f32 = TILE as f32;
const TILE_U32: u32 = TILE as u32;

/// Sorts behind every depth.
const NO_DEPTH: u32 = u32::MAX;

/// Tiles and the Gaussians that touch them, on the device; see [`crate::cpu::intersect::Intersections`].
#[derive(Clone, Debug)]
pub struct Intersections {
    /// `[tiles + 1]`; where the lists have [places](crate::cpu::intersect::Intersections::places), those `[tiles]` follow
    /// in the same buffer, because the backward kernel has no binding left.
    pub tile_offsets: Buffer,
    /// Number of lists with a place; 0 when the tiles are those of the image in order.
    pub placed: usize,
    /// `[M]`, by tile, then depth, then index.
    pub gaussian_ids: Buffer,
    /// `[N + 1]`
    pub gaussian_offsets: Buffer,
    /// `[M]`, by Gaussian.
    pub positions: Buffer,
}

/// Pixels or tiles `first..=last`; none when `first > last`.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
struct Range {
    first: u32,
    last: u32,
}

/// Tiles whose pixel centres can lie in `low..=high`, with slack, along a side of `size` pixels.
#[cube]
fn tile_range(low: f32, high: f32, size: f32) -> Range {
    let first = (low - CENTRE_SLACK).ceil();
    let last = (high + CENTRE_SLACK - 1.0f32).floor();
    let some = finite(low) && finite(high) && low <= high && first < size && last >= 0.0f32 && first <= last;
    let first = select(some && first > 0.0f32, first, 0.0f32);
    let last = select(some && last >= 0.0f32, select(last < size - 1.0f32, last, size - 1.0f32), 0.0f32);
    Range {
        first: select(some, u32::cast_from(first) / TILE_U32, 1u32),
        last: select(some, u32::cast_from(last) / TILE_U32, 0u32),
    }
}

/// The cut-off ellipse `d1 (dx + l dy)^2 + d2 dy^2 <= k` about the mean and the tile rows it spans.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
struct Ellipse {
    k: f32,
    reach_y: f32,
    /// `dy` of the rightmost point.
    turn: f32,
    rows: Range,
}

#[cube]
fn ellipse(row: DeviceRow, opacity: f32, height: f32) -> Ellipse {
    let k = 2.0f32 * (opacity / ALPHA_MIN).ln() * SLACK_FACTOR + SLACK_OFFSET;
    let reach_y = (k / row.d2).sqrt();
    // Cxy / sqrt(Cxx) sqrt(k), with Cxy = -l / d2 and Cxx = 1 / d1 + l^2 / d2.
    let cxx = 1.0f32 / row.d1 + row.l * row.l / row.d2;
    let turn = -(row.l / row.d2) * (k / cxx).sqrt();
    Ellipse { k, reach_y, turn, rows: tile_range(row.mean_y - reach_y, row.mean_y + reach_y, height) }
}

/// Right end, as `dx`, of the ellipse at `dy` (`side` 1) or its left end (`side` -1).
#[cube]
fn edge(row: DeviceRow, k: f32, dy: f32, side: f32) -> f32 {
    let rest = k - row.d2 * dy * dy;
    let rest = select(rest > 0.0f32, rest, 0.0f32) / row.d1;
    side * rest.sqrt() - row.l * dy
}

/// Columns of tiles that the ellipse touches in tile row `tile_row`. In the strip its rightmost point is where the whole
/// ellipse's rightmost point lies, held inside the strip; likewise on the left.
#[cube]
fn columns_in(row: DeviceRow, ellipse: Ellipse, tile_row: u32, width: f32, height: f32) -> Range {
    let top = f32::cast_from(tile_row) * EDGE + 0.5f32;
    let below = top + EDGE - 1.0f32;
    let bottom = select(below < height - 0.5f32, below, height - 0.5f32);
    let reach = ellipse.reach_y;
    let low = select(top - row.mean_y > -reach, top - row.mean_y, -reach);
    let high = select(bottom - row.mean_y < reach, bottom - row.mean_y, reach);
    let right_at = held(ellipse.turn, low, high);
    let left_at = held(-ellipse.turn, low, high);
    let left = row.mean_x + edge(row, ellipse.k, left_at, -1.0f32);
    let right = row.mean_x + edge(row, ellipse.k, right_at, 1.0f32);
    let range = tile_range(left, right, width);
    let touched = low <= high + STRIP_SLACK;
    Range { first: select(touched, range.first, 1u32), last: select(touched, range.last, 0u32) }
}

/// `value` raised to `low`, then lowered to `high`, as the other twin does it.
#[cube]
fn held(value: f32, low: f32, high: f32) -> f32 {
    let raised = select(value > low, value, low);
    select(raised < high, raised, high)
}

/// One unit a Gaussian: counts its tiles and writes its depth as a key that sorts as an unsigned number.
#[cube(launch)]
fn tile_count_kernel(
    projected: &[f32],
    opacities: &[f32],
    features: &[f32],
    counts: &mut [u32],
    keys: &mut [u32],
    ids: &mut [u32],
    count: u32,
    channels: u32,
    width: f32,
    height: f32,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= count as usize {
        terminate!();
    }
    let row = read_row(projected, index);
    let opacity = opacities[index];
    let mut usable =
        finite(row.radius) && row.radius > 0.0f32 && finite(opacity) && opacity >= ALPHA_MIN && finite(row.depth);
    let base = index * channels as usize;
    for channel in 0..channels {
        let feature = features[base + channel as usize];
        usable = usable && finite(feature) && feature.abs() < FEATURE_MAX;
    }
    let mut tiles = 0u32;
    if usable {
        let ellipse = ellipse(row, opacity, height);
        for tile_row in ellipse.rows.first..ellipse.rows.last + 1u32 {
            let columns = columns_in(row, ellipse, tile_row, width, height);
            tiles += columns.last + 1u32 - columns.first;
        }
    }
    counts[index] = tiles;
    let bits = u32::reinterpret(row.depth);
    let sign = bits >> 31u32;
    let ordered = select(sign == 0u32, bits | 0x8000_0000u32, !bits);
    keys[index] = select(tiles > 0u32, ordered, NO_DEPTH.runtime());
    ids[index] = index as u32;
}

/// `out[k] = values[order[k]]`.
#[cube(launch)]
fn gather_kernel(values: &[u32], order: &[u32], out: &mut [u32], count: u32) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < count as usize {
        out[index] = values[order[index] as usize];
    }
}

/// One unit: `out[0] = values[at]`, so that a single number is read back.
#[cube(launch)]
fn pick_kernel(values: &[u32], out: &mut [u32], at: u32) {
    if CUBE_POS == 0 && UNIT_POS == 0 {
        out[0] = values[at as usize];
    }
}

/// One unit a Gaussian in depth order: writes its pairs. `pairs` has three parts of one length: the tile of each pair,
/// the pair's slot in the list by Gaussian, and the Gaussian of each slot.
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
    // A compiler may round this kernel and the counting one differently. Should a tile be missing now, its pair goes to
    // a tile behind the last, which nobody draws.
    for pair in 0..room {
        if pair >= written {
            pairs[(to + pair) as usize] = tiles;
        }
        pairs[(start_slots + to + pair) as usize] = slot + pair;
        pairs[(start_owners + slot + pair) as usize] = gaussian;
    }
}

/// One unit a tile: where its pairs begin in the sorted list of tiles, by bisection.
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

/// One unit a pair in tile order: writes its Gaussian, and its place into the Gaussian's list.
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

    let total = Buffer::empty(client, "number of pairs", 1)?;
    pick_kernel::launch(client, grid_for(1), cube_dim(), gaussian_offsets.arg(), total.arg(), count as u32);
    let pairs = total.download::<u32>(client)?[0] as usize;
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
