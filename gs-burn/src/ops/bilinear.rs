//! An image between its pixels: bilinear sampling, differentiable by image and position.
//!
//! The gradient of Burn's `select`, which the reference is made of, adds rows in one thread a channel on a GPU: seconds for an image
//! that is looked up at each pixel. Here every value of the image has one writer, which adds its lookups in a fixed order, so results are
//! equal to the bit from run to run.

mod reference;
#[cfg(test)]
mod tests;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{Tensor, assert_shape};
use gs_kernels::cpu::bilinear as cpu;
pub use reference::bilinear_reference;

use super::assert_same_dtype;
use super::gradient::{self, Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// Values of `image` `[H, W, C]` at `positions` `[P, 2]` (x, y in pixels, the first pixel's centre at (0.5, 0.5)), `[P, C]`.
/// Differentiable by both.
///
/// Beyond the outermost centres the image goes on as it is at its border. The gradient by position is the slope of the
/// bilinear patch, zero beyond the border; on a line between two patches the right or lower patch counts. A position that is not a
/// number gives values that are none.
///
/// # Panics
/// When the image has no pixels, the float types disagree, or the positions are not pairs.
pub fn bilinear(image: Tensor<3>, positions: Tensor<2>) -> Tensor<2> {
    check(&image, &positions);
    let _stage = profile::stage("bilinear lookup");
    Tensor::from_dispatch(Dispatch::bilinear(image.into_dispatch(), positions.into_dispatch()))
}

fn check(image: &Tensor<3>, positions: &Tensor<2>) {
    let [height, width, _] = image.dims();
    assert!(height > 0 && width > 0, "an image to sample must have pixels, it has {width} x {height}");
    let count = positions.dims()[0];
    assert_shape!(positions, [count, 2]);
    assert_same_dtype("positions", positions, "image", image);
}

/// Burn's dispatch for [`bilinear`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait BilinearOps: Backend {
    /// See [`bilinear`].
    fn bilinear(image: FloatTensor<Self>, positions: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// The lookup and its gradients on a backend's primitives, without gradient tracking. Tensors may be strided.
pub trait BilinearKernels: Backend {
    /// See [`bilinear`].
    fn bilinear_forward(image: FloatTensor<Self>, positions: FloatTensor<Self>) -> FloatTensor<Self>;

    /// The gradient by the image, `[height, width, C]`, from `v` `[P, C]`.
    fn bilinear_by_image(size: [usize; 2], positions: FloatTensor<Self>, v: FloatTensor<Self>) -> FloatTensor<Self>;

    /// The gradient by the positions, `[P, 2]`, from `v` `[P, C]`.
    fn bilinear_by_positions(
        image: FloatTensor<Self>,
        positions: FloatTensor<Self>,
        v: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

impl<B: BilinearKernels> BilinearOps for B {
    fn bilinear(image: FloatTensor<B>, positions: FloatTensor<B>) -> FloatTensor<B> {
        B::bilinear_forward(image, positions)
    }
}

impl<B: HostBackend> BilinearKernels for B {
    fn bilinear_forward(image: FloatTensor<B>, positions: FloatTensor<B>) -> FloatTensor<B> {
        let [height, width, channels] = image.shape().dims();
        let count = positions.shape()[0];
        let [image, positions] = [image, positions].map(HostTensor::contiguous);
        with_float!(image, F => {
            let values = cpu::forward::<F>(image.elements(), [height, width], channels, positions.elements());
            float_tensor::<B>(values, [count, channels])
        })
    }

    fn bilinear_by_image(size: [usize; 2], positions: FloatTensor<B>, v: FloatTensor<B>) -> FloatTensor<B> {
        let channels = v.shape()[1];
        let [positions, v] = [positions, v].map(HostTensor::contiguous);
        with_float!(v, F => {
            let v_image = cpu::by_image::<F>(size, channels, positions.elements(), v.elements());
            float_tensor::<B>(v_image, [size[0], size[1], channels])
        })
    }

    fn bilinear_by_positions(image: FloatTensor<B>, positions: FloatTensor<B>, v: FloatTensor<B>) -> FloatTensor<B> {
        let [height, width, channels] = image.shape().dims();
        let count = positions.shape()[0];
        let [image, positions, v] = [image, positions, v].map(HostTensor::contiguous);
        with_float!(image, F => {
            let (image, size) = (image.elements(), [height, width]);
            let v_positions = cpu::by_positions::<F>(image, size, channels, positions.elements(), v.elements());
            float_tensor::<B>(v_positions, [count, 2])
        })
    }
}

/// State saved for the backward pass.
#[derive(Clone, Debug)]
struct BilinearState<B: Backend> {
    image: FloatTensor<B>,
    positions: FloatTensor<B>,
}

#[derive(Debug)]
struct BilinearBackward;

impl<B: BilinearKernels> Backward<B, 2> for BilinearBackward {
    type State = BilinearState<B>;

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let _stage = profile::stage("bilinear lookup, backward");
        let v = grads.consume::<B>(&ops.node);
        let BilinearState { image, positions } = ops.state;
        let [of_image, of_positions] = ops.parents.map(|node| node.map(|node| node.id));
        let [height, width, _] = image.shape().dims();
        if of_image.is_some() {
            let v_image = B::bilinear_by_image([height, width], positions.clone(), v.clone());
            gradient::register::<B, 1>(grads, [of_image], [v_image]);
        }
        if of_positions.is_some() {
            let v_positions = B::bilinear_by_positions(image, positions, v);
            gradient::register::<B, 1>(grads, [of_positions], [v_positions]);
        }
    }
}

impl<B: BilinearKernels, C: CheckpointStrategy> BilinearOps for Autodiff<B, C> {
    fn bilinear(image: FloatTensor<Self>, positions: FloatTensor<Self>) -> FloatTensor<Self> {
        let (image, image_node) = image.into_parts();
        let (positions, positions_node) = positions.into_parts();
        let values = B::bilinear_forward(image.clone(), positions.clone());
        match BilinearBackward.prepare::<C>([image_node, positions_node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(BilinearState { image, positions }, values),
            OpsKind::UnTracked(prep) => prep.finish(values),
        }
    }
}
