//! One exposure: the scene at several instants, with the work for static Gaussians done once.
//!
//! Rows are one table: the whole scene at the first instant `[N]`, then for every further instant the rows that move,
//! `[M]` each. [`intersect_instants`] lists the Gaussians of the image's tiles at the first instant, and adds a list
//! for every tile that looks different at another one; [`crate::cpu::rasterize`] draws all these tiles; [`average`]
//! averages them. A list equals that of the whole scene at its instant, in the same order, so a tile equals that of a
//! separate rendering, bit for bit.

use rayon::prelude::*;

use crate::config::{AverageConfig, tile_grid};
use crate::constants::TILE;
use crate::cpu::Real;
use crate::cpu::intersect::{Intersections, intersect, spans_of};
use crate::cpu::light::{to_encoded, to_encoded_slope, to_linear, to_linear_slope};
use crate::cpu::parallel::{Disjoint, zeros};
use crate::cpu::sort::sort_by_key;
use crate::limits;
use crate::rows::{PROJECTED, ProjectedRow};

/// The drawn tiles of each tile of the image, and the number of instants for which each stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileShares {
    /// Number of instants; 1 if nothing moves, because the table then has no rows of further instants.
    pub instants: usize,
    /// `[grid + 1]`: tile `t` of the image is shown by tile `t` and by the tiles
    /// `grid + extra_offsets[t]..grid + extra_offsets[t + 1]`.
    pub extra_offsets: Vec<u32>,
    /// `[tiles]`: number of instants at which the image shows this tile. The counts of one tile of the image add up to
    /// `instants`.
    pub counts: Vec<u32>,
}

impl TileShares {
    /// A single instant: the image's tiles, of `tiles` drawn in all.
    pub fn first_only(grid: usize, tiles: usize) -> Self {
        let mut counts = vec![0; tiles];
        counts[..grid].fill(1);
        Self { instants: 1, extra_offsets: vec![0; grid + 1], counts }
    }

    /// From their numbers: `grid + 1` offsets, then the counts.
    ///
    /// # Panics
    /// When there are fewer than `2 grid + 1` numbers.
    pub fn of_numbers(numbers: &[i32], grid: usize, instants: usize) -> Self {
        assert!(numbers.len() > 2 * grid, "shares must count each of {grid} tiles of the image");
        let unsigned = |numbers: &[i32]| numbers.iter().map(|number| *number as u32).collect();
        let (extra_offsets, counts) = numbers.split_at(grid + 1);
        Self { instants, extra_offsets: unsigned(extra_offsets), counts: unsigned(counts) }
    }

    /// Their numbers, as [`of_numbers`](Self::of_numbers) takes them.
    pub fn numbers(&self) -> Vec<i32> {
        self.extra_offsets.iter().chain(&self.counts).map(|number| *number as i32).collect()
    }

    /// Tiles drawn.
    pub fn tiles(&self) -> usize {
        self.counts.len()
    }

    /// Tiles of the image.
    pub fn grid(&self) -> usize {
        self.extra_offsets.len() - 1
    }

    /// The further tiles that show tile `tile` of the image.
    fn extras(&self, tile: usize) -> std::ops::Range<usize> {
        let first = self.grid();
        first + self.extra_offsets[tile] as usize..first + self.extra_offsets[tile + 1] as usize
    }
}

/// The moving rows of one instant by tile.
struct MovingRows {
    /// `[grid + 1]`
    offsets: Vec<u32>,
    /// Rows of the table, by tile, then depth, then index.
    rows: Vec<u32>,
}

impl MovingRows {
    fn find<F: Real>(
        first: usize,
        count: usize,
        projected: &[F],
        opacities: &[F],
        features: &[F],
        channels: usize,
        size: [u32; 2],
    ) -> Self {
        let (columns, rows) = tile_grid(size[0], size[1]);
        let spans = spans_of(first..first + count, projected, opacities, features, channels, size);
        let visible: Vec<u32> = (0..count as u32).filter(|&k| spans.count(k as usize) > 0).collect();
        let order = sort_by_key(&visible, |k| ProjectedRow::read(projected, first + k as usize).depth);
        let mut offsets = vec![0_u32; columns * rows + 1];
        for &k in &order {
            spans.tiles(k as usize, columns).for_each(|tile| offsets[tile + 1] += 1);
        }
        (0..columns * rows).for_each(|tile| offsets[tile + 1] += offsets[tile]);
        let mut cursors = offsets.clone();
        let mut rows = vec![0; offsets[offsets.len() - 1] as usize];
        for &k in &order {
            for tile in spans.tiles(k as usize, columns) {
                rows[cursors[tile] as usize] = first as u32 + k;
                cursors[tile] += 1;
            }
        }
        Self { offsets, rows }
    }

