//! Which Gaussian touches which tile, in depth order.
//!
//! The test is exact: the part of the cut-off ellipse inside a row of tiles is convex, so the pixels it can reach in
//! that row are one interval, known in closed form. Gaussians are sorted by depth once, then dealt to the tiles in that
//! order, so no list of (tile, depth) keys is ever sorted.

use rayon::prelude::*;

use crate::config::tile_grid;
use crate::constants::{ALPHA_MIN, FEATURE_MAX, TILE};
use crate::cpu::Real;
use crate::cpu::lanes::{LANES, Lanes};
use crate::cpu::parallel::{CHUNK, Disjoint, prefetch};
use crate::cpu::real::LaneTask;
use crate::cpu::sort::sort_by_key;
use crate::cpu::wide::{Number, Wide};
use crate::rows::{PROJECTED, ProjectedRow};

/// Relative and absolute slack of the cut-off, in units of sigma. Pixels decide exactly; the slack only makes sure that
/// rounding never hides a tile from them.
pub(crate) const SLACK: (f64, f64) = (1e-5, 1e-3);
/// Slack of a pixel bound, pixels.
pub(crate) const PIXEL_SLACK: f64 = 0.02;
/// Pieces of the depth order dealt in parallel; each needs a counter per tile.
const MAX_PIECES: usize = 16;
/// How far ahead memory is fetched while Gaussians are visited in depth order, which is no order in memory.
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
    /// `[M]`: places in `gaussian_ids`, rising for each Gaussian.
    pub positions: Vec<i32>,
    /// Empty when the tiles are those of the image, in order. Otherwise `[tiles]`: which tile of the image each list is
    /// for; a tile of the image may then have several lists, or none (see [`crate::cpu::exposure`]).
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

/// Tiles of one row that a Gaussian touches: columns `first..=last`.
#[derive(Clone, Copy)]
struct Span {
    row: u16,
    first: u16,
    last: u16,
}

/// Spans of a run of Gaussians.
pub(super) struct Spans {
    spans: Vec<Span>,
    /// Per Gaussian of the run: end in `spans`.
    ends: Vec<u32>,
    /// Per Gaussian of the run: number of tiles.
    counts: Vec<u32>,
}

impl Spans {
    /// Number of tiles that Gaussian `k` of the run touches.
    pub(super) fn count(&self, k: usize) -> u32 {
        self.counts[k]
    }

    /// The tiles that Gaussian `k` of the run touches, in a grid of `columns`.
    pub(super) fn tiles(&self, k: usize, columns: usize) -> impl Iterator<Item = usize> + '_ {
        let begin = if k == 0 { 0 } else { self.ends[k - 1] as usize };
        self.spans[begin..self.ends[k] as usize].iter().flat_map(move |span| {
            let row = span.row as usize * columns;
            row + span.first as usize..=row + span.last as usize
        })
    }
}

/// Finds all (tile, Gaussian) pairs.
///
/// `projected` `[N, 8]`, `opacities` `[N]`, `features` `[N, C]`. Left out are culled Gaussians, those whose opacity is
/// below the cut-off or above any number, and those with a feature that is not finite or not below [`FEATURE_MAX`].
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
    assert!(total <= i32::MAX as u64, "{total} tile intersections exceed 2^31");

    let visible: Vec<u32> =
        (0..count as u32).filter(|&i| runs[i as usize / CHUNK].counts[i as usize % CHUNK] > 0).collect();
    let order = sort_by_key(&visible, |i| ProjectedRow::read(projected, i as usize).depth);

    deal(&runs, &order, gaussian_offsets, columns * rows, columns, total as usize)
}

