//! Shared code of forward and backward: the inputs of a rasterization and the pixels of one tile.

use rayon::prelude::*;

use crate::config::RasterizeConfig;
use crate::constants::{ALPHA_MIN, TILE};
use crate::cpu::Real;
use crate::cpu::blend::{EDGE, OUTSIDE, TileGaussian};
use crate::cpu::intersect::IntersectionSlices;
use crate::cpu::parallel::{CHUNK, prefetch, zeros};
use crate::cpu::real::{Aligned, LANES, Lanes};
use crate::rows::{DEPTH, PROJECTED, ProjectedRow};

/// Largest number of channels that has code of its own, with every accumulator in registers.
pub(super) const UNROLLED: usize = 4;

/// Prefetch distance in Gaussians: a pair takes about 100 ns, a memory access about as long.
const PREFETCH: usize = 4;

/// Blocks of a tile.
pub(super) const BLOCKS: usize = EDGE * EDGE;

/// One value per pixel of a tile, block by block as in [`crate::cpu::blend::Blocks`].
pub(super) type TilePlane<F> = [Aligned<F>; BLOCKS];

/// A plane of one value.
pub(super) fn plane<F: Copy>(value: F) -> TilePlane<F> {
    [Aligned([value; LANES]); BLOCKS]
}

/// Block and lane of the pixel (`x`, `y`) of a tile.
#[inline(always)]
pub(super) fn block_and_lane(x: usize, y: usize) -> (usize, usize) {
    (y / EDGE * EDGE + x / EDGE, y % EDGE * EDGE + x % EDGE)
}

/// Inputs of a rasterization.
pub(super) struct Inputs<'a, F> {
    pub config: &'a RasterizeConfig,
    pub projected: &'a [F],
    pub opacities: &'a [F],
    pub features: &'a [F],
    pub lists: IntersectionSlices<'a>,
    /// Background per feature channel, 0 for values that are not finite, then 0 for depth.
    pub background: Vec<F>,
    /// `log2(opacity / ALPHA_MIN)` per Gaussian.
    pub limits: Vec<F>,
    /// Channels blended: features, and depth if asked for.
    pub blended: usize,
    /// Number of lists of Gaussians, one per tile.
    pub tiles: usize,
}

impl<'a, F: Real> Inputs<'a, F> {
    pub fn new(
        config: &'a RasterizeConfig,
        projected: &'a [F],
        opacities: &'a [F],
        features: &'a [F],
        background: &[F],
        lists: IntersectionSlices<'a>,
    ) -> Self {
        let count = opacities.len();
        let (columns, rows) = config.tiles();
        let tiles = if lists.places.is_empty() { columns * rows } else { lists.places.len() };
        assert_eq!(projected.len(), count * PROJECTED, "projected must be [N, 8] for {count} opacities");
        assert_eq!(features.len(), count * config.channels, "features must be [N, C] for {count} opacities");
        assert_eq!(background.len(), config.channels, "background must be [C]");
        assert_eq!(lists.tile_offsets.len(), tiles + 1, "tile_offsets must be [tiles + 1]");
        assert_eq!(lists.gaussian_offsets.len(), count + 1, "gaussian_offsets must be [N + 1]");
        assert_eq!(lists.positions.len(), lists.gaussian_ids.len(), "positions must be as long as gaussian_ids");
        let mut limits = zeros(count);
        limits.par_chunks_mut(CHUNK).zip(opacities.par_chunks(CHUNK)).for_each(|(limits, opacities)| {
            for (limit, &opacity) in limits.iter_mut().zip(opacities) {
                *limit = (opacity / F::of(ALPHA_MIN)).ln() * F::of(std::f64::consts::LOG2_E);
            }
        });
        let finite = |&b: &F| if b.is_finite() { b } else { F::ZERO };
        let mut background: Vec<F> = background.iter().map(finite).collect();
        background.extend(config.depth.then_some(F::ZERO));
        let blended = background.len();
        Self { config, projected, opacities, features, lists, background, limits, blended, tiles }
    }

    /// The Gaussians of a tile, front to back, and the list's offset in the sorted list.
    pub fn list(&self, tile: usize) -> (&'a [i32], usize) {
        let begin = self.lists.tile_offsets[tile] as usize;
        let end = self.lists.tile_offsets[tile + 1] as usize;
        (&self.lists.gaussian_ids[begin..end], begin)
    }

