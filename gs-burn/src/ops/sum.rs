//! Sums of all numbers of a tensor in a fixed order, and whether all are finite.
//!
//! On a GPU, Burn's `sum` and `mean` run on one thread or on four cubes (without its autotuner), or add with float atomics, whose
//! order changes from run to run. These sums take two launches of many cubes and have one order, so equal inputs give equal bits.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{Shape, Tensor};
pub use gs_kernels::config::Activation;
use gs_kernels::cpu::sum as cpu;

use super::gradient::{Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// The sum of all numbers of `tensor`, `[1]`; 0 without numbers. Differentiable.
///
/// The order of additions depends on the number of numbers alone. The reference is Burn's `sum`.
pub fn sum<const D: usize>(tensor: Tensor<D>) -> Tensor<1> {
    Tensor::from_dispatch(Dispatch::sum_all(tensor.into_dispatch()))
}

/// The mean of all numbers of `tensor`, `[1]`; not a number without numbers. Differentiable.
pub fn mean<const D: usize>(tensor: Tensor<D>) -> Tensor<1> {
    let count = tensor.dims().iter().product::<usize>();
    // The gradient of Burn's division by a number is rounded to f32, that of a product is not.
    sum(tensor) * (1.0 / count as f64)
}

/// `factor` times the sum of the activations of all numbers of `tensor`, `[1]`: a regulariser in one pass each way. Differentiable.
pub fn activated_sum<const D: usize>(tensor: Tensor<D>, activation: Activation, factor: f64) -> Tensor<1> {
    Tensor::from_dispatch(Dispatch::activated_sum(tensor.into_dispatch(), activation, factor))
}

/// `mark` `[1]` (0 if `None`), made NaN if a number of `tensor` is not finite. Gradient tracking is dropped. A chain of marks takes
/// one launch a tensor and is read once.
pub fn mark_not_finite<const D: usize>(mark: Option<Tensor<1>>, tensor: Tensor<D>) -> Tensor<1> {
    let tensor = tensor.inner();
    let mark = mark.unwrap_or_else(|| Tensor::zeros([1], (&tensor.device(), tensor.dtype())));
    Tensor::from_dispatch(Dispatch::mark_not_finite(mark.inner().into_dispatch(), tensor.into_dispatch()))
}

/// The largest number of `tensor`, `[1]`. Gradient tracking is dropped.
pub fn largest<const D: usize>(tensor: Tensor<D>) -> Tensor<1> {
    Tensor::from_dispatch(Dispatch::largest(tensor.inner().into_dispatch()))
}

/// Burn's dispatch for [`sum`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait SumOps: Backend {
    /// See [`sum`].
    fn sum_all(tensor: FloatTensor<Self>) -> FloatTensor<Self>;

    /// See [`activated_sum`].
    fn activated_sum(tensor: FloatTensor<Self>, activation: Activation, factor: f64) -> FloatTensor<Self>;
}

/// Burn's dispatch for [`mark_not_finite`] and [`largest`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube")
)]
pub trait FiniteOps: Backend {
    /// See [`mark_not_finite`].
    fn mark_not_finite(mark: FloatTensor<Self>, tensor: FloatTensor<Self>) -> FloatTensor<Self>;