/// Deals the Gaussians to the tiles in `order`. The order is cut into as many pieces as there are threads; each piece
/// knows by a count where its entries begin in every tile, so the result does not depend on the cut.
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
    let (all_ids, all_places) = (Disjoint::new(&mut gaussian_ids), Disjoint::new(&mut positions));
    order.par_chunks(piece_len).zip(pieces.par_iter_mut()).for_each(|(ids, piece)| {
        let mut spans = piece.spans.iter();
        for (k, &i) in ids.iter().enumerate() {
            if let Some(&ahead) = ids.get(k + PREFETCH) {
                prefetch(&gaussian_offsets, ahead as usize);
            }
            let begin = gaussian_offsets[i as usize] as usize;
            let len = gaussian_offsets[i as usize + 1] as usize - begin;
            // SAFETY: each Gaussian is in one piece, and owns this range of positions.
            let places = unsafe { all_places.slice_mut(begin, len) };
            let mut place = 0;
            while place < len {
                let span = spans.next().expect("as many spans as counted");
                let row = span.row as usize * columns;
                for cursor in &mut piece.cursors[row + span.first as usize..=row + span.last as usize] {
                    // SAFETY: the counts of the first pass give every entry a place of its own.
                    let id = unsafe { all_ids.slice_mut(*cursor as usize, 1) };
                    id[0] = i as i32;
                    places[place] = *cursor as i32;
                    place += 1;
                    *cursor += 1;
                }
            }
        }
    });
    Intersections { tile_offsets, gaussian_ids, gaussian_offsets, positions, places: Vec::new() }
}

/// A run of the depth order: its spans, and per tile first their count, then where the next one goes.
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

/// Spans of the Gaussians `members`.
pub(super) fn spans_of<F: Real>(
    members: std::ops::Range<usize>,
    projected: &[F],
    opacities: &[F],
    features: &[F],
    channels: usize,
    size: [u32; 2],
) -> Spans {
    F::with_lanes(FindSpans { members, projected, opacities, features, channels, size })
}

struct FindSpans<'a, F> {
    members: std::ops::Range<usize>,
    projected: &'a [F],
    opacities: &'a [F],
    features: &'a [F],
    channels: usize,
    size: [u32; 2],
}

/// Edges of sixteen ellipses in one row of tiles each, pixels; a lane without any has the right edge left of the left one.
#[derive(Clone, Copy)]
struct Edges<F> {
    left: [F; LANES],
    right: [F; LANES],
}

impl<F: Real> LaneTask<F> for FindSpans<'_, F> {
    type Output = Spans;

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) -> Spans {
        let (first, end) = (self.members.start, self.members.end);
        let mut out = Spans {
            spans: Vec::with_capacity(2 * (end - first)),
            ends: Vec::with_capacity(end - first),
            counts: Vec::with_capacity(end - first),
        };
        let mut edges = Vec::new();
        let mut next = first;
        while next < end {
            let (mut ids, mut count) = ([next; LANES], 0);
            while next < end && count < LANES {
                if self.is_drawn(next) {
                    ids[count] = next;
                    count += 1;
                }
                next += 1;
            }
            if count == 0 {
                break;
            }
            // Lanes behind the last one repeat a Gaussian, and are not looked at.
            let rows = self.edges::<L>(&ids, &mut edges);
            for lane in 0..count {
                let member = ids[lane] - first;
                out.ends.resize(member, out.spans.len() as u32);
                out.counts.resize(member, 0);
                let begin = out.spans.len();
                let (top, bottom) = rows[lane];
                for (edges, row) in edges.iter().zip(top..bottom) {
                    if let Some((first, last)) = pixel_range(edges.left[lane], edges.right[lane], self.size[0]) {
                        let (first, last) = (first / TILE as u32, last / TILE as u32);
                        out.spans.push(Span { row: row as u16, first: first as u16, last: last as u16 });
                    }
                }
                let mut tiles = 0;
                for span in &out.spans[begin..] {
                    tiles += u32::from(span.last - span.first) + 1;
                }
                out.ends.push(out.spans.len() as u32);
                out.counts.push(tiles);
            }
        }
        out.ends.resize(end - first, out.spans.len() as u32);
        out.counts.resize(end - first, 0);
        out
    }
}