    /// First pixel of a tile.
    pub fn origin(&self, tile: usize) -> [usize; 2] {
        let (columns, rows) = self.config.tiles();
        let image_tile = self.lists.places.get(tile).map_or(tile, |&image_tile| image_tile as usize);
        assert!(image_tile < columns * rows, "a list is for tile {image_tile} of {}", columns * rows);
        [image_tile % columns * TILE, image_tile / columns * TILE]
    }

    /// Pixels of the output: those of the image, or of all tiles for lists with `places`.
    pub fn pixels(&self) -> usize {
        if self.lists.places.is_empty() {
            self.config.width as usize * self.config.height as usize
        } else {
            self.tiles * TILE * TILE
        }
    }

    /// Offset in the output of row `row` of the tile at `origin`, in pixels.
    pub fn row_start(&self, tile: usize, [x, y]: [usize; 2], row: usize) -> usize {
        if self.lists.places.is_empty() {
            (y + row) * self.config.width as usize + x
        } else {
            (tile * TILE + row) * TILE
        }
    }

    /// Rows and columns of the tile inside the image.
    pub fn inside(&self, [x, y]: [usize; 2]) -> [usize; 2] {
        [(self.config.width as usize - x).min(TILE), (self.config.height as usize - y).min(TILE)]
    }

    /// Gaussian `id` prepared for the tile at `origin`.
    #[inline(always)]
    pub fn gaussian(&self, id: usize, origin: [usize; 2]) -> (ProjectedRow<F>, TileGaussian<F>) {
        let row = ProjectedRow::read(self.projected, id);
        (row, TileGaussian::new(&row, self.opacities[id], origin))
    }

    /// Prefetches the inputs of the Gaussian a few entries further in the list.
    #[inline(always)]
    pub fn prefetch(&self, ids: &[i32], k: usize) {
        if let Some(&id) = ids.get(k + PREFETCH) {
            let id = id as usize;
            prefetch(self.projected, id * PROJECTED);
            prefetch(self.opacities, id);
            prefetch(&self.limits, id);
            prefetch(self.features, id * self.config.channels);
        }
    }

    /// Blended channel `c` of Gaussian `id`.
    #[inline(always)]
    pub fn feature(&self, id: usize, c: usize) -> F {
        if c < self.config.channels {
            self.features[id * self.config.channels + c]
        } else {
            self.projected[id * PROJECTED + DEPTH]
        }
    }
}

/// A Gaussian's blended channels, one vector each; in registers for `UNROLL` channels, in memory for any number (0).
pub(super) struct FeatureLanes<L, const UNROLL: usize> {
    small: [L; UNROLL],
    large: Vec<L>,
}

impl<L: Lanes, const UNROLL: usize> FeatureLanes<L, UNROLL> {
    #[inline(always)]
    pub fn new(channels: usize) -> Self {
        let zero = L::splat(L::Real::ZERO);
        Self { small: [zero; UNROLL], large: if UNROLL > 0 { Vec::new() } else { vec![zero; channels] } }
    }

    #[inline(always)]
    pub fn lanes(&mut self) -> &mut [L] {
        if UNROLL > 0 { &mut self.small } else { &mut self.large }
    }

    /// The channels of Gaussian `id` in every lane.
    #[inline(always)]
    pub fn read(&mut self, inputs: &Inputs<'_, L::Real>, id: usize) -> &[L] {
        let lanes = self.lanes();
        // A loop, not `for_each`: its closure is compiled without the processor's features where it is not inlined.
        for (c, lane) in lanes.iter_mut().enumerate() {
            *lane = L::splat(inputs.feature(id, c));
        }
        lanes
    }
}

/// Transmittance 1 inside the image, [`OUTSIDE`] elsewhere; and the blocks wholly outside as bits.
pub(super) fn fresh_transmittance<F: Real>([columns, rows]: [usize; 2]) -> (TilePlane<F>, u16) {
    if columns == TILE && rows == TILE {
        return (plane(F::ONE), 0);
    }
    let mut plane = plane(F::of(OUTSIDE));
    let mut ended = u16::MAX;
    for y in 0..rows {
        for x in 0..columns {
            let (block, lane) = block_and_lane(x, y);
            plane[block].0[lane] = F::ONE;
            ended &= !(1 << block);
        }
    }
    (plane, ended)
}
