//! The rows that a tile stages: all values of a Gaussian that a pixel needs, contiguous, so that a batch is read in few
//! cache lines and through one binding.
//!
//! Row: mean x, mean y, d1, l, d2, opacity, the size of the cut-off ellipse (`k`, `reach_y`, `turn`), then the blended
//! channels (features, and depth if it is accumulated), then zeros up to a multiple of four numbers, which a unit reads
//! at once. With three channels a row is 48 bytes.

use cubecl::prelude::*;

use crate::config::RasterizeConfig;
use crate::constants::TILE;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::error::CubeError;
use crate::cube::intersect::{Intersections, cut_off};
use crate::cube::rows::read_row;
use crate::rows::PROJECTED;

/// Values before the blended channels.
pub(super) const GEOMETRY: usize = 9;

/// Numbers that are read at once.
pub(super) type Quad = Vector<f32, Const<4>>;

/// Quads of a row.
pub(super) const fn quads(blended: usize) -> usize {
    (GEOMETRY + blended).div_ceil(4)
}

/// Pixels of a tile.
pub(super) const PIXELS: usize = TILE * TILE;

/// Compile-time options of a rasterization and the checked sizes of its arguments.
#[derive(Clone, Copy)]
pub(super) struct Plan {
    pub count: usize,
    pub channels: usize,
    pub depth: bool,
    pub width: u32,
    pub height: u32,
    pub columns: usize,
    /// Number of lists of Gaussians, one per tile.
    pub tiles: usize,
    /// Whether the lists have `places`, so that the output is tiles, not an image.
    pub placed: bool,
}

impl Plan {
    /// # Panics
    /// When the buffers disagree in length.
    pub fn new(
        config: &RasterizeConfig,
        projected: &Buffer,
        opacities: &Buffer,
        features: &Buffer,
        background: &Buffer,
        lists: &Intersections,
    ) -> Self {
        let count = opacities.len();
        let (columns, rows) = config.tiles();
        assert_eq!(projected.len(), count * PROJECTED, "projected must be [N, 8] for {count} opacities");
        assert_eq!(features.len(), count * config.channels, "features must be [N, C] for {count} opacities");
        assert_eq!(background.len(), config.channels, "background must be [C]");
        let placed = lists.placed > 0;
        let tiles = if placed { lists.placed } else { columns * rows };
        assert_eq!(lists.tile_offsets.len(), tiles + 1 + lists.placed, "tile_offsets must be [tiles + 1], then places");
        assert_eq!(lists.gaussian_offsets.len(), count + 1, "gaussian_offsets must be [N + 1]");
        assert_eq!(lists.positions.len(), lists.gaussian_ids.len(), "positions must be as long as gaussian_ids");
        Self {
            count,
            channels: config.channels,
            depth: config.depth,
            width: config.width,
            height: config.height,
            columns,
            tiles,
            placed,
        }
    }

    /// Channels blended: features, and depth if it is accumulated.
    pub fn blended(&self) -> usize {
        self.channels + usize::from(self.depth)
    }

    /// Pixels of the output: those of the image, or of all tiles.
    pub fn pixels(&self) -> usize {
        if self.placed { self.tiles * PIXELS } else { self.width as usize * self.height as usize }
    }

    /// Values in an attribute row.
    pub fn stride(&self) -> usize {
        4 * quads(self.blended())
    }

    /// Values of all attribute rows. There is one at least, because no API binds a part of a quad.
    pub fn attributes(&self) -> usize {
        self.count.max(1) * self.stride()
    }

    /// Rows in a batch that takes at most `floats` of shared memory.
    pub fn batch(&self, floats: usize) -> usize {
        let fitting = (floats / self.stride()).max(1);
        (1 << fitting.ilog2()).min(64)
    }

