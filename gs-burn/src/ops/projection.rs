//! 3D Gaussians to 2D ellipses in the image (EWA splatting); the formulas are in [`gs_kernels::cpu::projection`].

mod reference;
#[cfg(test)]
mod tests;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{Tensor, assert_shape};
pub use gs_kernels::config::ProjectionConfig;
use gs_kernels::cpu::projection as cpu;
use gs_kernels::rows::PROJECTED;

use super::assert_same_dtype;
use super::gradient::{self, Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};
pub use reference::project_reference;

/// Projects Gaussians into the image of a pinhole camera.
///
/// - `means` `[N, 3]`: world, scene units
/// - `quats` `[N, 4]`: orientations w x y z of any norm
/// - `log_scales` `[N, 3]`: logarithms of the standard deviations, scene units
/// - `viewmat` `[4, 4]`: world to camera
///
/// Returns packed rows `[N, 8]`, see [`gs_kernels::rows::ProjectedRow`]; the row of a Gaussian that cannot be seen is zero.
/// Differentiable with respect to all four tensors; the radius has no gradient.
///
/// # Panics
/// When shapes or float types disagree.
pub fn project(
    means: Tensor<2>,
    quats: Tensor<2>,
    log_scales: Tensor<2>,
    viewmat: Tensor<2>,
    config: &ProjectionConfig,
) -> Tensor<2> {
    check(&means, &quats, &log_scales, &viewmat);
    let _stage = profile::stage("project");
    Tensor::from_dispatch(Dispatch::project(
        means.into_dispatch(),
        quats.into_dispatch(),
        log_scales.into_dispatch(),
        viewmat.into_dispatch(),
        *config,
    ))
}

fn check(means: &Tensor<2>, quats: &Tensor<2>, log_scales: &Tensor<2>, viewmat: &Tensor<2>) {
    let [count, _] = means.dims();
    assert_shape!(means, [count, 3]);
    assert_shape!(quats, [count, 4]);
    assert_shape!(log_scales, [count, 3]);
    assert_shape!(viewmat, [4, 4]);
    assert_same_dtype("quats", quats, "means", means);
    assert_same_dtype("log_scales", log_scales, "means", means);
    assert_same_dtype("viewmat", viewmat, "means", means);
}

/// Burn's dispatch for [`project`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait ProjectionOps: Backend {
    /// See [`project`].
    fn project(
        means: FloatTensor<Self>,
        quats: FloatTensor<Self>,
        log_scales: FloatTensor<Self>,
        viewmat: FloatTensor<Self>,
        config: ProjectionConfig,
    ) -> FloatTensor<Self>;
}

/// Gradients of [`ProjectionKernels::projection_forward`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct ProjectionGradients<B: Backend> {
    /// `[N, 3]`
    pub means: FloatTensor<B>,
    /// `[N, 4]`
    pub quats: FloatTensor<B>,
    /// `[N, 3]`
    pub log_scales: FloatTensor<B>,
    /// `[4, 4]`; the last row is zero.
    pub viewmat: Option<FloatTensor<B>>,
}

/// Projection on a backend's primitives, without gradient tracking. Shapes as in [`project`]; tensors may be strided.
pub trait ProjectionKernels: Backend {
    /// Packed rows `[N, 8]`.
    fn projection_forward(
        means: FloatTensor<Self>,
        quats: FloatTensor<Self>,
        log_scales: FloatTensor<Self>,
        viewmat: FloatTensor<Self>,
        config: &ProjectionConfig,
    ) -> FloatTensor<Self>;

    /// Gradients from `v_projected` `[N, 8]`; `projected` is the result of the forward. Culled Gaussians and those whose gradient
    /// is not finite receive zero.
    fn projection_backward(
        means: FloatTensor<Self>,
        quats: FloatTensor<Self>,
        log_scales: FloatTensor<Self>,
        viewmat: FloatTensor<Self>,
        config: &ProjectionConfig,
        projected: FloatTensor<Self>,
        v_projected: FloatTensor<Self>,
        of_pose: bool,
    ) -> ProjectionGradients<Self>;
}

impl<B: ProjectionKernels> ProjectionOps for B {
    fn project(
        means: FloatTensor<B>,
        quats: FloatTensor<B>,
        log_scales: FloatTensor<B>,
        viewmat: FloatTensor<B>,
        config: ProjectionConfig,
    ) -> FloatTensor<B> {
        B::projection_forward(means, quats, log_scales, viewmat, &config)
    }
}

