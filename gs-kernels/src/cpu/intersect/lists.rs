//! The lists of a tile's Gaussians and of a Gaussian's tiles.

use rayon::prelude::*;

use super::spans::{Span, Spans, spans_of};
use crate::config::tile_grid;
use crate::cpu::Real;
use crate::cpu::parallel::{CHUNK, Disjoint, prefetch};
use crate::cpu::sort::sort_by_key;
use crate::limits;
use crate::rows::{PROJECTED, ProjectedRow};

/// Largest number of pieces of the depth order that are distributed in parallel; each needs a counter per tile.
const MAX_PIECES: usize = 16;
/// Prefetch distance while Gaussians are visited in depth order, which is random in memory.
const PREFETCH: usize = 8;

/// Tiles and the Gaussians that touch them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Intersections {
    /// `[tiles + 1]`: tile `t` (row-major) owns `gaussian_ids[tile_offsets[t]..tile_offsets[t + 1]]`.
    pub tile_offsets: Vec<i32>,
    /// `[M]`, by tile, then depth, then index.
    pub gaussian_ids: Vec<i32>,
    /// `[N + 1]`: Gaussian `g` owns `positions[gaussian_offsets[g]..gaussian_offsets[g + 1]]`.
    pub gaussian_offsets: Vec<i32>,
    /// `[M]`: positions in `gaussian_ids`, ascending for each Gaussian.
    pub positions: Vec<i32>,
    /// Empty if the tiles are those of the image, in order. Otherwise `[tiles]`: the image's tile of each list; a tile
    /// of the image may then have several lists, or none (see [`crate::cpu::exposure`]).
    pub places: Vec<i32>,
}

/// Borrowed [`Intersections`].
#[derive(Clone, Copy, Debug)]
pub struct IntersectionSlices<'a> {
    /// See [`Intersections::tile_offsets`].
    pub tile_offsets: &'a [i32],
    /// See [`Intersections::gaussian_ids`].
    pub gaussian_ids: &'a [i32],
    /// See [`Intersections::gaussian_offsets`].
    pub gaussian_offsets: &'a [i32],
    /// See [`Intersections::positions`].
    pub positions: &'a [i32],
    /// See [`Intersections::places`].
    pub places: &'a [i32],
}

impl Intersections {
    /// Borrows all lists.
    pub fn as_slices(&self) -> IntersectionSlices<'_> {
        IntersectionSlices {
            tile_offsets: &self.tile_offsets,
            gaussian_ids: &self.gaussian_ids,
            gaussian_offsets: &self.gaussian_offsets,
            positions: &self.positions,
            places: &self.places,
        }
    }
}

/// Finds all (tile, Gaussian) pairs.
///
/// `projected` `[N, 8]`, `opacities` `[N]`, `features` `[N, C]`. Left out are culled Gaussians, those whose opacity is
/// below the cut-off or infinite, and those with a feature that is not finite or not below
/// [`FEATURE_MAX`](crate::constants::FEATURE_MAX).
///
/// # Panics
/// When the slices disagree in length, when an image side exceeds 2^20 pixels, or when there are more than 2^31 pairs
/// (16 GB of lists).
pub fn intersect<F: Real>(
    projected: &[F],
    opacities: &[F],
    features: &[F],
    width: u32,
    height: u32,
    channels: usize,
) -> Intersections {
    let count = projected.len() / PROJECTED;
    assert_eq!(opacities.len(), count, "opacities must be [N] for {count} projected rows");
    assert_eq!(features.len(), count * channels, "features must be [N, {channels}] for {count} projected rows");
    assert!(width <= 1 << 20 && height <= 1 << 20, "image of {width}x{height} pixels is beyond 2^20 a side");
    let (columns, rows) = tile_grid(width, height);

    let runs: Vec<Spans> = (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|run| {
            let members = run * CHUNK..((run + 1) * CHUNK).min(count);
            spans_of(members, projected, opacities, features, channels, [width, height])
        })
        .collect();

    let mut gaussian_offsets = Vec::with_capacity(count + 1);
    gaussian_offsets.push(0);
    let mut total = 0_u64;
    for n in runs.iter().flat_map(|run| &run.counts) {
        total += u64::from(*n);
        gaussian_offsets.push(total as i32);
    }
    assert!(total <= i32::MAX as u64, "{}", limits::too_many_pairs(Some(total)));

    let visible: Vec<u32> =
        (0..count as u32).filter(|&i| runs[i as usize / CHUNK].counts[i as usize % CHUNK] > 0).collect();
    let order = sort_by_key(&visible, |i| ProjectedRow::read(projected, i as usize).depth);

    deal(&runs, &order, gaussian_offsets, columns * rows, columns, total as usize)
}