    fn of(&self, tile: usize) -> &[u32] {
        &self.rows[self.offsets[tile] as usize..self.offsets[tile + 1] as usize]
    }
}

/// A tile drawn in addition to those of the first instant: at one further instant, or without moving rows for `None`.
#[derive(Clone, Copy)]
struct Extra {
    tile: usize,
    instant: Option<usize>,
}

/// Lists for all instants of a table of rows: `scene` rows at the first, then the rows `moving` at each further one.
///
/// `projected` `[R, 8]`, `opacities` `[R]`, `features` `[R, C]`, `moving` ascending numbers below `scene`; `R = scene +
/// instants * M`. The first lists are those of the image's tiles at the first instant. A tile of the image has one more
/// for each further instant at which a moving row touches it. If one touches it at the first instant, it also has a
/// list without moving rows, for all the instants at which none does. Leaves out the same rows as [`intersect`].
///
/// # Panics
/// When the slices disagree in length, `moving` does not ascend, and on the conditions of [`intersect`].
pub fn intersect_instants<F: Real>(
    projected: &[F],
    opacities: &[F],
    features: &[F],
    width: u32,
    height: u32,
    channels: usize,
    scene: usize,
    moving: &[u32],
) -> (Intersections, TileShares) {
    let (count, moving_count) = (opacities.len(), moving.len());
    assert!(moving.is_sorted_by(|a, b| a < b), "the numbers of what moves must rise");
    assert!(moving.last().is_none_or(|&last| (last as usize) < scene), "what moves must be among {scene} Gaussians");
    assert!(
        count >= scene && (count - scene).is_multiple_of(moving_count.max(1)),
        "rows must be [scene + instants * moving]"
    );
    let further = (count - scene).checked_div(moving_count).unwrap_or(0);
    let (columns, rows) = tile_grid(width, height);
    let grid = columns * rows;

    let first = intersect(
        &projected[..scene * PROJECTED],
        &opacities[..scene],
        &features[..scene * channels],
        width,
        height,
        channels,
    );
    let instants: Vec<MovingRows> = (0..further)
        .into_par_iter()
        .map(|k| {
            let begin = scene + k * moving_count;
            MovingRows::find(begin, moving_count, projected, opacities, features, channels, [width, height])
        })
        .collect();

    let mut moves = vec![false; scene];
    moving.iter().for_each(|&row| moves[row as usize] = true);
    let first_moves: Vec<bool> =
        (0..grid).into_par_iter().map(|tile| of_tile(&first, tile).iter().any(|&id| moves[id as usize])).collect();
    let (extras, shares) = extras(&instants, &first_moves);

    // By depth, then by number in the scene, as in a list of the whole scene.
    let key = |row: usize| {
        let number = if row < scene { row } else { moving[(row - scene) % moving_count] as usize };
        (ProjectedRow::read(projected, row).depth, number)
    };
    let merged: Vec<Vec<i32>> = extras
        .par_iter()
        .map(|extra| {
            let static_rows = of_tile(&first, extra.tile).iter().copied().filter(|&id| !moves[id as usize]);
            let moving_rows = extra.instant.map_or(&[][..], |k| instants[k].of(extra.tile));
            merge(static_rows, moving_rows, |static_row, moving_row| {
                key(static_row as usize) < key(moving_row as usize)
            })
        })
        .collect();
    (append(first, count, grid, &extras, &merged), shares)
}

fn of_tile(lists: &Intersections, tile: usize) -> &[i32] {
    &lists.gaussian_ids[lists.tile_offsets[tile] as usize..lists.tile_offsets[tile + 1] as usize]
}

/// The tiles drawn in addition to those of the first instant.
fn extras(instants: &[MovingRows], first_moves: &[bool]) -> (Vec<Extra>, TileShares) {
    let grid = first_moves.len();
    let mut extras = Vec::new();
    let mut counts = vec![1_u32; grid];
    let mut extra_offsets = vec![0_u32];
    for (tile, &first_moves) in first_moves.iter().enumerate() {
        let moved = instants.iter().filter(|rows| !rows.of(tile).is_empty()).count();
        let unmoved = (instants.len() - moved) as u32;
        if !first_moves {
            counts[tile] += unmoved;
        } else if unmoved > 0 {
            extras.push(Extra { tile, instant: None });
            counts.push(unmoved);
        }
        if moved > 0 {
            let touching = (0..instants.len()).filter(|&k| !instants[k].of(tile).is_empty());
            extras.extend(touching.map(|k| Extra { tile, instant: Some(k) }));
            counts.resize(grid + extras.len(), 1);
        }
        extra_offsets.push(extras.len() as u32);
    }
    (extras, TileShares { instants: instants.len() + 1, extra_offsets, counts })
}

