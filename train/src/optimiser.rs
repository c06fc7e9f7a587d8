//! Adam with a learning rate per parameter group (3DGS, section 7.1 and the values of its reference configuration).
//!
//! Moments are rows of the same table as the parameters, so they follow Gaussians as those are added, moved and removed
//! (`density::ops`).

use burn::tensor::{Tensor, s};
use gs_burn::ops::adam::{AdamConfig, adam_step};
use serde::{Deserialize, Serialize};

use crate::experiment::{ConfigError, check, not_negative, positive};
use crate::parameters::{Gradients, Group, Parameters, widen};
use crate::schedule;

/// Learning rates, in the parameter's unit a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OptimiserConfig {
    /// Rate of the centres at the first step, in scene extents. Too large and surfaces fray, too small and they stay
    /// where the points were.
    pub means_lr: f64,
    /// Rate of the centres at the last step, in scene extents; exponential in between.
    pub means_lr_final: f64,
    /// Rate of the rotations (unnormalised quaternions).
    pub quats_lr: f64,
    /// Rate of the logarithms of the sizes.
    pub scales_lr: f64,
    /// Rate of the opacity logits.
    pub opacity_lr: f64,
    /// Rate of the base colour (SH degree 0).
    pub sh_lr: f64,
    /// Rate of the view-dependent colour (SH degrees 1 to 3); 3DGS takes a twentieth of `sh_lr`.
    pub sh_rest_lr: f64,
    /// Decay of the first moment.
    pub beta1: f64,
    /// Decay of the second moment.
    pub beta2: f64,
    /// Added to the root of the second moment. Gradients of a mean over a million values are tiny, so 3DGS takes 1e-15.
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
        check("optimiser.beta1", self.beta1, (0.0..1.0).contains(&self.beta1), "at least 0 and below 1")?;
        check("optimiser.beta2", self.beta2, (0.0..1.0).contains(&self.beta2), "at least 0 and below 1")?;
        check("optimiser.eps", self.eps, positive(self.eps), "positive")
    }

    /// Rate of the centres at `step` of `steps`, in scene extents.
    pub fn means_lr_at(&self, step: usize, steps: usize) -> f64 {
        schedule::exponential(self.means_lr, self.means_lr_final, step, steps)
    }

    /// The rate of each group at a step, in the order of [`Group::ALL`]; `extent` in scene units.
    pub fn rates(&self, step: usize, steps: usize, extent: f64) -> [f64; 5] {
        let means = self.means_lr_at(step, steps) * extent;
        [means, self.quats_lr, self.scales_lr, self.opacity_lr, self.sh_rest_lr]
    }
}

/// First and second moments of every parameter, and the number of updates so far.
#[derive(Debug, Clone)]
pub struct Optimiser {
    /// First moments, `[N, columns]` in the order of [`Group::ALL`].
    pub first: [Tensor<2>; 5],
    /// Second moments, likewise.
    pub second: [Tensor<2>; 5],
    /// Updates so far; the bias correction counts them.
    pub updates: u64,
}

impl Optimiser {
    /// Zero moments for `parameters`.
    pub fn new(parameters: &Parameters) -> Self {
        let zeros = || Group::ALL.map(|group| parameters.get(group).zeros_like());
        Self { first: zeros(), second: zeros(), updates: 0 }
    }

    /// One update of all groups, with the [`rates`](OptimiserConfig::rates) of this step.
    pub fn step(
        &mut self,
        parameters: &mut Parameters,
        gradients: Gradients,
        rates: [f64; 5],
        config: &OptimiserConfig,
    ) {
        self.updates += 1;
        for ((group, gradient), lr) in Group::ALL.into_iter().zip(gradients.into_groups()).zip(rates) {
            let adam = AdamConfig { lr, beta1: config.beta1, beta2: config.beta2, eps: config.eps, step: self.updates };
            let i = group as usize;
            // Taken out of their places, so that each buffer has one owner and is updated in place.
            let nothing = || Tensor::empty([0, 1], &gradient.device());
            let parameter = std::mem::replace(parameters.get_mut(group), nothing());
            let first = std::mem::replace(&mut self.first[i], nothing());
            let second = std::mem::replace(&mut self.second[i], nothing());
            let (mut parameter, first, second) = adam_step(parameter, gradient, first, second, &adam);
            if group == Group::Sh {
                parameter = catch_up_base_colour(parameter, &first, &second, config.sh_lr - lr, &adam);
            }
            (*parameters.get_mut(group), self.first[i], self.second[i]) = (parameter, first, second);
        }
    }

    /// Moments for SH coefficients up to `degree`, the new ones zero.
    pub fn grow_sh(&mut self, degree: usize) {
        for moments in [&mut self.first, &mut self.second] {
            let sh = moments[Group::Sh as usize].clone();
            moments[Group::Sh as usize] = widen(sh, Group::Sh.columns(degree));
        }
    }

    /// Sets all moments of `group` to zero.
    pub fn forget(&mut self, group: Group) {
        for moments in [&mut self.first, &mut self.second] {
            moments[group as usize] = moments[group as usize].zeros_like();
        }
    }
}

/// Moves the base colour (the first three SH columns) by `missing_lr` more. All SH columns were moved at the rate of the
/// view-dependent ones; Adam's step is proportional to the rate and its moments do not depend on it, so the base colour
/// gets the rest from the moments just written. This keeps SH one tensor, as the renderer wants it.
fn catch_up_base_colour(
    sh: Tensor<2>,
    first: &Tensor<2>,
    second: &Tensor<2>,
    missing_lr: f64,
    adam: &AdamConfig,
) -> Tensor<2> {
    let base = s![.., 0..3];
    let updates = i32::try_from(adam.step).unwrap_or(i32::MAX);
    let mean = first.clone().slice(base) / (1.0 - adam.beta1.powi(updates));
    let spread = (second.clone().slice(base) / (1.0 - adam.beta2.powi(updates))).sqrt() + adam.eps;
    let moved = sh.clone().slice(base) - mean / spread * missing_lr;
    sh.slice_assign(base, moved)
}
