//! `[optimiser]`: learning rates of the Gaussians.

use serde::{Deserialize, Serialize};

use super::error::{ConfigError, check, not_negative, positive};

/// Largest allowed factor on the rates of a short run: at 4 training diverges on some photos.
const MOST_FACTOR: f64 = 3.0;

/// Learning rates, in the parameter's unit per step, of a run of 30,000 steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OptimiserConfig {
    /// Rate of the means at the first step, in scene extents. Larger: surfaces become noisy. Smaller: the means stay at the initial
    /// points.
    pub means_lr: f64,
    /// Rate of the means at the last step, in scene extents; exponential in between.
    pub means_lr_final: f64,
    /// Rate of the rotations (unnormalised quaternions).
    pub quats_lr: f64,
    /// Rate of the logarithms of the scales.
    pub scales_lr: f64,
    /// Rate of the opacity logits.
    pub opacity_lr: f64,
    /// Rate of the base colour (SH degree 0).
    pub sh_lr: f64,
    /// Rate of the view-dependent colour (SH degrees 1 to 3); 3DGS takes a twentieth of `sh_lr`.
    pub sh_rest_lr: f64,
    /// Largest factor on all these rates in a shorter run, 1 to 3: the root of 30,000 over its steps, up to this. 1: none. Higher:
    /// after some hundred steps the scene falls apart (4 lost 2 dB on photos without points). Lower: a short run ends half way.
    pub short_run_factor: f64,
    /// Steps over which the rate of the means falls to its last value, where the run has no more of them: a shorter run ends on the way
    /// there. 0: it falls within every run.
    pub decay_steps: usize,
    /// Decay of the first moment.
    pub beta1: f64,
    /// Decay of the second moment.
    pub beta2: f64,
    /// Added to the root of the second moment. Gradients of a mean over a million values are tiny, so 3DGS uses 1e-15.
    pub eps: f64,
}

impl Default for OptimiserConfig {
    fn default() -> Self {
        Self {
            means_lr: 1.6e-4,
            means_lr_final: 1.6e-6,
            quats_lr: 1e-3,
            scales_lr: 5e-3,
            opacity_lr: 5e-2,
            sh_lr: 2.5e-3,
            sh_rest_lr: 1.25e-4,
            short_run_factor: 2.0,
            decay_steps: 3000,
            beta1: 0.9,
            beta2: 0.999,
            eps: 1e-15,
        }
    }
}

impl OptimiserConfig {
    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        check("optimiser.means_lr", self.means_lr, positive(self.means_lr), "positive")?;
        check("optimiser.means_lr_final", self.means_lr_final, positive(self.means_lr_final), "positive")?;
        check("optimiser.quats_lr", self.quats_lr, not_negative(self.quats_lr), "0 or more")?;
        check("optimiser.scales_lr", self.scales_lr, not_negative(self.scales_lr), "0 or more")?;
        check("optimiser.opacity_lr", self.opacity_lr, not_negative(self.opacity_lr), "0 or more")?;
        check("optimiser.sh_lr", self.sh_lr, not_negative(self.sh_lr), "0 or more")?;
        check("optimiser.sh_rest_lr", self.sh_rest_lr, not_negative(self.sh_rest_lr), "0 or more")?;
        let factor = self.short_run_factor;
        check("optimiser.short_run_factor", factor, (1.0..=MOST_FACTOR).contains(&factor), "from 1 to 3")?;
        check("optimiser.beta1", self.beta1, (0.0..1.0).contains(&self.beta1), "at least 0 and below 1")?;
        check("optimiser.beta2", self.beta2, (0.0..1.0).contains(&self.beta2), "at least 0 and below 1")?;
        check("optimiser.eps", self.eps, positive(self.eps), "positive")
    }
}