    /// See [`largest`].
    fn largest(tensor: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// Both on a backend's primitives, without gradient tracking. Tensors may be strided.
pub trait SumKernels: Backend {
    /// The sum of all numbers, `[1]`.
    fn sum_forward(tensor: FloatTensor<Self>) -> FloatTensor<Self>;

    /// `factor` times the sum of the activations, `[1]`.
    fn activated_sum_forward(tensor: FloatTensor<Self>, activation: Activation, factor: f64) -> FloatTensor<Self>;

    /// The gradient by `tensor` from `v` `[1]` by the sum.
    fn activated_sum_backward(
        tensor: FloatTensor<Self>,
        v: FloatTensor<Self>,
        activation: Activation,
        factor: f64,
    ) -> FloatTensor<Self>;

    /// `mark` `[1]`, or NaN if a number of `tensor` is not finite.
    fn finite_mark(mark: FloatTensor<Self>, tensor: FloatTensor<Self>) -> FloatTensor<Self>;

    /// The largest number, `[1]`.
    fn largest_of(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        Self::float_max(tensor)
    }
}

impl<B: SumKernels> SumOps for B {
    fn sum_all(tensor: FloatTensor<B>) -> FloatTensor<B> {
        B::sum_forward(tensor)
    }

    fn activated_sum(tensor: FloatTensor<B>, activation: Activation, factor: f64) -> FloatTensor<B> {
        B::activated_sum_forward(tensor, activation, factor)
    }
}

impl<B: SumKernels> FiniteOps for B {
    fn mark_not_finite(mark: FloatTensor<B>, tensor: FloatTensor<B>) -> FloatTensor<B> {
        B::finite_mark(mark, tensor)
    }

    fn largest(tensor: FloatTensor<B>) -> FloatTensor<B> {
        B::largest_of(tensor)
    }
}

impl<B: HostBackend> SumKernels for B {
    fn sum_forward(tensor: FloatTensor<B>) -> FloatTensor<B> {
        let tensor = tensor.contiguous();
        with_float!(tensor, F => float_tensor::<B>(vec![cpu::sum::<F>(tensor.elements())], [1]))
    }

    fn activated_sum_forward(tensor: FloatTensor<B>, activation: Activation, factor: f64) -> FloatTensor<B> {
        let tensor = tensor.contiguous();
        with_float!(tensor, F => {
            float_tensor::<B>(vec![cpu::activated::<F>(tensor.elements(), activation, factor as F)], [1])
        })
    }

    fn activated_sum_backward(
        tensor: FloatTensor<B>,
        v: FloatTensor<B>,
        activation: Activation,
        factor: f64,
    ) -> FloatTensor<B> {
        let [tensor, v] = [tensor, v].map(HostTensor::contiguous);
        let shape = tensor.shape();
        with_float!(tensor, F => {
            let v: &[F] = v.elements();
            float_tensor::<B>(cpu::activated_backward::<F>(tensor.elements(), v[0], activation, factor as F), shape)
        })
    }

    fn finite_mark(mark: FloatTensor<B>, tensor: FloatTensor<B>) -> FloatTensor<B> {
        let tensor = tensor.contiguous();
        with_float!(tensor, F => match cpu::all_finite::<F>(tensor.elements()) {
            true => mark,
            false => float_tensor::<B>(vec![F::NAN], [1]),
        })
    }
}

#[derive(Debug)]
struct SumBackward;

impl<B: SumKernels> Backward<B, 1> for SumBackward {
    type State = Shape;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let v = grads.consume::<B>(&ops.node);
        if let [Some(tensor)] = ops.parents {
            let shape = ops.state;
            let one = B::float_reshape(v, Shape::from(vec![1; shape.num_dims()]));
            grads.register::<B>(tensor.id, B::float_expand(one, shape));
        }
    }
}

impl<B: SumKernels, C: CheckpointStrategy> SumOps for Autodiff<B, C> {
    fn sum_all(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        let (tensor, node) = tensor.into_parts();
        let shape = tensor.shape();
        let total = B::sum_forward(tensor);
        match SumBackward.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(shape, total),
            OpsKind::UnTracked(prep) => prep.finish(total),
        }
    }

    fn activated_sum(tensor: FloatTensor<Self>, activation: Activation, factor: f64) -> FloatTensor<Self> {
        let (tensor, node) = tensor.into_parts();
        let total = B::activated_sum_forward(tensor.clone(), activation, factor);
        match ActivatedBackward.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(ActivatedState { tensor, activation, factor }, total),
            OpsKind::UnTracked(prep) => prep.finish(total),
        }
    }
}

/// State saved for the backward pass of [`activated_sum`].
#[derive(Clone, Debug)]
struct ActivatedState<B: Backend> {
    tensor: FloatTensor<B>,
    activation: Activation,
    factor: f64,
}

#[derive(Debug)]
struct ActivatedBackward;

impl<B: SumKernels> Backward<B, 1> for ActivatedBackward {
    type State = ActivatedState<B>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let v = grads.consume::<B>(&ops.node);
        let ActivatedState { tensor, activation, factor } = ops.state;
        if let [Some(node)] = ops.parents {
            grads.register::<B>(node.id, B::activated_sum_backward(tensor, v, activation, factor));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, assert_same_gradients, gradient_of, tensor, values};

    #[test]
    fn sums_and_means_are_burns() {
        let leaf = Random(4).tensor([5, 7, 3], -1.0, 1.0).require_grad();
        let squares = || leaf.clone().square();
        assert_same_gradients(sum(squares()), squares().sum(), &[("leaf", &gradient_of(&leaf))]);
        // The backward of Burn's `mean` divides in f32.
        assert_same_gradients(mean(squares()), squares().sum() * (1.0 / 105.0), &[("leaf", &gradient_of(&leaf))]);
        assert_eq!(values(&sum(tensor(Vec::new(), [0, 3]))), [0.0]);
    }

    #[test]
    fn sums_of_activations_are_sums_of_burns() {
        let leaf = Random(6).tensor([5, 3], -4.0, 2.0).require_grad();
        let of_leaf = gradient_of(&leaf);
        let actual = activated_sum(leaf.clone(), Activation::Exp, 0.25);
        assert_same_gradients(actual, leaf.clone().exp().sum() * 0.25, &[("leaf", &of_leaf)]);
        let actual = activated_sum(leaf.clone(), Activation::Sigmoid, 3.0);
        let sigmoid = crate::ops::opacity::opacities_reference(leaf.clone().flatten(0, 1));
        assert_same_gradients(actual, sigmoid.sum() * 3.0, &[("leaf", &of_leaf)]);
    }

    #[test]
    fn a_mark_stays() {
        let [fine, broken] = [1.0, f64::INFINITY].map(|x| tensor(vec![x, 2.0], [2]));
        let mark = mark_not_finite(None, fine.clone());
        assert_eq!(values(&mark), [0.0]);
        let mark = mark_not_finite(Some(mark_not_finite(Some(mark), broken)), fine);
        assert!(values(&mark)[0].is_nan());
    }
}
