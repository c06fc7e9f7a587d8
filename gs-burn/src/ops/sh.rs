//! View-dependent colour from real spherical harmonics; basis and signs are in [`gs_kernels::cpu::sh`].

mod reference;

use burn::backend::TensorMetadata;
use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{Tensor, assert_shape};
pub use gs_kernels::config::ShConfig;
use gs_kernels::cpu::sh as cpu;
use gs_kernels::rows::PROJECTED;

use super::assert_same_dtype;
use super::operation::{Operation, Output, State, differentiable};
use crate::profile;
use crate::slices::{HostBackend, HostTensor, float_tensor, with_float};
pub use reference::sh_colors_reference;

/// Colours of Gaussians seen from a camera: `max(0, 1/2 + sum_k Y_k(dir) sh_k)`, `dir` the unit vector from the camera
/// centre to the Gaussian.
///
/// - `means` `[N, 3]`: centres, world, scene units
/// - `sh` `[N, S, 3]`: coefficients, `S` = 1, 4, 9 or 16
/// - `viewmat` `[4, 4]`: world to camera
/// - `projected` `[N, 8]`: rows of [`project`](super::projection::project); read only to know which Gaussians are
///   culled
/// - `degree`: active degree, at most the stored one
///
/// Returns `[N, 3]`, 0 for culled Gaussians. Differentiable with respect to `sh`, and through the view direction with
/// respect to `means` and `viewmat`. A Gaussian whose colour is not finite gets
/// [`gs_kernels::constants::INVALID_FEATURE`], which [`intersect`](super::intersect::intersect) leaves out.
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
    // The rows get no gradient, so they are kept outside the graph.
    let projected = projected.inner().into_dispatch();
    let inputs = [means.into_dispatch(), sh.into_dispatch(), viewmat.into_dispatch(), projected];
    differentiable(ShColors(config), inputs, [])
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

/// [`sh_colors`] as an operation. Its inputs are means, sh, viewmat and projected rows; the last get no gradient.
#[derive(Clone, Debug)]
pub(crate) struct ShColors(pub(crate) ShConfig);

impl Operation<4> for ShColors {
    const BACKWARD: Option<&'static str> = Some("spherical harmonics, backward");

    fn forward<B: HostBackend>(&self, inputs: [FloatTensor<B>; 4], []: [IntTensor<B>; 0], _: bool) -> Output<B> {
        let count = inputs[0].shape()[0];
        with_float!(inputs[0], F => {
            let [means, sh, viewmat, projected] = inputs.each_ref().map(|t| t.elements());
            let colors = cpu::forward::<F>(means, sh, viewmat, projected, &self.0);
            Output::of(float_tensor::<B>(colors, [count, 3]))
        })
    }

    fn backward<B: HostBackend>(
        &self,
        mut state: State<B, 4, 0>,
        v_colors: FloatTensor<B>,
        _: [bool; 4],
    ) -> [Option<FloatTensor<B>>; 4] {
        let inputs = state.inputs();
        let count = inputs[0].shape()[0];
        with_float!(inputs[0], F => {
            let [means, sh, viewmat, projected] = inputs.each_ref().map(|t| t.elements());
            let gradients = cpu::backward::<F>(means, sh, viewmat, projected, &self.0, v_colors.elements());
            [
                Some(float_tensor::<B>(gradients.means, [count, 3])),
                Some(float_tensor::<B>(gradients.sh, [count, self.0.coefficients, 3])),
                Some(float_tensor::<B>(gradients.viewmat, [4, 4])),
                None,
            ]
        })
    }
}