impl<B: HostBackend> ProjectionKernels for B {
    fn projection_forward(
        means: FloatTensor<B>,
        quats: FloatTensor<B>,
        log_scales: FloatTensor<B>,
        viewmat: FloatTensor<B>,
        config: &ProjectionConfig,
    ) -> FloatTensor<B> {
        let count = means.shape()[0];
        let [means, quats, log_scales, viewmat] = [means, quats, log_scales, viewmat].map(HostTensor::contiguous);
        with_float!(means, F => {
            let rows = cpu::forward::<F>(
                means.elements(), quats.elements(), log_scales.elements(), viewmat.elements(), config,
            );
            float_tensor::<B>(rows, [count, PROJECTED])
        })
    }

    fn projection_backward(
        means: FloatTensor<B>,
        quats: FloatTensor<B>,
        log_scales: FloatTensor<B>,
        viewmat: FloatTensor<B>,
        config: &ProjectionConfig,
        projected: FloatTensor<B>,
        v_projected: FloatTensor<B>,
        _of_pose: bool,
    ) -> ProjectionGradients<B> {
        let count = means.shape()[0];
        let [means, quats, log_scales, viewmat, projected, v_projected] =
            [means, quats, log_scales, viewmat, projected, v_projected].map(HostTensor::contiguous);
        with_float!(means, F => {
            let gradients = cpu::backward::<F>(
                means.elements(),
                quats.elements(),
                log_scales.elements(),
                viewmat.elements(),
                config,
                projected.elements(),
                v_projected.elements(),
            );
            ProjectionGradients {
                means: float_tensor::<B>(gradients.means, [count, 3]),
                quats: float_tensor::<B>(gradients.quats, [count, 4]),
                log_scales: float_tensor::<B>(gradients.log_scales, [count, 3]),
                viewmat: Some(float_tensor::<B>(gradients.viewmat, [4, 4])),
            }
        })
    }
}

/// State saved for the backward pass.
#[derive(Clone, Debug)]
struct ProjectionState<B: Backend> {
    means: FloatTensor<B>,
    quats: FloatTensor<B>,
    log_scales: FloatTensor<B>,
    viewmat: FloatTensor<B>,
    config: ProjectionConfig,
    projected: FloatTensor<B>,
}

#[derive(Debug)]
struct ProjectionBackward;

impl<B: ProjectionKernels> Backward<B, 4> for ProjectionBackward {
    type State = ProjectionState<B>;

    fn backward(self, ops: Ops<Self::State, 4>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let _stage = profile::stage("project, backward");
        let v_projected = grads.consume::<B>(&ops.node);
        let [of_means, of_quats, of_log_scales, of_viewmat] = ops.parents.map(|node| node.map(|node| node.id));
        let state = ops.state;
        let gradients = B::projection_backward(
            state.means,
            state.quats,
            state.log_scales,
            state.viewmat,
            &state.config,
            state.projected,
            v_projected,
            of_viewmat.is_some(),
        );
        let by_parent = [gradients.means, gradients.quats, gradients.log_scales];
        gradient::register::<B, 3>(grads, [of_means, of_quats, of_log_scales], by_parent);
        if let (Some(node), Some(viewmat)) = (of_viewmat, gradients.viewmat) {
            grads.register::<B>(node, viewmat);
        }
    }
}

impl<B: ProjectionKernels, C: CheckpointStrategy> ProjectionOps for Autodiff<B, C> {
    fn project(
        means: FloatTensor<Self>,
        quats: FloatTensor<Self>,
        log_scales: FloatTensor<Self>,
        viewmat: FloatTensor<Self>,
        config: ProjectionConfig,
    ) -> FloatTensor<Self> {
        let (means, means_node) = means.into_parts();
        let (quats, quats_node) = quats.into_parts();
        let (log_scales, log_scales_node) = log_scales.into_parts();
        let (viewmat, viewmat_node) = viewmat.into_parts();
        let nodes = [means_node, quats_node, log_scales_node, viewmat_node];
        match ProjectionBackward.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let projected =
                    B::projection_forward(means.clone(), quats.clone(), log_scales.clone(), viewmat.clone(), &config);
                let state = ProjectionState { means, quats, log_scales, viewmat, config, projected: projected.clone() };
                prep.finish(state, projected)
            }
            OpsKind::UnTracked(prep) => prep.finish(B::projection_forward(means, quats, log_scales, viewmat, &config)),
        }
    }
}
