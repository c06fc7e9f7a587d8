//! Sums of all numbers of a tensor in a fixed order, and whether all are finite.
//!
//! On a GPU, Burn's `sum` and `mean` run on one thread or on four cubes (without its autotuner), or add with float
//! atomics, whose order changes from run to run. These sums take two launches of many cubes and have one order, so
//! equal inputs give equal bits.

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::{Shape, Tensor};
pub use gs_kernels::config::Activation;
use gs_kernels::cpu::sum as cpu;

use super::operation::{Computation, Operation, Output, State, Tensors, computed_tensor, differentiable};
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// The sum of all numbers of `tensor`, `[1]`; 0 without numbers. Differentiable.
///
/// The order of additions depends on the number of numbers alone. The reference is Burn's `sum`.
pub fn sum<const D: usize>(tensor: Tensor<D>) -> Tensor<1> {
    differentiable(Sum { shape: tensor.shape() }, [tensor.into_dispatch()], [])
}

/// The mean of all numbers of `tensor`, `[1]`; not a number without numbers. Differentiable.
pub fn mean<const D: usize>(tensor: Tensor<D>) -> Tensor<1> {
    let count = tensor.dims().iter().product::<usize>();
    // The gradient of Burn's division by a number is rounded to f32, that of a product is not.
    sum(tensor) * (1.0 / count as f64)
}

/// `factor` times the sum of the activations of all numbers of `tensor`, `[1]`: a regulariser in one pass each way.
/// Differentiable.
pub fn activated_sum<const D: usize>(tensor: Tensor<D>, activation: Activation, factor: f64) -> Tensor<1> {
    differentiable(ActivatedSum { activation, factor }, [tensor.into_dispatch()], [])
}

/// `mark` `[1]` (0 if `None`), made NaN if a number of `tensor` is not finite. Gradient tracking is dropped. A chain of
/// marks takes one launch a tensor and is read once.
pub fn mark_not_finite<const D: usize>(mark: Option<Tensor<1>>, tensor: Tensor<D>) -> Tensor<1> {
    let tensor = tensor.inner();
    let mark = mark.unwrap_or_else(|| Tensor::zeros([1], (&tensor.device(), tensor.dtype())));
    computed_tensor(MarkNotFinite, [mark.inner().into_dispatch(), tensor.into_dispatch()])
}

/// The largest number of `tensor`, `[1]`. Gradient tracking is dropped.
pub fn largest<const D: usize>(tensor: Tensor<D>) -> Tensor<1> {
    computed_tensor(Largest, [tensor.inner().into_dispatch()])
}

/// [`sum`] as an operation on a tensor of this shape.
#[derive(Clone, Debug)]
pub(crate) struct Sum {
    shape: Shape,
}

impl Sum {
    /// The gradient: `v` for every number.
    pub(crate) fn gradient<B: Backend>(&self, v: FloatTensor<B>) -> FloatTensor<B> {
        let one = B::float_reshape(v, Shape::from(vec![1; self.shape.num_dims()]));
        B::float_expand(one, self.shape.clone())
    }
}

impl Operation<1> for Sum {
    const READS_INPUTS: bool = false;

    fn forward<B: HostBackend>(&self, [tensor]: [FloatTensor<B>; 1], []: [IntTensor<B>; 0], _: bool) -> Output<B> {
        with_float!(tensor, F => Output::of(float_tensor::<B>(vec![cpu::sum::<F>(tensor.elements())], [1])))
    }

    fn backward<B: HostBackend>(
        &self,
        _: State<B, 1, 0>,
        v: FloatTensor<B>,
        _: [bool; 1],
    ) -> [Option<FloatTensor<B>>; 1] {
        [Some(self.gradient::<B>(v))]
    }
}

/// [`activated_sum`] as an operation.
#[derive(Clone, Debug)]
pub(crate) struct ActivatedSum {
    pub(crate) activation: Activation,
    pub(crate) factor: f64,
}

impl Operation<1> for ActivatedSum {
    fn forward<B: HostBackend>(&self, [tensor]: [FloatTensor<B>; 1], []: [IntTensor<B>; 0], _: bool) -> Output<B> {
        with_float!(tensor, F => {
            let total = cpu::activated::<F>(tensor.elements(), self.activation, self.factor as F);
            Output::of(float_tensor::<B>(vec![total], [1]))
        })
    }

    fn backward<B: HostBackend>(
        &self,
        mut state: State<B, 1, 0>,
        v: FloatTensor<B>,
        _: [bool; 1],
    ) -> [Option<FloatTensor<B>>; 1] {
        let [tensor] = state.inputs();
        with_float!(tensor, F => {
            let (v, factor): (&[F], F) = (v.elements(), self.factor as F);
            let gradient = cpu::activated_backward::<F>(tensor.elements(), v[0], self.activation, factor);
            [Some(float_tensor::<B>(gradient, tensor.shape()))]
        })
    }
}

/// [`mark_not_finite`] as a computation on the mark and a tensor.
pub(crate) struct MarkNotFinite;

impl Computation<2> for MarkNotFinite {
    fn compute<B: HostBackend>(&self, [mark, tensor]: [FloatTensor<B>; 2], []: [IntTensor<B>; 0]) -> Tensors<B> {
        let mark = with_float!(tensor, F => match cpu::all_finite::<F>(tensor.elements()) {
            true => mark,
            false => float_tensor::<B>(vec![F::NAN], [1]),
        });
        Tensors::of_floats([mark])
    }
}

/// [`largest`] as a computation.
pub(crate) struct Largest;

impl Computation<1> for Largest {
    fn compute<B: HostBackend>(&self, [tensor]: [FloatTensor<B>; 1], []: [IntTensor<B>; 0]) -> Tensors<B> {
        Tensors::of_floats([B::float_max(tensor)])
    }
}
