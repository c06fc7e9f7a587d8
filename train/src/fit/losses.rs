//! The shared loss: the photometric loss of 3DGS (Eq. 7), `(1 - dssim) L1 + dssim (1 - SSIM)`, and the regularisers of
//! 3DGS-MCMC (Eq. 10), mean opacity and mean scale.

use burn::tensor::Tensor;
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::ops::sum::{Activation, activated_sum};
use gs_burn::{Gaussians, profile};

use crate::config::LossConfig;

/// `(1 - dssim) L1 + dssim (1 - SSIM)` of two images `[H, W, 3]` over the pixels of `region` `[H, W, 1]` (1: compared,
/// 0: not; `None`: all), `[1]`.
pub fn photometric(color: Tensor<3>, truth: Tensor<3>, region: Option<Tensor<3>>, config: &LossConfig) -> Tensor<1> {
    match region {
        None => photometric_loss(color, truth, config.dssim),
        // Pixels outside are black in both images, so neither term sees a difference there.
        Some(region) => photometric_loss(color * region.clone(), truth * region, config.dssim),
    }
}

/// `loss` plus mean opacity and mean scale, weighted, `[1]`; `extent` in scene units. `fixed`: the count of Gaussians
/// is, so that none that dies is relocated, and lower opacities would only make surfaces transparent.
pub fn regularised(loss: Tensor<1>, gaussians: &Gaussians, extent: f64, fixed: bool, config: &LossConfig) -> Tensor<1> {
    let _stage = profile::stage("regularisers");
    if gaussians.is_empty() {
        return loss;
    }
    let (count, mut total) = (gaussians.len() as f64, loss);
    if config.opacity_reg > 0.0 && !fixed {
        let logits = gaussians.opacity_logits.val();
        total = total + activated_sum(logits, Activation::Sigmoid, config.opacity_reg / count);
    }
    if config.scale_reg > 0.0 {
        let log_scales = gaussians.log_scales.val();
        total = total + activated_sum(log_scales, Activation::Exp, config.scale_reg / (3.0 * count * extent));
    }
    total
}
