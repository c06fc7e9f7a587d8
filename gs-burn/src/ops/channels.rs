//! A range of an image's channels, as an image.
//!
//! `narrow` returns a strided view that every later op must make contiguous, and its gradient takes three passes over the image;
//! for an image of Gaussians that took as long as projecting them. This op takes one pass in each direction.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{Shape, Slice, Tensor};
use rayon::prelude::*;

use super::gradient::{Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// Channels `first..first + count` of `image` `[H, W, C]`, `[H, W, count]`. Differentiable.
///
/// # Panics
/// When the image has fewer channels.
pub fn channels(image: Tensor<3>, first: usize, count: usize) -> Tensor<3> {
    let [_, _, total] = image.dims();
    assert!(first + count <= total, "channels {first}..{} of an image that has {total}", first + count);
    Tensor::from_dispatch(Dispatch::channels(image.into_dispatch(), first, count))
}

/// Burn's dispatch for [`channels`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait ChannelsOps: Backend {
    /// See [`channels`].
    fn channels(image: FloatTensor<Self>, first: usize, count: usize) -> FloatTensor<Self>;
}

/// The selection on a backend's primitives, without gradient tracking. The default bodies are plain tensor operations.
pub trait ChannelsKernels: Backend {
    /// See [`channels`].
    fn channels_forward(image: FloatTensor<Self>, first: usize, count: usize) -> FloatTensor<Self> {
        Self::float_slice(image, &selection(first, count))
    }

    /// `v` `[H, W, count]` among zeros, `[H, W, total]`.
    fn channels_backward(v: FloatTensor<Self>, first: usize, total: usize) -> FloatTensor<Self> {
        let [height, width, count] = v.shape().dims();
        let zeros = Self::float_zeros(Shape::new([height, width, total]), &v.device(), v.dtype().into());
        Self::float_slice_assign(zeros, &selection(first, count), v)
    }
}

fn selection(first: usize, count: usize) -> [Slice; 3] {
    [Slice::full(), Slice::full(), Slice::from(first..first + count)]
}

impl<B: ChannelsKernels> ChannelsOps for B {
    fn channels(image: FloatTensor<B>, first: usize, count: usize) -> FloatTensor<B> {
        B::channels_forward(image, first, count)
    }
}

impl<B: HostBackend> ChannelsKernels for B {
    fn channels_forward(image: FloatTensor<B>, first: usize, count: usize) -> FloatTensor<B> {
        let [height, width, total] = image.shape().dims();
        let image = image.contiguous();
        with_float!(image, F => {
            let mut part = vec![F::default(); height * width * count];
            copy(image.elements::<F>(), total, first, &mut part, count, 0, [height, width], count);
            float_tensor::<B>(part, [height, width, count])
        })
    }

    fn channels_backward(v: FloatTensor<B>, first: usize, total: usize) -> FloatTensor<B> {
        let [height, width, count] = v.shape().dims();
        let v = v.contiguous();
        with_float!(v, F => {
            let mut whole = vec![F::default(); height * width * total];
            copy(v.elements::<F>(), count, 0, &mut whole, total, first, [height, width], count);
            float_tensor::<B>(whole, [height, width, total])
        })
    }
}

/// Copies `count` channels of every pixel from channel `from_first` of `from_total` to channel `to_first` of `to_total`.
fn copy<F: Copy + Send + Sync>(
    from: &[F],
    from_total: usize,
    from_first: usize,
    to: &mut [F],
    to_total: usize,
    to_first: usize,
    [height, width]: [usize; 2],
    count: usize,
) {
    if height * width * count == 0 {
        return;
    }
    let rows = to.par_chunks_exact_mut(width * to_total).zip(from.par_chunks_exact(width * from_total));
    rows.for_each(|(to, from)| {
        for (to, from) in to.chunks_exact_mut(to_total).zip(from.chunks_exact(from_total)) {
            to[to_first..to_first + count].copy_from_slice(&from[from_first..from_first + count]);
        }
    });
}

/// State saved for the backward pass.
#[derive(Clone, Debug)]
struct ChannelsState {
    first: usize,
    total: usize,
}

#[derive(Debug)]
struct ChannelsBackward;

impl<B: ChannelsKernels> Backward<B, 1> for ChannelsBackward {
    type State = ChannelsState;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let v = grads.consume::<B>(&ops.node);
        let ChannelsState { first, total } = ops.state;
        if let [Some(image)] = ops.parents {
            grads.register::<B>(image.id, B::channels_backward(v, first, total));
        }
    }
}

impl<B: ChannelsKernels, C: CheckpointStrategy> ChannelsOps for Autodiff<B, C> {
    fn channels(image: FloatTensor<Self>, first: usize, count: usize) -> FloatTensor<Self> {
        let (image, node) = image.into_parts();
        let total = image.shape()[2];
        match ChannelsBackward.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                prep.finish(ChannelsState { first, total }, B::channels_forward(image, first, count))
            }
            OpsKind::UnTracked(prep) => prep.finish(B::channels_forward(image, first, count)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, assert_same_gradients, gradient_of};

    #[test]
    fn channels_are_those_narrowed_to() {
        for (first, count) in [(0, 3), (4, 1), (1, 4), (0, 5)] {
            let image = Random(13).tensor([7, 6, 5], -1.0, 1.0).require_grad();
            let expected = image.clone().narrow(2, first, count);
            let actual = channels(image.clone(), first, count);
            assert_same_gradients(actual, expected, &[("image", &gradient_of(&image))]);
        }
    }
}
