//! The shared loss: the photometric loss of 3DGS (Eq. 7), `(1 - dssim) L1 + dssim (1 - SSIM)`, and the regularisers of 3DGS-MCMC
//! (Eq. 10), mean opacity and mean scale.

use burn::tensor::Tensor;
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::ops::sum::mean;
use gs_burn::{Gaussians, profile};

use crate::config::LossConfig;

/// `(1 - dssim) L1 + dssim (1 - SSIM)` of two images `[H, W, 3]` over the pixels of `region` `[H, W, 1]` (1: compared, 0: not;
/// `None`: all), `[1]`.
pub fn photometric(color: Tensor<3>, truth: Tensor<3>, region: Option<Tensor<3>>, config: &LossConfig) -> Tensor<1> {
    match region {
        None => photometric_loss(color, truth, config.dssim),
        // Pixels outside are black in both images, so neither term sees a difference there.
        Some(region) => photometric_loss(color * region.clone(), truth * region, config.dssim),
    }
}

/// Mean opacity and mean scale, weighted, `[1]`.
pub fn regularisers(gaussians: &Gaussians, extent: f64, config: &LossConfig) -> Tensor<1> {
    let _stage = profile::stage("regularisers");
    let mut total = Tensor::zeros([1], &gaussians.device());
    if config.opacity_reg > 0.0 && !gaussians.is_empty() {
        total = total + mean(gaussians.opacities()) * config.opacity_reg;
    }
    if config.scale_reg > 0.0 && !gaussians.is_empty() {
        total = total + mean(gaussians.scales()) * (config.scale_reg / extent);
    }
    total
}
