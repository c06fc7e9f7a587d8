//! View-dependent colour from real spherical harmonics; basis and signs are in [`gs_kernels::cpu::sh`].

mod reference;
#[cfg(test)]
mod tests;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{Tensor, assert_shape};
pub use gs_kernels::config::ShConfig;
use gs_kernels::cpu::sh as cpu;
use gs_kernels::rows::PROJECTED;

use super::assert_same_dtype;
use super::gradient::{self, Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};
pub use reference::sh_colors_reference;

/// Colours of Gaussians seen from a camera: `max(0, 1/2 + sum_k Y_k(dir) sh_k)`, `dir` the unit vector from the camera
/// centre to the Gaussian.
///
/// - `means` `[N, 3]`: centres, world, scene units
/// - `sh` `[N, S, 3]`: coefficients, `S` = 1, 4, 9 or 16
/// - `viewmat` `[4, 4]`: world to camera
/// - `projected` `[N, 8]`: rows of [`project`](super::projection::project); read only to know which Gaussians are culled
/// - `degree`: active degree, at most the stored one
///
/// Returns `[N, 3]`, 0 for culled Gaussians. Differentiable with respect to `sh`, and through the view direction with respect to
/// `means` and `viewmat`. A Gaussian whose colour is not finite gets [`gs_kernels::constants::INVALID_FEATURE`], which
/// [`intersect`](super::intersect::intersect) leaves out.
///
/// # Panics
/// When shapes or float types disagree, or `degree` exceeds the stored degree.
pub fn sh_colors(
    means: Tensor<2>,
    sh: Tensor<3>,
    viewmat: Tensor<2>,
    projected: Tensor<2>,
    degree: usize,
) -> Tensor<2> {
    let config = check(&means, &sh, &viewmat, &projected, degree);
    let _stage = profile::stage("spherical harmonics");
    Tensor::from_dispatch(Dispatch::sh_colors(
        means.into_dispatch(),
        sh.into_dispatch(),
        viewmat.into_dispatch(),
        // The rows get no gradient, so they are kept outside the graph.
        projected.inner().into_dispatch(),
        config,
    ))
}

fn check(means: &Tensor<2>, sh: &Tensor<3>, viewmat: &Tensor<2>, projected: &Tensor<2>, degree: usize) -> ShConfig {
    let [count, coefficients, _] = sh.dims();
    assert_shape!(means, [count, 3]);
    assert_shape!(sh, [count, coefficients, 3]);
    assert_shape!(viewmat, [4, 4]);
    assert_shape!(projected, [count, PROJECTED]);
    assert!(
        [1, 4, 9, 16].contains(&coefficients),
        "sh must hold 1, 4, 9 or 16 coefficients a Gaussian, it holds {coefficients}"
    );
    assert!(
        (degree + 1) * (degree + 1) <= coefficients,
        "degree must be at most the stored one; got degree {degree} with {coefficients} coefficients"
    );
    assert_same_dtype("sh", sh, "means", means);
    assert_same_dtype("viewmat", viewmat, "means", means);
    assert_same_dtype("projected", projected, "means", means);
    ShConfig { degree: degree as u32, coefficients }
}

/// Burn's dispatch for [`sh_colors`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait ShOps: Backend {
    /// See [`sh_colors`]; not differentiable with respect to `projected`.
    fn sh_colors(
        means: FloatTensor<Self>,
        sh: FloatTensor<Self>,
        viewmat: FloatTensor<Self>,
        projected: FloatTensor<Self>,
        config: ShConfig,
    ) -> FloatTensor<Self>;
}

/// Gradients of [`ShKernels::sh_forward`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct ShGradients<B: Backend> {
    /// `[N, 3]`, through the view direction.
    pub means: FloatTensor<B>,
    /// `[N, S, 3]`; zero above the active degree.
    pub sh: FloatTensor<B>,
    /// `[4, 4]`, through the camera centre.
    pub viewmat: Option<FloatTensor<B>>,
}

/// Colours on a backend's primitives, without gradient tracking. Shapes as in [`sh_colors`]; tensors may be strided.
pub trait ShKernels: Backend {
    /// Colours `[N, 3]`.
    fn sh_forward(
        means: FloatTensor<Self>,
        sh: FloatTensor<Self>,
        viewmat: FloatTensor<Self>,
        projected: FloatTensor<Self>,
        config: &ShConfig,
    ) -> FloatTensor<Self>;

