//! `[loss]`: the terms that are minimised.

use serde::{Deserialize, Serialize};

use super::error::{ConfigError, check, not_negative};

/// Weights of the loss.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LossConfig {
    /// Share of the D-SSIM term, 0 to 1. More preserves texture, less preserves mean colour.
    pub dssim: f64,
    /// Weight of the mean opacity until the count is fixed (`density.stop`): Gaussians that no photo needs die and are relocated. More removes
    /// floaters; too much makes surfaces transparent.
    pub opacity_reg: f64,
    /// Weight of the mean scale, in scene extents. It keeps Gaussians from growing in regions that no photo shows.
    pub scale_reg: f64,
}

impl Default for LossConfig {
    fn default() -> Self {
        Self { dssim: 0.2, opacity_reg: 0.01, scale_reg: 0.01 }
    }
}

impl LossConfig {
    pub(super) fn validate(&self) -> Result<(), ConfigError> {
        check("loss.dssim", self.dssim, (0.0..=1.0).contains(&self.dssim), "from 0 to 1")?;
        check("loss.opacity_reg", self.opacity_reg, not_negative(self.opacity_reg), "0 or more")?;
        check("loss.scale_reg", self.scale_reg, not_negative(self.scale_reg), "0 or more")
    }
}
