//! Tile intersections: the Gaussians that touch each tile, in depth order; the test is in
//! [`gs_kernels::cpu::intersect`].

mod count;
mod reference;

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{Int, Tensor, assert_shape};
use gs_kernels::cpu::intersect as cpu;
use gs_kernels::rows::PROJECTED;

use super::assert_same_dtype;
use super::operation::{Computation, Tensors, computed, lists};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, int_tensor, with_float};
pub use count::DeviceCount;
pub use gs_kernels::config::Room;
pub use reference::intersect_reference;

/// Tiles of 16 x 16 pixels and the Gaussians that touch them; `M` is the number of (tile, Gaussian) pairs. All `i32`.
#[derive(Clone, Debug)]
pub struct TileIntersections {
    /// `[tiles + 1]`: tile `t` (row-major) owns `gaussian_ids[tile_offsets[t]..tile_offsets[t + 1]]`.
    pub tile_offsets: Tensor<1, Int>,
    /// `[M]`: by tile, then depth, then index.
    pub gaussian_ids: Tensor<1, Int>,
    /// `[N + 1]`: Gaussian `g` owns `positions[gaussian_offsets[g]..gaussian_offsets[g + 1]]`.
    pub gaussian_offsets: Tensor<1, Int>,
    /// `[M]`: positions in `gaussian_ids`, ascending for each Gaussian.
    pub positions: Tensor<1, Int>,
    /// `[tiles]`: the image's tile of each list; `None` if the lists are those of the image's tiles in order. See
    /// [`intersect_instants`](super::instants::intersect_instants).
    pub places: Option<Tensor<1, Int>>,
    /// Number of (tile, Gaussian) pairs: `M`, or less where [`intersect_within`] made lists for more.
    pub count: DeviceCount,
}

/// Finds all (tile, Gaussian) pairs of an image of `width` x `height` pixels.
///
/// - `projected` `[N, 8]`: rows of [`project`](super::projection::project)
/// - `opacities` `[N]`: 0 to 1
/// - `features` `[N, C]`: the values to blend
///
/// Left out are culled Gaussians, those whose opacity is below the cut-off or not finite, and those with a feature that
/// is not finite or not below [`gs_kernels::constants::FEATURE_MAX`] in magnitude. Not differentiable: the lists are
/// integers.
///
/// # Panics
/// When shapes or float types disagree, and when there are more than 2^31 pairs.
pub fn intersect(
    projected: Tensor<2>,
    opacities: Tensor<1>,
    features: Tensor<2>,
    width: usize,
    height: usize,
) -> TileIntersections {
    intersect_within(projected, opacities, features, width, height, None)
}

/// Like [`intersect`]; with `room`, a GPU makes lists of this length and does not wait for the number of pairs.
///
/// Places of the lists behind the last pair belong to no tile and no Gaussian. If there are more pairs than `room`, all
/// lists are empty and [`DeviceCount::overflows`] tells so once the number is read. The CPU, and a GPU whose buffers do
/// not hold `room` pairs, take no notice of `room`.
///
/// # Panics
/// As [`intersect`].
pub fn intersect_within(
    projected: Tensor<2>,
    opacities: Tensor<1>,
    features: Tensor<2>,
    width: usize,
    height: usize,
    room: Option<usize>,
) -> TileIntersections {
    check(&projected, &opacities, &features);
    let _stage = profile::stage("sort into tiles");
    // Outside the graph: there is no gradient to record.
    let size = [width as u32, height as u32];
    let inputs =
        [projected.inner().into_dispatch(), opacities.inner().into_dispatch(), features.inner().into_dispatch()];
    let ([words], found) = computed(Intersection { size, room }, inputs, []).into_arrays();
    let [tile_offsets, gaussian_ids, gaussian_offsets, positions] = lists(found);
    let words: Tensor<1> = Tensor::from_dispatch(words);
    let [made] = gaussian_ids.dims();
    let count = match words.dims() {
        [0] => DeviceCount::Known(made),
        _ => DeviceCount::OnDevice { words, room: made },
    };
    TileIntersections { tile_offsets, gaussian_ids, gaussian_offsets, positions, places: None, count }
}

fn check(projected: &Tensor<2>, opacities: &Tensor<1>, features: &Tensor<2>) {
    let [count, channels] = features.dims();
    assert_shape!(projected, [count, PROJECTED]);
    assert_shape!(opacities, [count]);
    assert_shape!(features, [count, channels]);
    assert_same_dtype("opacities", opacities, "projected", projected);
    assert_same_dtype("features", features, "projected", projected);
}

/// [`intersect_within`] as a computation on projected rows, opacities and features. The results are the lists of
/// [`TileIntersections`] and the words of [`DeviceCount`], none where the number of pairs is known.
pub(crate) struct Intersection {
    /// Width and height of the image.
    pub(crate) size: [u32; 2],
    /// Read on a GPU alone; a CPU makes lists of the right length.
    #[cfg_attr(not(feature = "cube"), expect(dead_code, reason = "a build without a GPU backend"))]
    pub(crate) room: Option<usize>,
}

impl Computation<3> for Intersection {
    fn compute<B: HostBackend>(
        &self,
        [projected, opacities, features]: [FloatTensor<B>; 3],
        []: [IntTensor<B>; 0],
    ) -> Tensors<B> {
        let ([width, height], channels) = (self.size, features.shape()[1]);
        with_float!(projected, F => {
            let lists = cpu::intersect::<F>(
                projected.elements(), opacities.elements(), features.elements(), width, height, channels,
            );
            let ints = [lists.tile_offsets, lists.gaussian_ids, lists.gaussian_offsets, lists.positions];
            let words = float_tensor::<B>(Vec::<F>::new(), [0]);
            Tensors { floats: vec![words], ints: ints.map(int_tensor::<B>).into() }
        })
    }
}