/// Merges two sorted lists; `before` says whether an entry of the first comes before one of the second.
fn merge(static_rows: impl Iterator<Item = i32>, moving_rows: &[u32], before: impl Fn(i32, u32) -> bool) -> Vec<i32> {
    let mut merged = Vec::new();
    let mut moving_rows = moving_rows.iter().copied().peekable();
    for id in static_rows {
        while let Some(moving_row) = moving_rows.next_if(|&moving_row| !before(id, moving_row)) {
            merged.push(moving_row as i32);
        }
        merged.push(id);
    }
    merged.extend(moving_rows.map(|moving_row| moving_row as i32));
    merged
}

/// The lists of the first instant followed by those of the `extras`, for a table of `count` rows.
fn append(first: Intersections, count: usize, grid: usize, extras: &[Extra], merged: &[Vec<i32>]) -> Intersections {
    let Intersections { mut tile_offsets, mut gaussian_ids, gaussian_offsets, positions, .. } = first;
    let (scene, pairs) = (gaussian_offsets.len() - 1, gaussian_ids.len());
    let total = pairs + merged.iter().map(Vec::len).sum::<usize>();
    assert!(total <= i32::MAX as usize, "{}", limits::too_many_pairs(Some(total as u64)));
    gaussian_ids.reserve_exact(total - pairs);
    for list in merged {
        gaussian_ids.extend(list);
        tile_offsets.push(gaussian_ids.len() as i32);
    }

    let mut counts = vec![0_i32; count];
    counts.iter_mut().zip(gaussian_offsets.windows(2)).for_each(|(count, ends)| *count = ends[1] - ends[0]);
    gaussian_ids[pairs..].iter().for_each(|&id| counts[id as usize] += 1);
    let mut offsets = Vec::with_capacity(count + 1);
    offsets.push(0);
    let mut sum = 0;
    offsets.extend(counts.iter().map(|&count| {
        sum += count;
        sum
    }));
    let mut all_positions = vec![0; total];
    let mut cursors = offsets[..count].to_vec();
    for (id, cursor) in cursors[..scene].iter_mut().enumerate() {
        let own = &positions[gaussian_offsets[id] as usize..gaussian_offsets[id + 1] as usize];
        all_positions[*cursor as usize..][..own.len()].copy_from_slice(own);
        *cursor += own.len() as i32;
    }
    for (position, &id) in gaussian_ids.iter().enumerate().skip(pairs) {
        let cursor = &mut cursors[id as usize];
        all_positions[*cursor as usize] = position as i32;
        *cursor += 1;
    }
    let places = (0..grid).chain(extras.iter().map(|extra| extra.tile)).map(|tile| tile as i32).collect();
    Intersections { tile_offsets, gaussian_ids, gaussian_offsets: offsets, positions: all_positions, places }
}

/// The mean image `[H, W, C]` over all instants, from the drawn tiles, `[tiles, 16, 16, C]`.
///
/// The first [`AverageConfig::encoded`] channels are averaged as light, the others as they are. A tile of the image
/// with a single drawn tile is copied.
///
/// # Panics
/// When the slices disagree in length.
pub fn average<F: Real>(config: &AverageConfig, shares: &TileShares, tiles: &[F]) -> Vec<F> {
    let walk = Walk::new(config, shares, tiles.len());
    let mut image = zeros(walk.values());
    let pixels = Disjoint::new(&mut image);
    (0..shares.grid()).into_par_iter().for_each(|tile| {
        let extras = shares.extras(tile);
        walk.rows(tile, |row, from, to, len| {
            // SAFETY: this row of this tile belongs to no other task.
            let out = unsafe { pixels.slice_mut(to, len) };
            if extras.is_empty() {
                out.copy_from_slice(&tiles[from..from + len]);
                return;
            }
            for (k, out) in out.iter_mut().enumerate() {
                let encoded = walk.is_encoded(k);
                let mean = walk.mean(tile, &extras, row, k, tiles, encoded);
                *out = if encoded { to_encoded(mean) } else { mean };
            }
        });
    });
    image
}

