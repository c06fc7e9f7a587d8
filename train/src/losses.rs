//! What is minimised: the photometric loss of 3DGS (Eq. 7), `(1 - dssim) L1 + dssim (1 - SSIM)`, plus the regularisers of
//! 3DGS-MCMC (Eq. 10), the mean opacity and the mean size.

use burn::tensor::Tensor;
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::{Gaussians, profile};
use serde::{Deserialize, Serialize};

use crate::data::Photo;

/// In which space colours are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ColorSpace {
    /// As photos are stored; the Gaussians' colours are then sRGB too. What 3DGS does.
    Srgb,
}

/// What is minimised.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LossConfig {
    /// Share of the structural term, 0 to 1. More keeps texture, less keeps mean colour.
    pub dssim: f64,
    /// Weight of the mean opacity. It clears haze and floaters; too much thins out surfaces.
    pub opacity_reg: f64,
    /// Weight of the mean size, in scene extents. It keeps Gaussians from growing where no photo looks.
    pub scale_reg: f64,
    /// The space colours are compared in.
    pub space: ColorSpace,
}

impl Default for LossConfig {
    fn default() -> Self {
        Self { dssim: 0.2, opacity_reg: 0.01, scale_reg: 0.01, space: ColorSpace::Srgb }
    }
}

/// The loss of one rendered image `[H, W, 3]` against its photo, `[1]`; `extent` in scene units.
pub fn loss(color: Tensor<3>, photo: &Photo, gaussians: &Gaussians, extent: f64, config: &LossConfig) -> Tensor<1> {
    photometric(color, photo.image.clone(), photo.mask.clone(), config) + regularisers(gaussians, extent, config)
}

/// `(1 - dssim) L1 + dssim (1 - SSIM)` of two images `[H, W, 3]` over the pixels of `region` `[H, W, 1]` (1: compared, 0: not;
/// `None`: all), `[1]`.
pub fn photometric(color: Tensor<3>, truth: Tensor<3>, region: Option<Tensor<3>>, config: &LossConfig) -> Tensor<1> {
    match region {
        None => photometric_loss(color, truth, config.dssim),
        // Pixels outside are black in both images, so neither term sees a difference there.
        Some(region) => photometric_loss(color * region.clone(), truth * region, config.dssim),
    }
}

/// Mean opacity and mean size with their weights, `[1]`.
pub fn regularisers(gaussians: &Gaussians, extent: f64, config: &LossConfig) -> Tensor<1> {
    let _stage = profile::stage("regularisers");
    let mut total = Tensor::zeros([1], &gaussians.device());
    if config.opacity_reg > 0.0 && !gaussians.is_empty() {
        total = total + gaussians.opacities().mean() * config.opacity_reg;
    }
    if config.scale_reg > 0.0 && !gaussians.is_empty() {
        total = total + gaussians.scales().mean() * (config.scale_reg / extent);
    }
    total
}
