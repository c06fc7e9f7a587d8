//! The lists of the tiles of several instants; [`gs_kernels::cpu::exposure`] explains how the work is shared.

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Backend, Dispatch, ExtensionType, TensorMetadata, backend_extension};
use burn::tensor::{DType, Int, Tensor, assert_shape};
use gs_kernels::config::tile_grid;
use gs_kernels::cpu::exposure as cpu;
use gs_kernels::rows::PROJECTED;

use super::assert_same_dtype;
use super::intersect::{DeviceCount, Room, TileIntersections};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, int_tensor, with_float};

/// The drawn tiles of each tile of the image, and the number of instants for which each stands.
#[derive(Clone, Debug)]
pub struct TileShares {
    /// Number of instants; 1 if nothing moves, because the table then has no rows of further instants.
    pub instants: usize,
    /// Tiles of the image.
    pub grid: usize,
    /// `[grid + 1 + tiles]`, `i32`: the offsets of the further tiles that show each tile of the image, then the number of instants of each
    /// drawn tile; see [`cpu::TileShares`].
    pub numbers: Tensor<1, Int>,
}

impl TileShares {
    /// The image's tiles at the first instant alone, of as many drawn tiles as here.
    pub fn first_only(&self) -> Self {
        let numbers = cpu::TileShares::first_only(self.grid, self.tiles()).numbers();
        let options = (&self.numbers.device(), DType::I32);
        Self { instants: 1, grid: self.grid, numbers: Tensor::from_data(numbers.as_slice(), options) }
    }

    /// Tiles that are drawn, or for which there is room.
    pub fn tiles(&self) -> usize {
        self.numbers.dims()[0] - self.grid - 1
    }
}

/// The lists of all instants.
#[derive(Clone, Debug)]
pub struct InstantIntersections {
    /// A list for each drawn tile, with places.
    pub lists: TileIntersections,
    /// The shares of the drawn tiles.
    pub shares: TileShares,
    /// Number of drawn tiles: those of [`shares`](Self::shares), or less where there was room for more.
    pub tiles: DeviceCount,
}

/// The lists of all instants of a table of rows, and the shares of the drawn tiles.
///
/// - `projected` `[R, 8]`, `opacities` `[R]`, `features` `[R, C]`: first the `scene` rows at the first instant, then the `M` rows
///   `moving` at each further one
/// - `moving` `[M]`: ascending row numbers of the Gaussians that move
/// - `room`: a GPU makes lists of this size and does not wait for the numbers of pairs and tiles. Places behind the last are empty. With too
///   little room all lists are empty, and [`DeviceCount::overflows`] tells so once the numbers are read. The CPU takes no notice of it.
///
/// A list equals that of [`intersect`](super::intersect::intersect) for the whole scene at that instant. Tiles that look alike at
/// several instants have one list. Not differentiable.
///
/// # Panics
/// When shapes or float types disagree, and when there are more than 2^31 pairs; on a CPU, when `moving` does not ascend below `scene`. A
/// GPU does not check that, as it checks no row of [`take_rows`](super::rows::take_rows), and its lists would mean nothing.
pub fn intersect_instants(
    projected: Tensor<2>,
    opacities: Tensor<1>,
    features: Tensor<2>,
    [width, height]: [usize; 2],
    scene: usize,
    moving: &Tensor<1, Int>,
    room: Option<Room>,
) -> InstantIntersections {
    let ([count, channels], [movers]) = (features.dims(), moving.dims());
    assert_shape!(projected, [count, PROJECTED]);
    assert_shape!(opacities, [count]);
    assert_shape!(features, [count, channels]);
    assert_same_dtype("opacities", &opacities, "projected", &projected);
    assert_same_dtype("features", &features, "projected", &projected);
    let _stage = profile::stage("sort into tiles");
    // Outside the graph: there is no gradient to record.
    let found = Dispatch::intersect_instants(
        projected.inner().into_dispatch(),
        opacities.inner().into_dispatch(),
        features.inner().into_dispatch(),
        [width as u32, height as u32],
        scene,
        moving.clone().inner().cast(DType::I32).into_dispatch(),
        room,
    );
    let (columns, rows) = tile_grid(width as u32, height as u32);
    let further = (count - scene).checked_div(movers).unwrap_or(0);
    let shares =
        TileShares { instants: further + 1, grid: columns * rows, numbers: Tensor::from_dispatch(found.shares) };
    let gaussian_ids: Tensor<1, Int> = Tensor::from_dispatch(found.gaussian_ids);
    let made = |words: Tensor<1>, room: usize| match words.dims() {
        [0] => DeviceCount::Known(room),
        _ => DeviceCount::OnDevice { words, room },
    };
    let lists = TileIntersections {
        count: made(Tensor::from_dispatch(found.pair_words), gaussian_ids.dims()[0]),
        tile_offsets: Tensor::from_dispatch(found.tile_offsets),
        gaussian_ids,
        gaussian_offsets: Tensor::from_dispatch(found.gaussian_offsets),
        positions: Tensor::from_dispatch(found.positions),
        places: Some(Tensor::from_dispatch(found.places)),
    };
    let tiles = made(Tensor::from_dispatch(found.tile_words), shares.tiles());
    InstantIntersections { lists, shares, tiles }
}

