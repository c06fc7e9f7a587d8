//! `[optimiser]`: learning rates of the Gaussians.

use super::ranges::{NOT_NEGATIVE, POSITIVE};
use crate::section;

/// Largest allowed factor on the rates of a short run: at 4 training diverges on some photos.
const MOST_FACTOR: f64 = 3.0;

section! {
    /// Learning rates, in the parameter's unit per step, of a run of 30,000 steps.
    pub struct OptimiserConfig {
        // In extents a step is 0.02 pixels where cameras stand side by side and 0.45 around an object; from 0.05 to 0.2
        // all photos that were tried do about as well as each other.
        /// Rate of the means at the first step of a set whose cameras look at one subject, in pixels of a photo there.
        /// 0: `means_lr`, as in all other sets. Larger: noisy surfaces. Smaller: means stay at the initial points.
        means_pixels: f64 = 0.06, in NOT_NEGATIVE;
        /// Rate of the means at the first step, in scene extents (3DGS).
        means_lr: f64 = 1.6e-4, in POSITIVE;
        /// The same at the last step; exponential in between, by the same factor under `means_pixels`.
        means_lr_final: f64 = 1.6e-6, in POSITIVE;
        /// Rate of the rotations (unnormalised quaternions).
        quats_lr: f64 = 1e-3, in NOT_NEGATIVE;
        /// Rate of the logarithms of the scales.
        scales_lr: f64 = 5e-3, in NOT_NEGATIVE;
        /// Rate of the opacity logits.
        opacity_lr: f64 = 5e-2, in NOT_NEGATIVE;
        /// Rate of the base colour (SH degree 0); the view-dependent colour has a twentieth.
        sh_lr: f64 = 2.5e-3, in NOT_NEGATIVE;
        // At 4, photos without points lose 2 dB after some hundred steps.
        /// Largest factor on all rates in a shorter run: the root of 30,000 over its steps, up to this. Higher: the
        /// scene falls apart. Lower: a short run ends half way.
        short_run_factor: f64 = 2.0, in 1.0..=MOST_FACTOR;
        /// Fewest steps in which the rate of the means falls to its last value; a shorter run ends on the way. 0: it
        /// falls within every run.
        decay_steps: usize = 3000;
    }
}
