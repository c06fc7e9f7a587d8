//! Several instants of a scene in one image: the mean of the drawn tiles. [`instants`](super::instants) makes their
//! lists.

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{Tensor, assert_shape};
pub use gs_kernels::config::AverageConfig;
use gs_kernels::config::tile_grid;
use gs_kernels::constants::TILE;
use gs_kernels::cpu::exposure as cpu;

use super::instants::TileShares;
use super::operation::{Operation, Output, State, differentiable};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// The mean image `[H, W, C]` over all instants, from the tiles drawn for them, `[tiles, 256, C]`.
///
/// The first [`AverageConfig::encoded`] channels are averaged as light (through the curve of sRGB), the others as they
/// are. A tile of the image with a single drawn tile is copied. Differentiable.
///
/// # Panics
/// When shapes disagree.
pub fn average_tiles(tiles: Tensor<3>, shares: &TileShares, config: &AverageConfig) -> Tensor<3> {
    assert_shape!(tiles, [shares.tiles(), TILE * TILE, config.channels]);
    let _stage = profile::stage("average over the exposure");
    let numbers = shares.numbers.clone().into_dispatch();
    differentiable(Average { instants: shares.instants, config: *config }, [tiles.into_dispatch()], [numbers])
}

/// [`average_tiles`] as an operation on the tiles and on [`TileShares::numbers`].
#[derive(Clone, Debug)]
pub(crate) struct Average {
    pub(crate) instants: usize,
    pub(crate) config: AverageConfig,
}

impl Average {
    /// The shares as the CPU's kernels take them.
    fn shares(&self, numbers: &[i32]) -> cpu::TileShares {
        let (columns, rows) = tile_grid(self.config.width, self.config.height);
        cpu::TileShares::of_numbers(numbers, columns * rows, self.instants)
    }
}

impl Operation<1, 1> for Average {
    const BACKWARD: Option<&'static str> = Some("average over the exposure, backward");

    fn forward<B: HostBackend>(
        &self,
        [tiles]: [FloatTensor<B>; 1],
        [numbers]: [IntTensor<B>; 1],
        _: bool,
    ) -> Output<B> {
        let (config, shares) = (&self.config, self.shares(numbers.elements()));
        with_float!(tiles, F => {
            let image = cpu::average::<F>(config, &shares, tiles.elements());
            Output::of(float_tensor::<B>(image, [config.height as usize, config.width as usize, config.channels]))
        })
    }

    /// Zero in pixels outside the image.
    fn backward<B: HostBackend>(
        &self,
        mut state: State<B, 1, 1>,
        v_image: FloatTensor<B>,
        _: [bool; 1],
    ) -> [Option<FloatTensor<B>>; 1] {
        let ([tiles], shares) = (state.inputs(), self.shares(state.lists[0].elements()));
        with_float!(tiles, F => {
            let v_tiles = cpu::average_backward::<F>(&self.config, &shares, tiles.elements(), v_image.elements());
            [Some(float_tensor::<B>(v_tiles, [shares.tiles(), TILE * TILE, self.config.channels]))]
        })
    }
}
