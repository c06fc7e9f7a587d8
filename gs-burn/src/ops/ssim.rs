//! The photometric loss: mean absolute error and structural similarity in one pass; see [`gs_kernels::cpu::ssim`].

mod reference;
#[cfg(test)]
mod tests;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{Tensor, assert_shape};
use gs_kernels::cpu::ssim as cpu;

use super::assert_same_dtype;
use super::gradient::{Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};
pub use reference::l1_ssim_reference;

/// Mean absolute difference and mean structural similarity of two images.
///
/// `image` and `target` are `[H, W, C]` in 0..1. The similarity (Wang et al. 2004) uses an 11 x 11 Gaussian window of
/// standard deviation 1.5 px over each channel, zeros beyond the border, and averages over all pixels and channels.
///
/// Returns `[2]`: mean L1, mean SSIM. Differentiable with respect to both images.
///
/// # Panics
/// When shapes or float types disagree.
pub fn l1_ssim(image: Tensor<3>, target: Tensor<3>) -> Tensor<1> {
    check(&image, &target);
    Tensor::from_dispatch(Dispatch::l1_ssim(image.into_dispatch(), target.into_dispatch()))
}

/// The loss of 3DGS, `(1 - lambda_dssim) L1 + lambda_dssim (1 - SSIM)`, `[1]`.
///
/// `image` and `target` are `[H, W, C]` in 0..1; 3DGS uses `lambda_dssim` = 0.2.
///
/// # Panics
/// When shapes or float types disagree.
pub fn photometric_loss(image: Tensor<3>, target: Tensor<3>, lambda_dssim: f64) -> Tensor<1> {
    let _stage = profile::stage("photometric loss");
    check(&image, &target);
    Tensor::from_dispatch(Dispatch::photometric_loss(image.into_dispatch(), target.into_dispatch(), lambda_dssim))
}

fn check(image: &Tensor<3>, target: &Tensor<3>) {
    let [height, width, channels] = image.dims();
    assert_shape!(target, [height, width, channels]);
    assert_same_dtype("target", target, "image", image);
}

/// Burn's dispatch for [`l1_ssim`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait SsimOps: Backend {
    /// See [`l1_ssim`].
    fn l1_ssim(image: FloatTensor<Self>, target: FloatTensor<Self>) -> FloatTensor<Self>;

    /// See [`photometric_loss`].
    fn photometric_loss(image: FloatTensor<Self>, target: FloatTensor<Self>, dssim: f64) -> FloatTensor<Self>;
}

/// Result of [`SsimKernels::ssim_forward`].
#[derive(Clone, Debug)]
pub struct SsimForward<B: Backend> {
    /// `[2]`: mean L1, mean SSIM.
    pub terms: FloatTensor<B>,
    /// `[3, H, W, C]`: derivatives of each pixel's SSIM with respect to the window's mean, mean square and mean product.
    pub saved: FloatTensor<B>,
}

/// The comparison on a backend's primitives, without gradient tracking. Shapes as in [`l1_ssim`]; tensors may be strided.
pub trait SsimKernels: Backend {
    /// Both terms, and the state for the backward pass.
    fn ssim_forward(image: FloatTensor<Self>, target: FloatTensor<Self>) -> SsimForward<Self>;

    /// `(1 - dssim) terms[0] + dssim (1 - terms[1])`, `[1]`.
    fn ssim_loss(terms: FloatTensor<Self>, dssim: f64) -> FloatTensor<Self>;

    /// The gradient by the terms `[2]` from `v` `[1]` by [`ssim_loss`](Self::ssim_loss).
    fn ssim_loss_backward(v: FloatTensor<Self>, dssim: f64) -> FloatTensor<Self>;

