//! 3D Gaussians to 2D ellipses in the image (EWA splatting); the formulas are in [`gs_kernels::cpu::projection`].

mod reference;

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{Tensor, assert_shape};
pub use gs_kernels::config::ProjectionConfig;
use gs_kernels::cpu::projection as cpu;
use gs_kernels::rows::PROJECTED;

use super::assert_same_dtype;
use super::operation::{Operation, Output, State, Tensors, differentiable};
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
/// Returns packed rows `[N, 8]`, see [`gs_kernels::rows::ProjectedRow`]; the row of a Gaussian that cannot be seen is
/// zero. Differentiable with respect to all four tensors; the radius has no gradient.
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
    let inputs = [means, quats, log_scales, viewmat].map(Tensor::into_dispatch);
    differentiable(Projection(*config), inputs, [])
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

/// [`project`] as an operation. Its inputs are means, quats, log_scales and viewmat.
#[derive(Clone, Debug)]
pub(crate) struct Projection(pub(crate) ProjectionConfig);

impl Operation<4> for Projection {
    const BACKWARD: Option<&'static str> = Some("project, backward");

    fn forward<B: HostBackend>(&self, inputs: [FloatTensor<B>; 4], []: [IntTensor<B>; 0], _: bool) -> Output<B> {
        let [means, quats, log_scales, viewmat] = &inputs;
        let rows = with_float!(*means, F => {
            let [means, quats, log_scales, viewmat] = [means, quats, log_scales, viewmat].map(|t| t.elements());
            let rows = cpu::forward::<F>(means, quats, log_scales, viewmat, &self.0);
            float_tensor::<B>(rows, [means.len() / 3, PROJECTED])
        });
        Output { saved: Tensors::of_floats([rows.clone()]), tensor: rows }
    }

    fn backward<B: HostBackend>(
        &self,
        mut state: State<B, 4, 0>,
        v_projected: FloatTensor<B>,
        _: [bool; 4],
    ) -> [Option<FloatTensor<B>>; 4] {
        let ([means, quats, log_scales, viewmat], projected) = (&state.inputs(), &state.saved.floats[0]);
        let count = means.shape()[0];
        with_float!(*means, F => {
            let gradients = cpu::backward::<F>(
                means.elements(),
                quats.elements(),
                log_scales.elements(),
                viewmat.elements(),
                &self.0,
                projected.elements(),
                v_projected.elements(),
            );
            [
                Some(float_tensor::<B>(gradients.means, [count, 3])),
                Some(float_tensor::<B>(gradients.quats, [count, 4])),
                Some(float_tensor::<B>(gradients.log_scales, [count, 3])),
                Some(float_tensor::<B>(gradients.viewmat, [4, 4])),
            ]
        })
    }
}