/// What [`InstantsOps::intersect_instants`] finds, as a backend's primitives; `i32` and, for words, float.
#[derive(Clone, Debug, ExtensionType)]
pub struct FoundInstants<B: Backend> {
    /// `[tiles + 1]`
    pub tile_offsets: IntTensor<B>,
    /// `[M]`
    pub gaussian_ids: IntTensor<B>,
    /// `[R + 1]`
    pub gaussian_offsets: IntTensor<B>,
    /// `[M]`
    pub positions: IntTensor<B>,
    /// `[tiles]`
    pub places: IntTensor<B>,
    /// `[grid + 1 + tiles]`: [`TileShares::numbers`].
    pub shares: IntTensor<B>,
    /// `[2]`, the words of the number of pairs; `[0]` if there are `M`.
    pub pair_words: FloatTensor<B>,
    /// `[2]`, the words of the number of drawn tiles; `[0]` if there are `tiles`.
    pub tile_words: FloatTensor<B>,
}

/// Burn's dispatch for [`intersect_instants`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube")
)]
pub trait InstantsOps: Backend {
    /// See [`intersect_instants`].
    fn intersect_instants(
        projected: FloatTensor<Self>,
        opacities: FloatTensor<Self>,
        features: FloatTensor<Self>,
        size: [u32; 2],
        scene: usize,
        moving: IntTensor<Self>,
        room: Option<Room>,
    ) -> FoundInstants<Self>;
}

/// The lists on a backend's primitives. Tensors may be strided.
pub trait InstantsKernels: Backend {
    /// See [`intersect_instants`].
    fn instants_forward(
        projected: FloatTensor<Self>,
        opacities: FloatTensor<Self>,
        features: FloatTensor<Self>,
        size: [u32; 2],
        scene: usize,
        moving: IntTensor<Self>,
        room: Option<Room>,
    ) -> FoundInstants<Self>;
}

impl<B: InstantsKernels> InstantsOps for B {
    fn intersect_instants(
        projected: FloatTensor<B>,
        opacities: FloatTensor<B>,
        features: FloatTensor<B>,
        size: [u32; 2],
        scene: usize,
        moving: IntTensor<B>,
        room: Option<Room>,
    ) -> FoundInstants<B> {
        B::instants_forward(projected, opacities, features, size, scene, moving, room)
    }
}

impl<B: HostBackend> InstantsKernels for B {
    fn instants_forward(
        projected: FloatTensor<B>,
        opacities: FloatTensor<B>,
        features: FloatTensor<B>,
        [width, height]: [u32; 2],
        scene: usize,
        moving: IntTensor<B>,
        _room: Option<Room>,
    ) -> FoundInstants<B> {
        let channels = features.shape()[1];
        let [projected, opacities, features] = [projected, opacities, features].map(HostTensor::contiguous);
        let moving = moving.contiguous();
        let moving: Vec<u32> = moving.elements::<i32>().iter().map(|row| *row as u32).collect();
        with_float!(projected, F => {
            let (lists, shares) = cpu::intersect_instants::<F>(
                projected.elements(), opacities.elements(), features.elements(), width, height, channels, scene, &moving,
            );
            let none = || float_tensor::<B>(Vec::<F>::new(), [0]);
            FoundInstants {
                tile_offsets: int_tensor::<B>(lists.tile_offsets),
                gaussian_ids: int_tensor::<B>(lists.gaussian_ids),
                gaussian_offsets: int_tensor::<B>(lists.gaussian_offsets),
                positions: int_tensor::<B>(lists.positions),
                places: int_tensor::<B>(lists.places),
                shares: int_tensor::<B>(shares.numbers()),
                pair_words: none(),
                tile_words: none(),
            }
        })
    }
}
