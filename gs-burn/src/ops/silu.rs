//! The activation SiLU, on a CPU in one pass each way. Burn's own takes six passes, two of them with an exponential by
//! number: in the rollout of a dynamics field they took half of a step.

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::Tensor;
use gs_kernels::cpu::silu as cpu;

use super::operation::{Operation, Output, State, differentiable};
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// `x / (1 + exp(-x))` of each of `values` `[R, C]`. Differentiable.
pub fn silu(values: Tensor<2>) -> Tensor<2> {
    differentiable(Silu, [values.into_dispatch()], [])
}

/// [`silu`] in Burn's tensor operations: the definition.
pub fn silu_reference(values: Tensor<2>) -> Tensor<2> {
    values.clone() / ((-values).exp() + 1.0)
}

/// [`silu`] as an operation.
#[derive(Clone, Debug)]
pub(crate) struct Silu;

impl Operation<1> for Silu {
    fn forward<B: HostBackend>(&self, [x]: [FloatTensor<B>; 1], []: [IntTensor<B>; 0], _: bool) -> Output<B> {
        let shape = x.shape();
        with_float!(x, F => Output::of(float_tensor::<B>(cpu::forward::<F>(x.elements()), shape)))
    }

    fn backward<B: HostBackend>(
        &self,
        mut state: State<B, 1, 0>,
        v: FloatTensor<B>,
        _: [bool; 1],
    ) -> [Option<FloatTensor<B>>; 1] {
        let [x] = state.inputs();
        let shape = x.shape();
        with_float!(x, F => [Some(float_tensor::<B>(cpu::backward::<F>(x.elements(), v.elements()), shape))])
    }
}
