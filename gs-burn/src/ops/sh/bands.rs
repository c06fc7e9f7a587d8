//! Colours of degree 3 with the third band in a tensor of its own; see [`ShCoefficients`](crate::ShCoefficients).

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, backend_extension};
use burn::tensor::{Slice, Tensor, assert_shape};
use gs_kernels::config::{SH_BELOW_THIRD, SH_THIRD};
use gs_kernels::cpu::sh::MAX_COEFFICIENTS;

use super::{ShConfig, ShGradients, ShKernels, check, sh_colors_reference};
use crate::ops::assert_same_dtype;
use crate::ops::gradient::{self, Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use crate::profile;
use crate::slices::HostBackend;

/// All coefficients at degree 3.
const WHOLE: ShConfig = ShConfig { degree: 3, coefficients: MAX_COEFFICIENTS };

/// [`sh_colors`](super::sh_colors) at degree 3 with the coefficients in two tensors: `sh` `[N, 9, 3]` has those below the third degree,
/// `third` `[N, 7, 3]` those of the third degree. Differentiable with respect to both, `means` and `viewmat`.
///
/// # Panics
/// When shapes or float types disagree.
pub fn sh_colors_of_bands(
    means: Tensor<2>,
    sh: Tensor<3>,
    third: Tensor<3>,
    viewmat: Tensor<2>,
    projected: Tensor<2>,
) -> Tensor<2> {
    check_bands(&means, &sh, &third, &viewmat, &projected);
    let _stage = profile::stage("spherical harmonics");
    Tensor::from_dispatch(Dispatch::sh_colors_of_bands(
        means.into_dispatch(),
        sh.into_dispatch(),
        third.into_dispatch(),
        viewmat.into_dispatch(),
        // The rows get no gradient, so they are kept outside the graph.
        projected.inner().into_dispatch(),
    ))
}

/// Reference of [`sh_colors_of_bands`]: that of all coefficients in one tensor.
///
/// # Panics
/// When shapes or float types disagree.
pub fn sh_colors_of_bands_reference(
    means: Tensor<2>,
    sh: Tensor<3>,
    third: Tensor<3>,
    viewmat: Tensor<2>,
    projected: Tensor<2>,
) -> Tensor<2> {
    check_bands(&means, &sh, &third, &viewmat, &projected);
    sh_colors_reference(means, Tensor::cat(vec![sh, third], 1), viewmat, projected, 3)
}

fn check_bands(means: &Tensor<2>, sh: &Tensor<3>, third: &Tensor<3>, viewmat: &Tensor<2>, projected: &Tensor<2>) {
    let [count, _] = means.dims();
    check(means, sh, viewmat, projected, 2);
    assert_shape!(sh, [count, SH_BELOW_THIRD, 3]);
    assert_shape!(third, [count, SH_THIRD, 3]);
    assert_same_dtype("third", third, "means", means);
}

/// Burn's dispatch for [`sh_colors_of_bands`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait ShBandOps: Backend {
    /// See [`sh_colors_of_bands`]; not differentiable with respect to `projected`.
    fn sh_colors_of_bands(
        means: FloatTensor<Self>,
        sh: FloatTensor<Self>,
        third: FloatTensor<Self>,
        viewmat: FloatTensor<Self>,
        projected: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

/// Gradients of [`ShBandKernels::bands_forward`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct ShBandGradients<B: Backend> {
    /// `[N, 3]`, through the view direction.
    pub means: FloatTensor<B>,
    /// `[N, 9, 3]`.
    pub sh: FloatTensor<B>,
    /// `[N, 7, 3]`.
    pub third: FloatTensor<B>,
    /// `[4, 4]`, through the camera centre.
    pub viewmat: Option<FloatTensor<B>>,
}

/// Colours on a backend's primitives, without gradient tracking. Shapes as in [`sh_colors_of_bands`]; tensors may be strided. The
/// default bodies join the two tensors; a CPU has no limit that forbids it.
pub trait ShBandKernels: ShKernels {
    /// Colours `[N, 3]`.
    fn bands_forward(
        means: FloatTensor<Self>,
        sh: FloatTensor<Self>,
        third: FloatTensor<Self>,
        viewmat: FloatTensor<Self>,
        projected: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        Self::sh_forward(means, Self::float_cat(vec![sh, third], 1), viewmat, projected, &WHOLE)
    }

    /// Gradients from `v_colors` `[N, 3]`, as those of [`ShKernels::sh_backward`].
    fn bands_backward(
        means: FloatTensor<Self>,
        sh: FloatTensor<Self>,
        third: FloatTensor<Self>,
        viewmat: FloatTensor<Self>,
        projected: FloatTensor<Self>,
        v_colors: FloatTensor<Self>,
        of_pose: bool,
    ) -> ShBandGradients<Self> {
        let joined = Self::float_cat(vec![sh, third], 1);
        let ShGradients { means, sh, viewmat } =
            Self::sh_backward(means, joined, viewmat, projected, &WHOLE, v_colors, of_pose);
        let band = |first: usize, end: usize| {
            Self::float_slice(sh.clone(), &[Slice::full(), Slice::from(first..end), Slice::full()])
        };
        let (below, third) = (band(0, SH_BELOW_THIRD), band(SH_BELOW_THIRD, MAX_COEFFICIENTS));
        ShBandGradients { means, sh: below, third, viewmat }
    }
}

impl<B: HostBackend> ShBandKernels for B {}

impl<B: ShBandKernels> ShBandOps for B {
    fn sh_colors_of_bands(
        means: FloatTensor<B>,
        sh: FloatTensor<B>,
        third: FloatTensor<B>,
        viewmat: FloatTensor<B>,
        projected: FloatTensor<B>,
    ) -> FloatTensor<B> {
        B::bands_forward(means, sh, third, viewmat, projected)
    }
}

/// State saved for the backward pass.
#[derive(Clone, Debug)]
struct ShBandState<B: Backend> {
    means: FloatTensor<B>,
    sh: FloatTensor<B>,
    third: FloatTensor<B>,
    viewmat: FloatTensor<B>,
    projected: FloatTensor<B>,
}

#[derive(Debug)]
struct ShBandBackward;

impl<B: ShBandKernels> Backward<B, 4> for ShBandBackward {
    type State = ShBandState<B>;

    fn backward(self, ops: Ops<Self::State, 4>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let _stage = profile::stage("spherical harmonics, backward");
        let v_colors = grads.consume::<B>(&ops.node);
        let [of_means, of_sh, of_third, of_viewmat] = ops.parents.map(|node| node.map(|node| node.id));
        let ShBandState { means, sh, third, viewmat, projected } = ops.state;
        let gradients = B::bands_backward(means, sh, third, viewmat, projected, v_colors, of_viewmat.is_some());
        let ShBandGradients { means, sh, third, viewmat } = gradients;
        gradient::register::<B, 3>(grads, [of_means, of_sh, of_third], [means, sh, third]);
        if let (Some(node), Some(viewmat)) = (of_viewmat, viewmat) {
            grads.register::<B>(node, viewmat);
        }
    }
}

impl<B: ShBandKernels, C: CheckpointStrategy> ShBandOps for Autodiff<B, C> {
    fn sh_colors_of_bands(
        means: FloatTensor<Self>,
        sh: FloatTensor<Self>,
        third: FloatTensor<Self>,
        viewmat: FloatTensor<Self>,
        projected: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let (means, means_node) = means.into_parts();
        let (sh, sh_node) = sh.into_parts();
        let (third, third_node) = third.into_parts();
        let (viewmat, viewmat_node) = viewmat.into_parts();
        let projected = projected.into_primitive();
        let nodes = [means_node, sh_node, third_node, viewmat_node];
        match ShBandBackward.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let state = ShBandState { means, sh, third, viewmat, projected };
                let ShBandState { means, sh, third, viewmat, projected } = state.clone();
                prep.finish(state, B::bands_forward(means, sh, third, viewmat, projected))
            }
            OpsKind::UnTracked(prep) => prep.finish(B::bands_forward(means, sh, third, viewmat, projected)),
        }
    }
}
