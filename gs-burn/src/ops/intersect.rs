//! Tile intersections: the Gaussians that touch each tile, in depth order; the test is in [`gs_kernels::cpu::intersect`].

mod reference;
#[cfg(test)]
mod tests;

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::{Int, Tensor, assert_shape};
use gs_kernels::cpu::intersect as cpu;
use gs_kernels::rows::PROJECTED;

use super::assert_same_dtype;
use super::gradient::{Autodiff, CheckpointStrategy};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, int_tensor, with_float};
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
    /// [`intersect_instants`](super::exposure::intersect_instants).
    pub places: Option<Tensor<1, Int>>,
}

impl TileIntersections {
    /// Number of (tile, Gaussian) pairs.
    pub fn count(&self) -> usize {
        self.gaussian_ids.dims()[0]
    }
}

/// Finds all (tile, Gaussian) pairs of an image of `width` x `height` pixels.
///
/// - `projected` `[N, 8]`: rows of [`project`](super::projection::project)
/// - `opacities` `[N]`: 0 to 1
/// - `features` `[N, C]`: the values to blend
///
/// Left out are culled Gaussians, those whose opacity is below the cut-off or not finite, and those with a feature that is not
/// finite or not below [`gs_kernels::constants::FEATURE_MAX`] in magnitude. Not differentiable: the lists are integers.
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
    check(&projected, &opacities, &features);
    let _stage = profile::stage("sort into tiles");
    // Outside the graph: there is no gradient to record.
    let lists = Dispatch::intersect(
        projected.inner().into_dispatch(),
        opacities.inner().into_dispatch(),
        features.inner().into_dispatch(),
        width as u32,
        height as u32,
    );
    TileIntersections {
        tile_offsets: Tensor::from_dispatch(lists.tile_offsets),
        gaussian_ids: Tensor::from_dispatch(lists.gaussian_ids),
        gaussian_offsets: Tensor::from_dispatch(lists.gaussian_offsets),
        positions: Tensor::from_dispatch(lists.positions),
        places: None,
    }
}

fn check(projected: &Tensor<2>, opacities: &Tensor<1>, features: &Tensor<2>) {
    let [count, channels] = features.dims();
    assert_shape!(projected, [count, PROJECTED]);
    assert_shape!(opacities, [count]);
    assert_shape!(features, [count, channels]);
    assert_same_dtype("opacities", opacities, "projected", projected);
    assert_same_dtype("features", features, "projected", projected);
}

/// [`TileIntersections`] as a backend's primitives, `i32` on every backend.
#[derive(Clone, Debug, ExtensionType)]
pub struct IntersectionLists<B: Backend> {
    /// `[tiles + 1]`
    pub tile_offsets: IntTensor<B>,
    /// `[M]`
    pub gaussian_ids: IntTensor<B>,
    /// `[N + 1]`
    pub gaussian_offsets: IntTensor<B>,
    /// `[M]`
    pub positions: IntTensor<B>,
    /// `[tiles]`, or `[0]` if the tiles are those of the image in order.
    pub places: IntTensor<B>,
}

/// Burn's dispatch for [`intersect`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait IntersectOps: Backend {
    /// See [`intersect`].
    fn intersect(
        projected: FloatTensor<Self>,
        opacities: FloatTensor<Self>,
        features: FloatTensor<Self>,
        width: u32,
        height: u32,
    ) -> IntersectionLists<Self>;
}

/// Intersection on a backend's primitives. Shapes as in [`intersect`]; tensors may be strided.
pub trait IntersectKernels: Backend {
    /// The lists; `M` may be zero.
    fn intersect_forward(
        projected: FloatTensor<Self>,
        opacities: FloatTensor<Self>,
        features: FloatTensor<Self>,
        width: u32,
        height: u32,
    ) -> IntersectionLists<Self>;
}

impl<B: IntersectKernels> IntersectOps for B {
    fn intersect(
        projected: FloatTensor<B>,
        opacities: FloatTensor<B>,
        features: FloatTensor<B>,
        width: u32,
        height: u32,
    ) -> IntersectionLists<B> {
        B::intersect_forward(projected, opacities, features, width, height)
    }
}

impl<B: HostBackend> IntersectKernels for B {
    fn intersect_forward(
        projected: FloatTensor<B>,
        opacities: FloatTensor<B>,
        features: FloatTensor<B>,
        width: u32,
        height: u32,
    ) -> IntersectionLists<B> {
        let channels = burn::backend::TensorMetadata::shape(&features)[1];
        let [projected, opacities, features] = [projected, opacities, features].map(HostTensor::contiguous);
        let lists = with_float!(projected, F => {
            cpu::intersect::<F>(
                projected.elements(), opacities.elements(), features.elements(), width, height, channels,
            )
        });
        IntersectionLists {
            tile_offsets: int_tensor::<B>(lists.tile_offsets),
            gaussian_ids: int_tensor::<B>(lists.gaussian_ids),
            gaussian_offsets: int_tensor::<B>(lists.gaussian_offsets),
            positions: int_tensor::<B>(lists.positions),
            places: int_tensor::<B>(lists.places),
        }
    }
}

impl<B: IntersectKernels, C: CheckpointStrategy> IntersectOps for Autodiff<B, C> {
    fn intersect(
        projected: FloatTensor<Self>,
        opacities: FloatTensor<Self>,
        features: FloatTensor<Self>,
        width: u32,
        height: u32,
    ) -> IntersectionLists<Self> {
        let [projected, opacities, features] = [projected, opacities, features].map(|tensor| tensor.into_primitive());
        let lists = B::intersect_forward(projected, opacities, features, width, height);
        IntersectionLists {
            tile_offsets: lists.tile_offsets,
            gaussian_ids: lists.gaussian_ids,
            gaussian_offsets: lists.gaussian_offsets,
            positions: lists.positions,
            places: lists.places,
        }
    }
}
