//! The lists of the tiles of several instants; [`gs_kernels::cpu::exposure`] explains how the work is shared.

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{DType, Int, Tensor, assert_shape};
use gs_kernels::config::tile_grid;
use gs_kernels::cpu::exposure as cpu;
use gs_kernels::rows::PROJECTED;

use super::assert_same_dtype;
use super::intersect::{DeviceCount, Room, TileIntersections};
use super::operation::{Computation, Tensors, computed, lists};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, int_tensor, with_float};

/// The drawn tiles of each tile of the image, and the number of instants for which each stands.
#[derive(Clone, Debug)]
pub struct TileShares {
    /// Number of instants; 1 if nothing moves, because the table then has no rows of further instants.
    pub instants: usize,
    /// Tiles of the image.
    pub grid: usize,
    /// `[grid + 1 + tiles]`, `i32`: the offsets of the further tiles that show each tile of the image, then the number
    /// of instants of each drawn tile; see [`cpu::TileShares`].
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
/// - `projected` `[R, 8]`, `opacities` `[R]`, `features` `[R, C]`: first the `scene` rows at the first instant, then
///   the `M` rows `moving` at each further one
/// - `moving` `[M]`: ascending row numbers of the Gaussians that move
/// - `room`: a GPU makes lists of this size and does not wait for the numbers of pairs and tiles. Places behind the
///   last are empty. With too little room all lists are empty, and [`DeviceCount::overflows`] tells so once the numbers
///   are read. The CPU takes no notice of it.
///
/// A list equals that of [`intersect`](super::intersect::intersect) for the whole scene at that instant. Tiles that
/// look alike at several instants have one list. Not differentiable.
///
/// # Panics
/// When shapes or float types disagree, and when there are more than 2^31 pairs; on a CPU, when `moving` does not
/// ascend below `scene`. A GPU does not check that, as it checks no row of [`take_rows`](super::rows::take_rows), and
/// its lists would mean nothing.
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
    let inputs =
        [projected.inner().into_dispatch(), opacities.inner().into_dispatch(), features.inner().into_dispatch()];
    let computation = Instants { size: [width as u32, height as u32], scene, room };
    let rows_of_moving = moving.clone().inner().cast(DType::I32).into_dispatch();
    let (words, found) = computed(computation, inputs, [rows_of_moving]).into_arrays();
    let [tile_offsets, gaussian_ids, gaussian_offsets, positions, places, numbers] = lists(found);
    let [pair_words, tile_words] = words.map(Tensor::from_dispatch);
    let (columns, rows) = tile_grid(width as u32, height as u32);
    let further = (count - scene).checked_div(movers).unwrap_or(0);
    let shares = TileShares { instants: further + 1, grid: columns * rows, numbers };
    let made = |words: Tensor<1>, room: usize| match words.dims() {
        [0] => DeviceCount::Known(room),
        _ => DeviceCount::OnDevice { words, room },
    };
    let count = made(pair_words, gaussian_ids.dims()[0]);
    let places = Some(places);
    let lists = TileIntersections { tile_offsets, gaussian_ids, gaussian_offsets, positions, places, count };
    let tiles = made(tile_words, shares.tiles());
    InstantIntersections { lists, shares, tiles }
}

/// [`intersect_instants`] as a computation on projected rows, opacities, features and the rows of what moves. The
/// results are the lists of [`TileIntersections`], [`TileShares::numbers`], and the words of the numbers of pairs and
/// of tiles ([`DeviceCount`]), none where they are known.
pub(crate) struct Instants {
    /// Width and height of the image.
    pub(crate) size: [u32; 2],
    /// Rows of the scene, before those of further instants.
    pub(crate) scene: usize,
    /// Read on a GPU alone; a CPU makes lists of the right length.
    #[cfg_attr(not(feature = "cube"), expect(dead_code, reason = "a build without a GPU backend"))]
    pub(crate) room: Option<Room>,
}

impl Computation<3, 1> for Instants {
    fn compute<B: HostBackend>(
        &self,
        [projected, opacities, features]: [FloatTensor<B>; 3],
        [moving]: [IntTensor<B>; 1],
    ) -> Tensors<B> {
        let (&Self { size: [width, height], scene, .. }, channels) = (self, features.shape()[1]);
        let moving: Vec<u32> = moving.elements::<i32>().iter().map(|row| *row as u32).collect();
        with_float!(projected, F => {
            let (lists, shares) = cpu::intersect_instants::<F>(
                projected.elements(), opacities.elements(), features.elements(), width, height, channels, scene, &moving,
            );
            let ints = [
                lists.tile_offsets,
                lists.gaussian_ids,
                lists.gaussian_offsets,
                lists.positions,
                lists.places,
                shares.numbers(),
            ];
            let none = || float_tensor::<B>(Vec::<F>::new(), [0]);
            Tensors { floats: vec![none(), none()], ints: ints.map(int_tensor::<B>).into() }
        })
    }
}
