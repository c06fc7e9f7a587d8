//! `[loss]`: the terms that are minimised.

use super::ranges::{NOT_NEGATIVE, SHARE};
use crate::section;

section! {
    /// Weights of the loss.
    pub struct LossConfig {
        /// Share of the D-SSIM term, 0 to 1. More preserves texture, less preserves mean colour.
        dssim: f64 = 0.2, in SHARE;
        /// Weight of the mean opacity until `density.stop`: Gaussians that no photo needs die. More removes floaters;
        /// too much makes surfaces transparent.
        opacity_reg: f64 = 0.01, in NOT_NEGATIVE;
        /// Weight of the mean scale, in scene extents: Gaussians do not grow where no photo looks.
        scale_reg: f64 = 0.01, in NOT_NEGATIVE;
    }
}