/// Backward of [`average`] from `v_image` `[H, W, C]`: the gradient with respect to the tiles, zero in pixels outside
/// the image.
///
/// # Panics
/// When the slices disagree in length.
pub fn average_backward<F: Real>(config: &AverageConfig, shares: &TileShares, tiles: &[F], v_image: &[F]) -> Vec<F> {
    let walk = Walk::new(config, shares, tiles.len());
    assert_eq!(v_image.len(), walk.values(), "v_image must be [H, W, C]");
    let mut v_tiles = zeros(tiles.len());
    let out = Disjoint::new(&mut v_tiles);
    let instants = F::of(shares.instants as f64);
    (0..shares.grid()).into_par_iter().for_each(|tile| {
        let extras = shares.extras(tile);
        walk.rows(tile, |row, from, to, len| {
            let v = &v_image[to..to + len];
            if extras.is_empty() {
                // SAFETY: a drawn tile belongs to one tile of the image, which is one task.
                let out = unsafe { out.slice_mut(from, len) };
                out.copy_from_slice(v);
                return;
            }
            for (k, &v) in v.iter().enumerate() {
                let encoded = walk.is_encoded(k);
                let mut v = v / instants;
                if encoded {
                    let mean = walk.mean(tile, &extras, row, k, tiles, true);
                    v *= to_encoded_slope(mean, to_encoded(mean));
                }
                for drawn in std::iter::once(tile).chain(extras.clone()) {
                    let at = walk.value(drawn, row) + k;
                    let share = F::of(shares.counts[drawn].into()) * v;
                    let slope = if encoded { to_linear_slope(tiles[at], to_linear(tiles[at])) } else { F::ONE };
                    // SAFETY: as above.
                    let out = unsafe { out.slice_mut(at, 1) };
                    out[0] = share * slope;
                }
            }
        });
    });
    v_tiles
}

/// The offsets of the pixels of tiles.
struct Walk<'a> {
    config: &'a AverageConfig,
    shares: &'a TileShares,
    columns: usize,
}

impl<'a> Walk<'a> {
    fn new(config: &'a AverageConfig, shares: &'a TileShares, values: usize) -> Self {
        let (columns, rows) = tile_grid(config.width, config.height);
        assert_eq!(shares.grid(), columns * rows, "shares must be those of an image of this size");
        let extras = shares.extra_offsets[shares.grid()] as usize;
        assert!(shares.grid() + extras <= shares.tiles(), "shares must count every tile drawn");
        let expected = shares.tiles() * TILE * TILE * config.channels;
        assert_eq!(values, expected, "tiles must be [tiles, 16, 16, C]");
        Self { config, shares, columns }
    }

    /// Number of values in the image.
    fn values(&self) -> usize {
        self.config.width as usize * self.config.height as usize * self.config.channels
    }

    /// Calls `visit` for each pixel row of the image's tile that is inside the image, with its number, its offsets in
    /// the drawn tile of the same number and in the image, and its length, all in values.
    fn rows(&self, tile: usize, mut visit: impl FnMut(usize, usize, usize, usize)) {
        let AverageConfig { width, height, channels, .. } = *self.config;
        let [x, y] = [tile % self.columns * TILE, tile / self.columns * TILE];
        let len = (width as usize - x).min(TILE) * channels;
        for row in 0..(height as usize - y).min(TILE) {
            visit(row, self.value(tile, row), ((y + row) * width as usize + x) * channels, len);
        }
    }

    /// Offset of a row of a drawn tile, in values.
    #[inline(always)]
    fn value(&self, drawn: usize, row: usize) -> usize {
        (drawn * TILE + row) * TILE * self.config.channels
    }

    /// Whether value `k` of a row of pixels is averaged as light.
    #[inline(always)]
    fn is_encoded(&self, k: usize) -> bool {
        k % self.config.channels < self.config.encoded
    }

    /// Mean over the instants, of light if encoded.
    #[inline(always)]
    fn mean<F: Real>(
        &self,
        tile: usize,
        extras: &std::ops::Range<usize>,
        row: usize,
        k: usize,
        tiles: &[F],
        light: bool,
    ) -> F {
        let sum = std::iter::once(tile).chain(extras.clone()).fold(F::ZERO, |sum, drawn| {
            let value = tiles[self.value(drawn, row) + k];
            let value = if light { to_linear(value) } else { value };
            sum + F::of(self.shares.counts[drawn].into()) * value
        });
        sum / F::of(self.shares.instants as f64)
    }
}