/// Distributes the Gaussians to the tiles in `order`. The order is cut into as many pieces as there are threads; counts
/// give the offset of each piece's entries in every tile, so the result does not depend on the cut.
fn deal(
    runs: &[Spans],
    order: &[u32],
    gaussian_offsets: Vec<i32>,
    tiles: usize,
    columns: usize,
    total: usize,
) -> Intersections {
    let piece_len = order.len().div_ceil(rayon::current_num_threads().min(MAX_PIECES)).max(1);
    let mut pieces: Vec<Piece> =
        order.par_chunks(piece_len).map(|ids| Piece::count(runs, ids, tiles, columns)).collect();

    let mut tile_offsets = Vec::with_capacity(tiles + 1);
    let mut sum = 0_u32;
    for tile in 0..tiles {
        tile_offsets.push(sum as i32);
        for piece in &mut pieces {
            sum += std::mem::replace(&mut piece.cursors[tile], sum);
        }
    }
    tile_offsets.push(sum as i32);

    let mut gaussian_ids = vec![0_i32; total];
    let mut positions = vec![0_i32; total];
    let (all_ids, all_positions) = (Disjoint::new(&mut gaussian_ids), Disjoint::new(&mut positions));
    order.par_chunks(piece_len).zip(pieces.par_iter_mut()).for_each(|(ids, piece)| {
        let mut spans = piece.spans.iter();
        for (k, &i) in ids.iter().enumerate() {
            if let Some(&ahead) = ids.get(k + PREFETCH) {
                prefetch(&gaussian_offsets, ahead as usize);
            }
            let begin = gaussian_offsets[i as usize] as usize;
            let len = gaussian_offsets[i as usize + 1] as usize - begin;
            // SAFETY: each Gaussian is in one piece, and owns this range of positions.
            let own_positions = unsafe { all_positions.slice_mut(begin, len) };
            let mut filled = 0;
            while filled < len {
                let span = spans.next().expect("as many spans as counted");
                let row = span.row as usize * columns;
                for cursor in &mut piece.cursors[row + span.first as usize..=row + span.last as usize] {
                    // SAFETY: the counts of the first pass give every entry a position of its own.
                    let id = unsafe { all_ids.slice_mut(*cursor as usize, 1) };
                    id[0] = i as i32;
                    own_positions[filled] = *cursor as i32;
                    filled += 1;
                    *cursor += 1;
                }
            }
        }
    });
    Intersections { tile_offsets, gaussian_ids, gaussian_offsets, positions, places: Vec::new() }
}

/// A run of the depth order: its spans, and per tile first their count, then the position of the next one.
struct Piece {
    spans: Vec<Span>,
    cursors: Vec<u32>,
}

impl Piece {
    fn count(runs: &[Spans], ids: &[u32], tiles: usize, columns: usize) -> Self {
        let mut piece = Self { spans: Vec::with_capacity(2 * ids.len()), cursors: vec![0; tiles] };
        for (k, &i) in ids.iter().enumerate() {
            if let Some(&ahead) = ids.get(k + PREFETCH) {
                prefetch(&runs[ahead as usize / CHUNK].ends, ahead as usize % CHUNK);
            }
            if let Some(&ahead) = ids.get(k + PREFETCH / 2) {
                prefetch(spans(runs, ahead), 0);
            }
            for span in spans(runs, i) {
                let row = span.row as usize * columns;
                piece.cursors[row + span.first as usize..=row + span.last as usize].iter_mut().for_each(|n| *n += 1);
                piece.spans.push(*span);
            }
        }
        piece
    }
}

fn spans(runs: &[Spans], i: u32) -> &[Span] {
    let (run, k) = (&runs[i as usize / CHUNK], i as usize % CHUNK);
    let begin = if k == 0 { 0 } else { run.ends[k - 1] as usize };
    &run.spans[begin..run.ends[k] as usize]
}
