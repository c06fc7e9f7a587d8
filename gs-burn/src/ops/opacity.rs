//! From logits to opacities, in one pass each way.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::Tensor;
use gs_kernels::cpu::opacity as cpu;

use super::gradient::{Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};

/// Opacities `[N]`, 0 to 1, of `logits` `[N]`: `1 / (1 + exp(-logit))`; 0 where the logit is not a number, and that logit receives no
/// gradient. Differentiable.
pub fn opacities(logits: Tensor<1>) -> Tensor<1> {
    Tensor::from_dispatch(Dispatch::opacities(logits.into_dispatch()))
}

/// [`opacities`] in Burn's tensor operations: the definition.
pub fn opacities_reference(logits: Tensor<1>) -> Tensor<1> {
    let broken = logits.clone().is_nan();
    // With NaN left in place, even a gradient of zero would come back as 0 * NaN.
    let known = logits.mask_fill(broken.clone(), 0.0);
    // Burn's default sigmoid computes in f32 for any type.
    ((known * 0.5).tanh() * 0.5 + 0.5).mask_fill(broken, 0.0)
}

/// Burn's dispatch for [`opacities`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait OpacityOps: Backend {
    /// See [`opacities`].
    fn opacities(logits: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// Both directions on a backend's primitives, without gradient tracking. Tensors may be strided.
pub trait OpacityKernels: Backend {
    /// `[N]` from `[N]`.
    fn opacity_forward(logits: FloatTensor<Self>) -> FloatTensor<Self>;

    /// The gradient by `logits` from `v` by the opacities, `[N]`.
    fn opacity_backward(logits: FloatTensor<Self>, v: FloatTensor<Self>) -> FloatTensor<Self>;
}

impl<B: OpacityKernels> OpacityOps for B {
    fn opacities(logits: FloatTensor<B>) -> FloatTensor<B> {
        B::opacity_forward(logits)
    }
}

impl<B: HostBackend> OpacityKernels for B {
    fn opacity_forward(logits: FloatTensor<B>) -> FloatTensor<B> {
        let (logits, shape) = (logits.clone().contiguous(), logits.shape());
        with_float!(logits, F => float_tensor::<B>(cpu::forward::<F>(logits.elements()), shape))
    }

    fn opacity_backward(logits: FloatTensor<B>, v: FloatTensor<B>) -> FloatTensor<B> {
        let shape = logits.shape();
        let [logits, v] = [logits, v].map(HostTensor::contiguous);
        with_float!(logits, F => float_tensor::<B>(cpu::backward::<F>(logits.elements(), v.elements()), shape))
    }
}

#[derive(Debug)]
struct OpacityBackward;

impl<B: OpacityKernels> Backward<B, 1> for OpacityBackward {
    type State = FloatTensor<B>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let v = grads.consume::<B>(&ops.node);
        if let [Some(logits)] = ops.parents {
            grads.register::<B>(logits.id, B::opacity_backward(ops.state, v));
        }
    }
}

impl<B: OpacityKernels, C: CheckpointStrategy> OpacityOps for Autodiff<B, C> {
    fn opacities(logits: FloatTensor<Self>) -> FloatTensor<Self> {
        let (logits, node) = logits.into_parts();
        let opacities = B::opacity_forward(logits.clone());
        match OpacityBackward.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(logits, opacities),
            OpsKind::UnTracked(prep) => prep.finish(opacities),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, assert_same_gradients, gradient_of};

    #[test]
    fn both_ways_are_the_definition() {
        let logits = Random(3).tensor([40], -9.0, 9.0).require_grad();
        let [actual, expected] = [opacities(logits.clone()), opacities_reference(logits.clone())];
        assert_same_gradients(actual, expected, &[("logits", &gradient_of(&logits))]);
    }
}
