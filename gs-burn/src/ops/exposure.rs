//! Several instants of a scene in one image: the mean of the drawn tiles. [`instants`](super::instants) makes their lists.

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::{Tensor, assert_shape};
pub use gs_kernels::config::AverageConfig;
use gs_kernels::config::tile_grid;
use gs_kernels::constants::TILE;
use gs_kernels::cpu::exposure as cpu;

use super::gradient::{Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use super::instants::TileShares;
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// The mean image `[H, W, C]` over all instants, from the tiles drawn for them, `[tiles, 256, C]`.
///
/// The first [`AverageConfig::encoded`] channels are averaged as light (through the curve of sRGB), the others as they are. A tile
/// of the image with a single drawn tile is copied. Differentiable.
///
/// # Panics
/// When shapes disagree.
pub fn average_tiles(tiles: Tensor<3>, shares: &TileShares, config: &AverageConfig) -> Tensor<3> {
    assert_shape!(tiles, [shares.tiles(), TILE * TILE, config.channels]);
    let _stage = profile::stage("average over the exposure");
    let numbers = shares.numbers.clone().into_dispatch();
    Tensor::from_dispatch(Dispatch::average_tiles(tiles.into_dispatch(), numbers, shares.instants, *config))
}

/// Burn's dispatch for [`average_tiles`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait AverageOps: Backend {
    /// See [`average_tiles`].
    fn average_tiles(
        tiles: FloatTensor<Self>,
        shares: IntTensor<Self>,
        instants: usize,
        config: AverageConfig,
    ) -> FloatTensor<Self>;
}

/// The mean on a backend's primitives, without gradient tracking. Tensors may be strided.
pub trait AverageKernels: Backend {
    /// See [`average_tiles`]; `shares` are [`TileShares::numbers`].
    fn average_forward(
        tiles: FloatTensor<Self>,
        shares: IntTensor<Self>,
        instants: usize,
        config: &AverageConfig,
    ) -> FloatTensor<Self>;

    /// The gradient with respect to `tiles` from `v_image` `[H, W, C]`; zero in pixels outside the image.
    fn average_backward(
        tiles: FloatTensor<Self>,
        shares: IntTensor<Self>,
        instants: usize,
        config: &AverageConfig,
        v_image: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

impl<B: AverageKernels> AverageOps for B {
    fn average_tiles(
        tiles: FloatTensor<B>,
        shares: IntTensor<B>,
        instants: usize,
        config: AverageConfig,
    ) -> FloatTensor<B> {
        B::average_forward(tiles, shares, instants, &config)
    }
}

/// The shares as the CPU's kernels take them.
fn on_host<B: HostBackend>(shares: IntTensor<B>, instants: usize, config: &AverageConfig) -> cpu::TileShares {
    let (columns, rows) = tile_grid(config.width, config.height);
    let shares = shares.contiguous();
    cpu::TileShares::of_numbers(shares.elements(), columns * rows, instants)
}

impl<B: HostBackend> AverageKernels for B {
    fn average_forward(
        tiles: FloatTensor<B>,
        shares: IntTensor<B>,
        instants: usize,
        config: &AverageConfig,
    ) -> FloatTensor<B> {
        let (tiles, shares) = (tiles.contiguous(), on_host::<B>(shares, instants, config));
        with_float!(tiles, F => {
            let image = cpu::average::<F>(config, &shares, tiles.elements());
            float_tensor::<B>(image, [config.height as usize, config.width as usize, config.channels])
        })
    }

    fn average_backward(
        tiles: FloatTensor<B>,
        shares: IntTensor<B>,
        instants: usize,
        config: &AverageConfig,
        v_image: FloatTensor<B>,
    ) -> FloatTensor<B> {
        let (tiles, v_image) = (tiles.contiguous(), v_image.contiguous());
        let shares = on_host::<B>(shares, instants, config);
        with_float!(tiles, F => {
            let v_tiles = cpu::average_backward::<F>(config, &shares, tiles.elements(), v_image.elements());
            float_tensor::<B>(v_tiles, [shares.tiles(), TILE * TILE, config.channels])
        })
    }
}

/// State saved for the backward pass.
#[derive(Clone, Debug)]
struct AverageState<B: Backend> {
    tiles: FloatTensor<B>,
    /// [`TileShares::numbers`]
    shares: IntTensor<B>,
    instants: usize,
    config: AverageConfig,
}

#[derive(Debug)]
struct AverageBackward;

impl<B: AverageKernels> Backward<B, 1> for AverageBackward {
    type State = AverageState<B>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let _stage = profile::stage("average over the exposure, backward");
        let v_image = grads.consume::<B>(&ops.node);
        let AverageState { tiles, shares, instants, config } = ops.state;
        if let [Some(parent)] = ops.parents {
            grads.register::<B>(parent.id, B::average_backward(tiles, shares, instants, &config, v_image));
        }
    }
}

impl<B: AverageKernels, C: CheckpointStrategy> AverageOps for Autodiff<B, C> {
    fn average_tiles(
        tiles: FloatTensor<Self>,
        shares: IntTensor<Self>,
        instants: usize,
        config: AverageConfig,
    ) -> FloatTensor<Self> {
        let (tiles, node) = tiles.into_parts();
        match AverageBackward.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let image = B::average_forward(tiles.clone(), shares.clone(), instants, &config);
                prep.finish(AverageState { tiles, shares, instants, config }, image)
            }
            OpsKind::UnTracked(prep) => prep.finish(B::average_forward(tiles, shares, instants, &config)),
        }
    }
}
