//! The photometric loss: mean absolute error and structural similarity in one pass; see [`gs_kernels::cpu::ssim`].

mod reference;

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{Tensor, assert_shape};
use gs_kernels::cpu::ssim as cpu;

use super::assert_same_dtype;
use super::operation::{Operation, Output, State, Tensors, differentiable};
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
    differentiable(Comparison { dssim: None }, [image, target].map(Tensor::into_dispatch), [])
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
    differentiable(Comparison { dssim: Some(lambda_dssim) }, [image, target].map(Tensor::into_dispatch), [])
}

fn check(image: &Tensor<3>, target: &Tensor<3>) {
    let [height, width, channels] = image.dims();
    assert_shape!(target, [height, width, channels]);
    assert_same_dtype("target", target, "image", image);
}

/// [`l1_ssim`], or with a factor [`photometric_loss`], as an operation. On the CPU it saves the gradient of SSIM with
/// respect to the image, `[H, W, C]`; on a GPU the derivatives of each pixel's SSIM with respect to the window's mean,
/// mean square and mean product, three tensors `[H, W, C]`.
#[derive(Clone, Debug)]
pub(crate) struct Comparison {
    /// The factor of the loss, if the result is one: `(1 - dssim) terms[0] + dssim (1 - terms[1])`.
    pub(crate) dssim: Option<f64>,
}

impl Comparison {
    /// The gradients by both images. That by the target is the one by the image with exchanged roles, because both
    /// terms are symmetric. A tracked target is rare, so its maps are made only then.
    pub(crate) fn by_both<T: Clone, M>(
        [image, target]: [T; 2],
        saved: M,
        wanted: [bool; 2],
        maps: impl Fn(T, T) -> M,
        gradient: impl Fn(T, T, M) -> T,
    ) -> [Option<T>; 2] {
        let by_target = wanted[1].then(|| {
            let swapped = maps(target.clone(), image.clone());
            gradient(target.clone(), image.clone(), swapped)
        });
        [wanted[0].then(|| gradient(image, target, saved)), by_target]
    }
}

/// Both terms `[2]`, and SSIM's gradient by the image for the backward pass.
fn compare<B: HostBackend>(
    image: &FloatTensor<B>,
    target: &FloatTensor<B>,
    tracked: bool,
) -> (FloatTensor<B>, Option<FloatTensor<B>>) {
    let [height, width, channels] = image.shape().dims();
    with_float!(*image, F => {
        let result = cpu::forward::<F>(image.elements(), target.elements(), width, height, channels, tracked);
        let gradient = || float_tensor::<B>(result.gradient, [height, width, channels]);
        (float_tensor::<B>(vec![result.l1, result.ssim], [2]), tracked.then(gradient))
    })
}

/// Gradient with respect to `image` `[H, W, C]`, from that of SSIM and `v_terms` `[2]`.
fn by_image<B: HostBackend>(
    image: FloatTensor<B>,
    target: FloatTensor<B>,
    mut gradient: FloatTensor<B>,
    v_terms: &FloatTensor<B>,
) -> FloatTensor<B> {
    with_float!(image, F => {
        let v_terms: &[F] = v_terms.elements();
        cpu::backward::<F>(image.elements(), target.elements(), gradient.elements_mut(), v_terms[0], v_terms[1]);
    });
    gradient
}

impl Operation<2> for Comparison {
    const BACKWARD: Option<&'static str> = Some("photometric loss, backward");

    fn forward<B: HostBackend>(
        &self,
        [image, target]: [FloatTensor<B>; 2],
        []: [IntTensor<B>; 0],
        tracked: bool,
    ) -> Output<B> {
        let (terms, gradient) = compare::<B>(&image, &target, tracked);
        let tensor = match self.dssim {
            None => terms,
            Some(dssim) => with_float!(terms, F => {
                let (terms, dssim): (&[F], F) = (terms.elements(), dssim as F);
                float_tensor::<B>(vec![(1.0 - dssim) * terms[0] + dssim * (1.0 - terms[1])], [1])
            }),
        };
        Output { tensor, saved: gradient.map_or_else(Tensors::none, |gradient| Tensors::of_floats([gradient])) }
    }

    fn backward<B: HostBackend>(
        &self,
        mut state: State<B, 2, 0>,
        v: FloatTensor<B>,
        wanted: [bool; 2],
    ) -> [Option<FloatTensor<B>>; 2] {
        let v_terms = match self.dssim {
            None => v,
            Some(dssim) => with_float!(v, F => {
                let (v, dssim): (&[F], F) = (v.elements(), dssim as F);
                float_tensor::<B>(vec![(1.0 - dssim) * v[0], -dssim * v[0]], [2])
            }),
        };
        let (inputs, ([gradient], [])) = (state.inputs(), state.saved.into_arrays());
        let swapped = |target, image| compare::<B>(&target, &image, true).1.expect("a gradient was asked for");
        let by_image = |image, target, gradient| by_image::<B>(image, target, gradient, &v_terms);
        Self::by_both(inputs, gradient, wanted, swapped, by_image)
    }
}