    /// Gradients from `v_colors` `[N, 3]`. Culled Gaussians, channels clamped at 0 and colours that are not finite pass no
    /// gradient.
    fn sh_backward(
        means: FloatTensor<Self>,
        sh: FloatTensor<Self>,
        viewmat: FloatTensor<Self>,
        projected: FloatTensor<Self>,
        config: &ShConfig,
        v_colors: FloatTensor<Self>,
        of_pose: bool,
    ) -> ShGradients<Self>;
}

impl<B: ShKernels> ShOps for B {
    fn sh_colors(
        means: FloatTensor<B>,
        sh: FloatTensor<B>,
        viewmat: FloatTensor<B>,
        projected: FloatTensor<B>,
        config: ShConfig,
    ) -> FloatTensor<B> {
        B::sh_forward(means, sh, viewmat, projected, &config)
    }
}

impl<B: HostBackend> ShKernels for B {
    fn sh_forward(
        means: FloatTensor<B>,
        sh: FloatTensor<B>,
        viewmat: FloatTensor<B>,
        projected: FloatTensor<B>,
        config: &ShConfig,
    ) -> FloatTensor<B> {
        let count = means.shape()[0];
        let [means, sh, viewmat, projected] = [means, sh, viewmat, projected].map(HostTensor::contiguous);
        with_float!(means, F => {
            let colors =
                cpu::forward::<F>(means.elements(), sh.elements(), viewmat.elements(), projected.elements(), config);
            float_tensor::<B>(colors, [count, 3])
        })
    }

    fn sh_backward(
        means: FloatTensor<B>,
        sh: FloatTensor<B>,
        viewmat: FloatTensor<B>,
        projected: FloatTensor<B>,
        config: &ShConfig,
        v_colors: FloatTensor<B>,
        _of_pose: bool,
    ) -> ShGradients<B> {
        let count = means.shape()[0];
        let [means, sh, viewmat, projected, v_colors] =
            [means, sh, viewmat, projected, v_colors].map(HostTensor::contiguous);
        with_float!(means, F => {
            let gradients = cpu::backward::<F>(
                means.elements(), sh.elements(), viewmat.elements(), projected.elements(), config, v_colors.elements(),
            );
            ShGradients {
                means: float_tensor::<B>(gradients.means, [count, 3]),
                sh: float_tensor::<B>(gradients.sh, [count, config.coefficients, 3]),
                viewmat: Some(float_tensor::<B>(gradients.viewmat, [4, 4])),
            }
        })
    }
}

/// State saved for the backward pass.
#[derive(Clone, Debug)]
struct ShState<B: Backend> {
    means: FloatTensor<B>,
    sh: FloatTensor<B>,
    viewmat: FloatTensor<B>,
    projected: FloatTensor<B>,
    config: ShConfig,
}

#[derive(Debug)]
struct ShBackward;

impl<B: ShKernels> Backward<B, 3> for ShBackward {
    type State = ShState<B>;

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let _stage = profile::stage("spherical harmonics, backward");
        let v_colors = grads.consume::<B>(&ops.node);
        let [of_means, of_sh, of_viewmat] = ops.parents.map(|node| node.map(|node| node.id));
        let ShState { means, sh, viewmat, projected, config } = ops.state;
        let gradients = B::sh_backward(means, sh, viewmat, projected, &config, v_colors, of_viewmat.is_some());
        gradient::register::<B, 2>(grads, [of_means, of_sh], [gradients.means, gradients.sh]);
        if let (Some(node), Some(viewmat)) = (of_viewmat, gradients.viewmat) {
            grads.register::<B>(node, viewmat);
        }
    }
}

impl<B: ShKernels, C: CheckpointStrategy> ShOps for Autodiff<B, C> {
    fn sh_colors(
        means: FloatTensor<Self>,
        sh: FloatTensor<Self>,
        viewmat: FloatTensor<Self>,
        projected: FloatTensor<Self>,
        config: ShConfig,
    ) -> FloatTensor<Self> {
        let (means, means_node) = means.into_parts();
        let (sh, sh_node) = sh.into_parts();
        let (viewmat, viewmat_node) = viewmat.into_parts();
        let projected = projected.into_primitive();
        match ShBackward.prepare::<C>([means_node, sh_node, viewmat_node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let colors = B::sh_forward(means.clone(), sh.clone(), viewmat.clone(), projected.clone(), &config);
                prep.finish(ShState { means, sh, viewmat, projected, config }, colors)
            }
            OpsKind::UnTracked(prep) => prep.finish(B::sh_forward(means, sh, viewmat, projected, &config)),
        }
    }
}
