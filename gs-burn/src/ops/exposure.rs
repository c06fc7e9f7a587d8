//! Several instants of a scene in one image: the lists of their tiles and the mean of the drawn tiles.
//! [`gs_kernels::cpu::exposure`] explains how the work is shared.

use std::sync::Arc;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::{DType, Int, Tensor, TensorData, assert_shape};
pub use gs_kernels::config::AverageConfig;
use gs_kernels::constants::TILE;
use gs_kernels::cpu::exposure as cpu;
pub use gs_kernels::cpu::exposure::TileShares;
use gs_kernels::rows::PROJECTED;

use super::assert_same_dtype;
use super::gradient::{Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use super::intersect::{PairCount, TileIntersections};
use crate::device::is_gpu;
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// The lists of all instants of a table of rows, and the shares of the drawn tiles.
///
/// - `projected` `[R, 8]`, `opacities` `[R]`, `features` `[R, C]`: first the `scene` rows at the first instant, then the `M` rows
///   `moving` at each further one
/// - `moving`: ascending row numbers of the Gaussians that move
///
/// A list equals that of [`intersect`](super::intersect::intersect) for the whole scene at that instant. Tiles that look alike at
/// several instants have one list. Not differentiable.
///
/// The lists are made on the host on every backend, from rows read back from the device: merging many short lists is cheap compared
/// with drawing them, and a GPU would need a sort over all instants.
///
/// # Panics
/// When shapes or float types disagree, `moving` does not ascend, and when there are more than 2^31 pairs.
pub fn intersect_instants(
    projected: Tensor<2>,
    opacities: Tensor<1>,
    features: Tensor<2>,
    width: usize,
    height: usize,
    scene: usize,
    moving: &[u32],
) -> (TileIntersections, Arc<TileShares>) {
    let [count, channels] = features.dims();
    assert_shape!(projected, [count, PROJECTED]);
    assert_shape!(opacities, [count]);
    assert_same_dtype("opacities", &opacities, "projected", &projected);
    assert_same_dtype("features", &features, "projected", &projected);
    let _stage = profile::stage("sort into tiles");
    let device = projected.clone().inner().device();
    let [projected, opacities, features] = on_host(projected.inner(), opacities.inner(), features.inner());

    macro_rules! lists {
        ($float:ty) => {{
            let [projected, opacities, features] = [&projected, &opacities, &features]
                .map(|data| data.as_slice::<$float>().expect("tensors of one float type are contiguous on the host"));
            let (width, height) = (width as u32, height as u32);
            cpu::intersect_instants(projected, opacities, features, width, height, channels, scene, moving)
        }};
    }
    let (lists, shares) = match projected.dtype() {
        DType::F64 => lists!(f64),
        _ => lists!(f32),
    };
    let tensor = |values: Vec<i32>| {
        let len = values.len();
        Tensor::<1, Int>::from_data(TensorData::new(values, [len]), (&device, DType::I32))
    };
    let count = PairCount::Known(lists.gaussian_ids.len());
    let lists = TileIntersections {
        count,
        tile_offsets: tensor(lists.tile_offsets),
        gaussian_ids: tensor(lists.gaussian_ids),
        gaussian_offsets: tensor(lists.gaussian_offsets),
        positions: tensor(lists.positions),
        places: Some(tensor(lists.places)),
    };
    (lists, Arc::new(shares))
}

/// The tables' numbers on the host. From a GPU they come in one read, because every read waits for the device.
fn on_host(projected: Tensor<2>, opacities: Tensor<1>, features: Tensor<2>) -> [TensorData; 3] {
    if !is_gpu(&projected.device()) {
        return [projected.into_data(), opacities.into_data(), features.into_data()];
    }
    let [rows, channels] = features.dims();
    let joined = Tensor::cat(vec![projected.flatten(0, 1), opacities, features.flatten(0, 1)], 0).into_data();
    let joined = joined.as_slice::<f32>().expect("a GPU computes in f32");
    let (projected, rest) = joined.split_at(rows * PROJECTED);
    let (opacities, features) = rest.split_at(rows);
    [
        TensorData::new(projected.to_vec(), [rows, PROJECTED]),
        TensorData::new(opacities.to_vec(), [rows]),
        TensorData::new(features.to_vec(), [rows, channels]),
    ]
}

/// The mean image `[H, W, C]` over all instants, from the tiles drawn for them, `[tiles, 256, C]`.
///
/// The first [`AverageConfig::encoded`] channels are averaged as light (through the curve of sRGB), the others as they are. A tile
/// of the image with a single drawn tile is copied. Differentiable.
///
/// # Panics
/// When shapes disagree.
pub fn average_tiles(tiles: Tensor<3>, shares: &Arc<TileShares>, config: &AverageConfig) -> Tensor<3> {
    assert_shape!(tiles, [shares.tiles(), TILE * TILE, config.channels]);
    let _stage = profile::stage("average over the exposure");
    Tensor::from_dispatch(Dispatch::average_tiles(tiles.into_dispatch(), shares.clone(), *config))
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
    fn average_tiles(tiles: FloatTensor<Self>, shares: Arc<TileShares>, config: AverageConfig) -> FloatTensor<Self>;
}

/// The mean on a backend's primitives, without gradient tracking. Tensors may be strided.
pub trait AverageKernels: Backend {
    /// See [`average_tiles`].
    fn average_forward(tiles: FloatTensor<Self>, shares: &TileShares, config: &AverageConfig) -> FloatTensor<Self>;

    /// The gradient with respect to `tiles` from `v_image` `[H, W, C]`; zero in pixels outside the image.
    fn average_backward(
        tiles: FloatTensor<Self>,
        shares: &TileShares,
        config: &AverageConfig,
        v_image: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

impl<B: AverageKernels> AverageOps for B {
    fn average_tiles(tiles: FloatTensor<B>, shares: Arc<TileShares>, config: AverageConfig) -> FloatTensor<B> {
        B::average_forward(tiles, &shares, &config)
    }
}

impl<B: HostBackend> AverageKernels for B {
    fn average_forward(tiles: FloatTensor<B>, shares: &TileShares, config: &AverageConfig) -> FloatTensor<B> {
        let tiles = tiles.contiguous();
        with_float!(tiles, F => {
            let image = cpu::average::<F>(config, shares, tiles.elements());
            float_tensor::<B>(image, [config.height as usize, config.width as usize, config.channels])
        })
    }

    fn average_backward(
        tiles: FloatTensor<B>,
        shares: &TileShares,
        config: &AverageConfig,
        v_image: FloatTensor<B>,
    ) -> FloatTensor<B> {
        let (tiles, v_image) = (tiles.contiguous(), v_image.contiguous());
        with_float!(tiles, F => {
            let v_tiles = cpu::average_backward::<F>(config, shares, tiles.elements(), v_image.elements());
            float_tensor::<B>(v_tiles, [shares.tiles(), TILE * TILE, config.channels])
        })
    }
}

/// State saved for the backward pass.
#[derive(Clone, Debug)]
struct AverageState<B: Backend> {
    tiles: FloatTensor<B>,
    shares: Arc<TileShares>,
    config: AverageConfig,
}

#[derive(Debug)]
struct AverageBackward;

impl<B: AverageKernels> Backward<B, 1> for AverageBackward {
    type State = AverageState<B>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let _stage = profile::stage("average over the exposure, backward");
        let v_image = grads.consume::<B>(&ops.node);
        let AverageState { tiles, shares, config } = ops.state;
        if let [Some(parent)] = ops.parents {
            grads.register::<B>(parent.id, B::average_backward(tiles, &shares, &config, v_image));
        }
    }
}

impl<B: AverageKernels, C: CheckpointStrategy> AverageOps for Autodiff<B, C> {
    fn average_tiles(tiles: FloatTensor<Self>, shares: Arc<TileShares>, config: AverageConfig) -> FloatTensor<Self> {
        let (tiles, node) = tiles.into_parts();
        match AverageBackward.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let image = B::average_forward(tiles.clone(), &shares, &config);
                prep.finish(AverageState { tiles, shares, config }, image)
            }
            OpsKind::UnTracked(prep) => prep.finish(B::average_forward(tiles, &shares, &config)),
        }
    }
}
