//! The position noise of 3DGS-MCMC, in place where memory allows. It has no gradient.

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{Tensor, TensorData, assert_shape};
pub use gs_kernels::config::NoiseConfig;
use gs_kernels::cpu::noise as cpu;

use super::assert_same_dtype;
use super::operation::{Computation, Tensors, computed_tensor};
use crate::Gaussians;
use crate::profile;
use crate::slices::{HostBackend, HostTensor, with_float};

/// `means` `[N, 3]` with the noise of one step (Kheradmand et al. 2024, Eq. 8): `mean + Sigma n strength gate`.
///
/// `quats` `[N, 4]`, `log_scales` `[N, 3]` and `logits` `[N]` are those of [`Gaussians`]. `n` is a function of seed,
/// step and row alone, so backends draw the same and nothing is stored. A Gaussian whose move is not finite stays.
/// Gradient tracking is dropped.
///
/// # Panics
/// When shapes or float types disagree.
pub fn perturb(
    means: Tensor<2>,
    quats: Tensor<2>,
    log_scales: Tensor<2>,
    logits: Tensor<1>,
    config: &NoiseConfig,
) -> Tensor<2> {
    let [count] = logits.dims();
    assert_shape!(means, [count, 3]);
    assert_shape!(quats, [count, 4]);
    assert_shape!(log_scales, [count, 3]);
    assert_same_dtype("means", &means, "logits", &logits);
    assert_same_dtype("quats", &quats, "logits", &logits);
    assert_same_dtype("log_scales", &log_scales, "logits", &logits);
    let _stage = profile::stage("noise");
    let [means, quats, log_scales] = [means, quats, log_scales].map(|tensor| tensor.inner().into_dispatch());
    computed_tensor(Noise(*config), [means, quats, log_scales, logits.inner().into_dispatch()])
}

/// [`perturb`] in Burn's tensor operations, for Gaussians of finite numbers: the definition.
pub fn perturb_reference(gaussians: &Gaussians, config: &NoiseConfig) -> Tensor<2> {
    let means = gaussians.means.val();
    let (count, options) = (gaussians.len(), (&means.device(), means.dtype()));
    let normals: Vec<f64> = (0..count).flat_map(|row| cpu::normals(row as u32, config)).collect();
    let normals: Tensor<2> = Tensor::from_data(TensorData::new(normals, [count, 3]), options);
    let gates = (gaussians.opacities() - config.opacity) * (0.5 * config.steepness);
    let gates = (gates.tanh() - 1.0) * -0.5;
    let closed = gates.clone().lower_elem(config.gate_min);
    let factors = gates.mask_fill(closed, 0.0) * config.strength;
    let quats = gaussians.quats.val();
    let quats = quats.clone() / quats.square().sum_dim(1).sqrt();
    let variances = (gaussians.log_scales.val() * 2.0).exp();
    // Own axes, then back: `R diag(variances) R^T n`.
    let conjugate: Tensor<2> = Tensor::from_data([[1.0, -1.0, -1.0, -1.0]], options);
    let own = rotated(quats.clone() * conjugate, normals) * variances;
    means + rotated(quats, own) * factors.unsqueeze_dim(1)
}

/// `v` `[N, 3]` rotated by the unit quaternions `q` `[N, 4]`: `v + 2 u x (u x v + w v)`.
fn rotated(q: Tensor<2>, v: Tensor<2>) -> Tensor<2> {
    let (w, u) = (q.clone().narrow(1, 0, 1), q.narrow(1, 1, 3));
    let inner = u.clone().cross(v.clone(), 1) + v.clone() * w;
    v + u.cross(inner, 1) * 2.0
}

/// [`perturb`] as a computation on means, quats, log_scales and logits.
pub(crate) struct Noise(pub(crate) NoiseConfig);

impl Computation<4> for Noise {
    fn compute<B: HostBackend>(
        &self,
        [mut means, quats, log_scales, logits]: [FloatTensor<B>; 4],
        []: [IntTensor<B>; 0],
    ) -> Tensors<B> {
        with_float!(means, F => {
            let (quats, log_scales) = (quats.elements::<F>(), log_scales.elements());
            cpu::perturb(means.elements_mut(), quats, log_scales, logits.elements(), &self.0);
        });
        Tensors::of_floats([means])
    }
}