impl<F: Real> FindSpans<'_, F> {
    /// Whether Gaussian `id` is drawn at all.
    #[inline(always)]
    fn is_drawn(&self, id: usize) -> bool {
        let (opacity, limit) = (self.opacities[id], F::of(FEATURE_MAX));
        let mut usable = opacity >= F::of(ALPHA_MIN) && opacity.is_finite();
        for feature in &self.features[id * self.channels..][..self.channels] {
            usable &= feature.abs() < limit;
        }
        usable && ProjectedRow::read(self.projected, id).radius > F::ZERO
    }

    /// Edges of the ellipses `d1 (dx + l dy)^2 + d2 dy^2 <= k` about their means, in as many rows of tiles as the tallest
    /// has, each from its own first row on. Returns the rows of tiles of each, `first..end`.
    ///
    /// In a strip of `dy` its rightmost point is where the whole ellipse's rightmost point lies, held inside the strip,
    /// since the right edge is a concave function of `dy`; likewise on the left.
    #[inline(always)]
    fn edges<L: Lanes<Real = F>>(&self, ids: &[usize; LANES], edges: &mut Vec<Edges<F>>) -> [(u32, u32); LANES] {
        let mut columns = [[F::ZERO; LANES]; 6];
        let [x, y, d1, l, d2, k] = &mut columns;
        for lane in 0..LANES {
            let row = ProjectedRow::read(self.projected, ids[lane]);
            [x[lane], y[lane]] = row.mean;
            [d1[lane], l[lane], d2[lane]] = row.conic;
            k[lane] = F::of(2.0) * (self.opacities[ids[lane]] / F::of(ALPHA_MIN)).ln();
        }
        let [x, y, d1, l, d2] = [Wide::<L>::load(x), Wide::load(y), Wide::load(d1), Wide::load(l), Wide::load(d2)];
        let k = Wide::load(k) * Wide::of(1.0 + SLACK.0) + Wide::of(SLACK.1);
        let reach = (k / d2).sqrt();
        // dy of the rightmost point: Cxy / sqrt(Cxx) sqrt(k), with Cxy = -l / d2 and Cxx = 1 / d1 + l^2 / d2.
        let turn = -(l / d2) * (k / (Wide::of(1.0) / d1 + l * l / d2)).sqrt();

        let (low, high) = ((y - reach).0.to_array(), (y + reach).0.to_array());
        let (mut rows, mut tallest, mut starts) = ([(0, 0); LANES], 0, [F::ZERO; LANES]);
        for lane in 0..LANES {
            if let Some((first, last)) = pixel_range(low[lane], high[lane], self.size[1]) {
                rows[lane] = (first / TILE as u32, last / TILE as u32 + 1);
                starts[lane] = F::of(rows[lane].0.into());
                tallest = tallest.max(rows[lane].1 - rows[lane].0);
            }
        }
        let tile = Wide::<L>::of(TILE as f64);
        let (half, end) = (Wide::of(0.5), Wide::<L>::of(f64::from(self.size[1]) - 0.5));
        let starts = Wide::load(&starts);
        edges.clear();
        for step in 0..tallest {
            let top = (starts + Wide::of(step.into())) * tile + half;
            let bottom = Wide(((top + tile - Wide::of(1.0)).0).min(end.0));
            let low = Wide((top - y).0.max((-reach).0));
            let high = Wide((bottom - y).0.min(reach.0));
            let empty = low.above(high + Wide::of(PIXEL_SLACK));
            let left_dy = Wide((-turn).0.max(low.0).min(high.0));
            let right_dy = Wide(turn.0.max(low.0).min(high.0));
            let left = x + (-half_width(k, d1, d2, left_dy) - l * left_dy);
            let right = x + (half_width(k, d1, d2, right_dy) - l * right_dy);
            let mut found = Edges { left: [F::ZERO; LANES], right: [F::ZERO; LANES] };
            left.0.store(&mut found.left);
            Wide::select(empty, left - Wide::of(1.0), right).0.store(&mut found.right);
            edges.push(found);
        }
        rows
    }
}

/// Half the width of the ellipse at `dy`.
#[inline(always)]
fn half_width<L: Lanes>(k: Wide<L>, d1: Wide<L>, d2: Wide<L>, dy: Wide<L>) -> Wide<L> {
    ((k - d2 * dy * dy).max(Wide::of(0.0)) / d1).sqrt()
}

/// Pixels whose centres lie in `low..=high`, with slack, inside an image of `size` pixels.
#[inline(always)]
fn pixel_range<F: Real>(low: F, high: F, size: u32) -> Option<(u32, u32)> {
    // NaN or an empty range fails this comparison.
    let ordered = low <= high;
    if !ordered {
        return None;
    }
    let slack = F::of(PIXEL_SLACK + 0.5);
    let last_pixel = size as i32 - 1;
    let first = (-((slack - low).floor_i32())).max(0);
    let last = (high + slack - F::ONE).floor_i32().min(last_pixel);
    (first <= last_pixel && last >= 0 && first <= last).then_some((first as u32, last as u32))
}
