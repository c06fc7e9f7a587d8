//! The sums of a Gaussian's pair rows, in one order whatever the ranges of tiles they are made in.
//!
//! The list by Gaussian is cut into chunks of [`CHUNK`] pairs at fixed places. A chunk that lies within one Gaussian is
//! added by units of its own, a column each; the Gaussian's unit adds the pairs before its first such chunk and behind
//! its last, and at the end the chunks. So a unit reads at most `2 CHUNK - 2` pairs and a value for each of the
//! Gaussian's chunks, where a Gaussian over all 8,160 tiles of an image of 1920 x 1080 was one chain of 8,160 reads.

use std::ops::Range;

use cubecl::prelude::*;

use super::attributes::Plan;
use super::gather::MOMENTS;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::error::CubeError;
use crate::cube::intersect::Intersections;

/// Pairs of a chunk: near the square root of the most tiles in use, so that neither the chunk nor the sum of chunks is
/// long.
pub const CHUNK: u32 = 64;

/// The chunks that lie within a Gaussian's pairs `begin..end`.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
struct Chunks {
    first: u32,
    last: u32,
}

#[cube]
fn chunks_within(begin: u32, end: u32) -> Chunks {
    let first = begin.div_ceil(CHUNK);
    let mut last = end / CHUNK;
    if last < first {
        last = first;
    }
    Chunks { first, last }
}

/// How many values the unit of a Gaussian adds whose pairs are `begin..end` of the list by Gaussian: the bound on the
/// longest chain.
pub fn added_by_a_unit(begin: u32, end: u32) -> u32 {
    let Chunks { first, last } = chunks_within(begin, end);
    end - begin - (last - first) * (CHUNK - 1)
}

/// One unit per chunk and column: adds the column over the chunk's pairs in tiles `first_tile..last_tile` to the sums
/// of earlier ranges of tiles, if the chunk is one Gaussian's.
#[cube(launch_unchecked)]
fn chunk_sum_kernel(
    pairs: &[f32],
    gaussian_ids: &[u32],
    positions: &[u32],
    tile_offsets: &[u32],
    chunk_sums: &mut [f32],
    chunks: u32,
    first_tile: u32,
    last_tile: u32,
    #[comptime] row_len: u32,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= (chunks * row_len) as usize {
        terminate!();
    }
    let from = index as u32 / row_len * CHUNK;
    let column = index % row_len as usize;
    let one = gaussian_ids[positions[from as usize] as usize];
    let other = gaussian_ids[positions[(from + CHUNK - 1u32) as usize] as usize];
    if one == other {
        // Pairs behind the last tile's belong to no tile, and their rows are not written.
        let begin = tile_offsets[first_tile as usize];
        let end = tile_offsets[last_tile as usize];
        let mut sum = 0.0f32;
        if first_tile > 0u32 {
            sum = chunk_sums[index];
        }
        for k in 0..CHUNK {
            let position = positions[(from + k) as usize];
            if position >= begin && position < end {
                sum += pairs[(position - begin) as usize * row_len as usize + column];
            }
        }
        chunk_sums[index] = sum;
    }
}

/// One unit per Gaussian and column: adds the column over the Gaussian's pairs outside its chunks in tiles
/// `first_tile..last_tile`, in tile order, to the sums of earlier ranges of tiles, and behind the last range the
/// chunks. Neighbouring units read neighbouring columns of one row.
#[cube(launch_unchecked)]
fn pair_sum_kernel(
    pairs: &[f32],
    gaussian_offsets: &[u32],
    positions: &[u32],
    tile_offsets: &[u32],
    chunk_sums: &[f32],
    sums: &mut [f32],
    count: u32,
    first_tile: u32,
    last_tile: u32,
    with_chunks: u32,
    #[comptime] row_len: u32,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= (count * row_len) as usize {
        terminate!();
    }
    let gaussian = index / row_len as usize;
    let column = index % row_len as usize;
    let begin = tile_offsets[first_tile as usize];
    let end = tile_offsets[last_tile as usize];
    let from = gaussian_offsets[gaussian];
    let to = gaussian_offsets[gaussian + 1];
    let chunks = chunks_within(from, to);
    let some = chunks.last > chunks.first;
    let before = select(some, chunks.first * CHUNK, to);
    let behind = select(some, chunks.last * CHUNK, to);
    let mut sum = 0.0f32;
    if first_tile > 0u32 {
        sum = sums[index];
    }
    let mut k = select(from == before, behind, from);
    while k < to {
        let position = positions[k as usize];
        if position >= begin && position < end {
            sum += pairs[(position - begin) as usize * row_len as usize + column];
        }
        k += 1u32;
        if k == before {
            k = behind;
        }
    }
    if with_chunks != 0u32 {
        for chunk in chunks.first..chunks.last {
            sum += chunk_sums[(chunk * row_len) as usize + column];
        }
    }
    sums[index] = sum;
}

/// The sums that grow from one range of tiles to the next.
pub(super) struct PairSums {
    /// `[N, row]`, complete behind the last range.
    pub sums: Buffer,
    chunk_sums: Buffer,
    chunks: usize,
}

impl PairSums {
    /// Room for the sums; the range that begins with tile 0 sets them.
    pub fn new(client: &Client, plan: &Plan, lists: &Intersections) -> Result<Self, CubeError> {
        let row_len = MOMENTS + plan.blended();
        let chunks = lists.positions.len() / CHUNK as usize;
        Ok(Self {
            sums: Buffer::empty(client, "sums of moments", plan.count * row_len)?,
            chunk_sums: Buffer::empty(client, "sums of moments by chunk", chunks * row_len)?,
            chunks,
        })
    }

    /// Adds the rows of the pairs in `tiles`, one range after the other.
    pub fn add(&self, client: &Client, plan: &Plan, lists: &Intersections, pairs: &Buffer, tiles: Range<usize>) {
        let row_len = MOMENTS + plan.blended();
        let (first_tile, last_tile) = (tiles.start as u32, tiles.end as u32);
        if self.chunks > 0 {
            // SAFETY: the lists hold positions below their own length, as `intersect` made them; `pairs` has a row for
            // each pair of `tiles`, and only these are read.
            unsafe {
                chunk_sum_kernel::launch_unchecked(
                    client,
                    grid_for(self.chunks * row_len),
                    cube_dim(),
                    pairs.arg(),
                    lists.gaussian_ids.arg(),
                    lists.positions.arg(),
                    lists.tile_offsets.arg(),
                    self.chunk_sums.arg(),
                    self.chunks as u32,
                    first_tile,
                    last_tile,
                    row_len as u32,
                );
            }
        }
        if plan.count > 0 {
            // SAFETY: as above; `gaussian_offsets` is `[N + 1]` and ends with the number of positions.
            unsafe {
                pair_sum_kernel::launch_unchecked(
                    client,
                    grid_for(plan.count * row_len),
                    cube_dim(),
                    pairs.arg(),
                    lists.gaussian_offsets.arg(),
                    lists.positions.arg(),
                    lists.tile_offsets.arg(),
                    self.chunk_sums.arg(),
                    self.sums.arg(),
                    plan.count as u32,
                    first_tile,
                    last_tile,
                    u32::from(tiles.end == plan.tiles),
                    row_len as u32,
                );
            }
        }
    }
}