    /// Packs the attribute rows.
    pub fn pack(
        &self,
        client: &Client,
        projected: &Buffer,
        opacities: &Buffer,
        features: &Buffer,
    ) -> Result<Buffer, CubeError> {
        let attributes = Buffer::empty(client, "attributes of the rasterizer", self.attributes())?;
        if self.count > 0 {
            // SAFETY: rows below `count`, which `Plan::new` found in every buffer.
            unsafe {
                pack_kernel::launch_unchecked(
                    client,
                    grid_for(self.count),
                    cube_dim(),
                    projected.arg(),
                    opacities.arg(),
                    features.arg(),
                    attributes.arg(),
                    self.count as u32,
                    self.channels as u32,
                    self.depth,
                );
            }
        }
        Ok(attributes)
    }
}

/// One unit per Gaussian packs its attribute row.
#[cube(launch_unchecked)]
fn pack_kernel(
    projected: &[f32],
    opacities: &[f32],
    features: &[f32],
    attributes: &mut [f32],
    count: u32,
    channels: u32,
    #[comptime] depth: bool,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= count as usize {
        terminate!();
    }
    let channels = channels as usize;
    let row = read_row(projected, index);
    let used = channels + comptime!(GEOMETRY + depth as usize);
    let base = index * used.div_ceil(4usize) * 4;
    attributes[base] = row.mean_x;
    attributes[base + 1] = row.mean_y;
    attributes[base + 2] = row.d1;
    attributes[base + 3] = row.l;
    attributes[base + 4] = row.d2;
    let opacity = opacities[index];
    let cut = cut_off(row, opacity);
    attributes[base + 5] = opacity;
    attributes[base + 6] = cut.k;
    attributes[base + 7] = cut.reach_y;
    attributes[base + 8] = cut.turn;
    for channel in 0..channels {
        attributes[base + GEOMETRY + channel] = features[index * channels + channel];
    }
    if comptime!(depth) {
        attributes[base + GEOMETRY + channels] = row.depth;
    }
    for column in used..used.div_ceil(4usize) * 4 {
        attributes[base + column] = 0.0f32;
    }
}

/// All units of the cube copy `count` attribute rows, of the Gaussians `ids[first..]`, to `staged`.
#[cube]
pub(super) fn stage(
    attributes: &[Quad],
    ids: &[u32],
    first: u32,
    count: u32,
    staged: &mut Shared<[Quad]>,
    #[comptime] quads: usize,
    #[comptime] units: u32,
) {
    let values = count * comptime!(quads as u32);
    let mut k = UNIT_POS;
    while k < values {
        let gaussian = k / comptime!(quads as u32);
        let column = k - gaussian * comptime!(quads as u32);
        let id = ids[(first + gaussian) as usize] as usize;
        staged[k as usize] = attributes[id * quads + column as usize];
        k += units;
    }
}

/// Channel `c` of the staged row whose first quad is `row`.
#[cube]
pub(super) fn channel(staged: &Shared<[Quad]>, row: usize, c: usize) -> f32 {
    staged[row + (GEOMETRY + c) / 4].extract_dynamic((GEOMETRY + c) % 4)
}

/// The image's tile of list `tile` of `tiles`; for `placed` lists it is stored behind their offsets.
#[cube]
pub(super) fn place_of(tile_offsets: &[u32], tile: u32, tiles: u32, #[comptime] placed: bool) -> u32 {
    let mut image_tile = tile;
    if comptime!(placed) {
        image_tile = tile_offsets[(tiles + 1u32 + tile) as usize];
    }
    image_tile
}

/// Number in the output of the pixel (`x`, `y`) of the image, which is pixel `own` of list `tile`.
#[cube]
pub(super) fn output_pixel(x: u32, y: u32, width: u32, tile: u32, own: u32, #[comptime] placed: bool) -> usize {
    let mut pixel = y as usize * width as usize + x as usize;
    if comptime!(placed) {
        pixel = tile as usize * PIXELS + own as usize;
    }
    pixel
}