    /// Gradient with respect to `image` `[H, W, C]`, from `v_terms` `[2]`. The gradient with respect to `target` is the same with
    /// exchanged roles, because both terms are symmetric.
    fn ssim_backward(
        image: FloatTensor<Self>,
        target: FloatTensor<Self>,
        saved: FloatTensor<Self>,
        v_terms: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

impl<B: SsimKernels> SsimOps for B {
    fn l1_ssim(image: FloatTensor<B>, target: FloatTensor<B>) -> FloatTensor<B> {
        B::ssim_forward(image, target).terms
    }

    fn photometric_loss(image: FloatTensor<B>, target: FloatTensor<B>, dssim: f64) -> FloatTensor<B> {
        B::ssim_loss(B::ssim_forward(image, target).terms, dssim)
    }
}

impl<B: HostBackend> SsimKernels for B {
    fn ssim_forward(image: FloatTensor<B>, target: FloatTensor<B>) -> SsimForward<B> {
        let [height, width, channels] = image.shape().dims();
        let [image, target] = [image, target].map(HostTensor::contiguous);
        with_float!(image, F => {
            let result = cpu::forward::<F>(image.elements(), target.elements(), width, height, channels);
            SsimForward {
                terms: float_tensor::<B>(vec![result.l1, result.ssim], [2]),
                saved: float_tensor::<B>(result.saved, [3, height, width, channels]),
            }
        })
    }

    fn ssim_loss(terms: FloatTensor<B>, dssim: f64) -> FloatTensor<B> {
        let terms = terms.contiguous();
        with_float!(terms, F => {
            let (terms, dssim): (&[F], F) = (terms.elements(), dssim as F);
            float_tensor::<B>(vec![(1.0 - dssim) * terms[0] + dssim * (1.0 - terms[1])], [1])
        })
    }

    fn ssim_loss_backward(v: FloatTensor<B>, dssim: f64) -> FloatTensor<B> {
        let v = v.contiguous();
        with_float!(v, F => {
            let (v, dssim): (&[F], F) = (v.elements(), dssim as F);
            float_tensor::<B>(vec![(1.0 - dssim) * v[0], -dssim * v[0]], [2])
        })
    }

    fn ssim_backward(
        image: FloatTensor<B>,
        target: FloatTensor<B>,
        saved: FloatTensor<B>,
        v_terms: FloatTensor<B>,
    ) -> FloatTensor<B> {
        let [height, width, channels] = image.shape().dims();
        let [image, target, saved, v_terms] = [image, target, saved, v_terms].map(HostTensor::contiguous);
        with_float!(image, F => {
            let v_terms: &[F] = v_terms.elements();
            let v_image = cpu::backward::<F>(
                image.elements(), target.elements(), saved.elements(), width, height, channels, v_terms[0], v_terms[1],
            );
            float_tensor::<B>(v_image, [height, width, channels])
        })
    }
}

/// State saved for the backward pass.
#[derive(Clone, Debug)]
struct SsimState<B: Backend> {
    image: FloatTensor<B>,
    target: FloatTensor<B>,
    saved: FloatTensor<B>,
    /// The weight of SSIM if the result is the loss, `None` if it is the two terms.
    loss: Option<f64>,
}

#[derive(Debug)]
struct SsimBackward;

impl<B: SsimKernels> Backward<B, 2> for SsimBackward {
    type State = SsimState<B>;

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let _stage = profile::stage("photometric loss, backward");
        let v_terms = grads.consume::<B>(&ops.node);
        let [image_node, target_node] = ops.parents;
        let SsimState { image, target, saved, loss } = ops.state;
        let v_terms = match loss {
            Some(dssim) => B::ssim_loss_backward(v_terms, dssim),
            None => v_terms,
        };
        if let Some(node) = target_node {
            // A tracked target is rare, so its maps are made only now.
            let swapped = B::ssim_forward(target.clone(), image.clone()).saved;
            grads.register::<B>(node.id, B::ssim_backward(target.clone(), image.clone(), swapped, v_terms.clone()));
        }
        if let Some(node) = image_node {
            grads.register::<B>(node.id, B::ssim_backward(image, target, saved, v_terms));
        }
    }
}

/// The terms, or the loss, with their backward in the graph.
fn tracked<B: SsimKernels, C: CheckpointStrategy>(
    image: FloatTensor<Autodiff<B, C>>,
    target: FloatTensor<Autodiff<B, C>>,
    loss: Option<f64>,
) -> FloatTensor<Autodiff<B, C>> {
    let (image, image_node) = image.into_parts();
    let (target, target_node) = target.into_parts();
    let SsimForward { terms, saved } = B::ssim_forward(image.clone(), target.clone());
    let result = match loss {
        Some(dssim) => B::ssim_loss(terms, dssim),
        None => terms,
    };
    match SsimBackward.prepare::<C>([image_node, target_node]).compute_bound().stateful() {
        OpsKind::Tracked(prep) => prep.finish(SsimState { image, target, saved, loss }, result),
        OpsKind::UnTracked(prep) => prep.finish(result),
    }
}

impl<B: SsimKernels, C: CheckpointStrategy> SsimOps for Autodiff<B, C> {
    fn l1_ssim(image: FloatTensor<Self>, target: FloatTensor<Self>) -> FloatTensor<Self> {
        tracked::<B, C>(image, target, None)
    }

    fn photometric_loss(image: FloatTensor<Self>, target: FloatTensor<Self>, dssim: f64) -> FloatTensor<Self> {
        tracked::<B, C>(image, target, Some(dssim))
    }
}
