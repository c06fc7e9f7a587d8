//! From logits to opacities, in one pass each way.

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::Tensor;
use gs_kernels::cpu::opacity as cpu;

use super::operation::{Operation, Output, State, differentiable};
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// Opacities `[N]`, 0 to 1, of `logits` `[N]`: `1 / (1 + exp(-logit))`; 0 where the logit is not a number, and that
/// logit receives no gradient. Differentiable.
pub fn opacities(logits: Tensor<1>) -> Tensor<1> {
    differentiable(Opacities, [logits.into_dispatch()], [])
}

/// [`opacities`] in Burn's tensor operations: the definition.
pub fn opacities_reference(logits: Tensor<1>) -> Tensor<1> {
    let broken = logits.clone().is_nan();
    // With NaN left in place, even a gradient of zero would come back as 0 * NaN.
    let known = logits.mask_fill(broken.clone(), 0.0);
    // Burn's default sigmoid computes in f32 for any type.
    ((known * 0.5).tanh() * 0.5 + 0.5).mask_fill(broken, 0.0)
}

/// [`opacities`] as an operation.
#[derive(Clone, Debug)]
pub(crate) struct Opacities;

impl Operation<1> for Opacities {
    fn forward<B: HostBackend>(&self, [logits]: [FloatTensor<B>; 1], []: [IntTensor<B>; 0], _: bool) -> Output<B> {
        let shape = logits.shape();
        with_float!(logits, F => Output::of(float_tensor::<B>(cpu::forward::<F>(logits.elements()), shape)))
    }

    fn backward<B: HostBackend>(
        &self,
        mut state: State<B, 1, 0>,
        v: FloatTensor<B>,
        _: [bool; 1],
    ) -> [Option<FloatTensor<B>>; 1] {
        let [logits] = state.inputs();
        let shape = logits.shape();
        with_float!(logits, F => {
            [Some(float_tensor::<B>(cpu::backward::<F>(logits.elements(), v.elements()), shape))]
        })
    }
}
