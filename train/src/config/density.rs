//! `[density]`: adding, relocating and removing Gaussians.

use serde::{Deserialize, Serialize};

use super::error::{ConfigError, check, not_negative, open_unit, positive};

/// How opacities are lowered, so that Gaussians that no photo needs fall below the pruning threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OpacityPolicy {
    /// All at once every `reset_every` steps (3DGS); renderings are too dark for some steps after.
    Reset,
    /// By a small share at each refinement (Brush).
    Decay,
    /// Never.
    None,
}

/// The density control.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Relocation under a budget (3DGS-MCMC): the count grows to the cap and stays there.
    Mcmc,
    /// Classic adaptive control (3DGS): the count follows screen gradients, never above the cap.
    Default,
    /// The initial Gaussians are kept.
    None,
}

/// Options of both kinds of density control; steps count from 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DensityConfig {
    /// The density control.
    pub strategy: Strategy,
    /// Most Gaussians. Each takes about 1.2 kB at SH degree 3; a run prints the memory it expects first.
    pub cap: usize,
    /// First step at which the count changes. A short run starts after a tenth of its steps at the latest.
    pub start: usize,
    /// Steps from one refinement to the next.
    pub every: usize,
    /// Share of the run after which the count is fixed, so that the last Gaussians added still converge.
    pub stop: f64,
    /// Largest summed contribution of the Gaussians pruned when the count becomes fixed, as a share of the sum over all Gaussians
    /// and training photos, 0 to 1. 0: none is pruned.
    pub prune_share: f64,
    /// Opacity below which a Gaussian is dead.
    pub min_opacity: f64,
    /// `mcmc`: growth per refinement, a share of the count.
    pub growth: f64,
    /// `mcmc`: strength of the position noise of nearly dead Gaussians, relative to the learning rate of the means; 0: none. Few
    /// photos need less: no photo contradicts a Gaussian that has drifted away.
    pub noise: f64,
    /// `default`: mean screen gradient above which a Gaussian is cloned or split, in half image widths.
    pub gradient: f64,
    /// `default`: sum the magnitudes of the gradient over pixels (AbsGS) instead of the gradient; needs a threshold about four
    /// times as high.
    pub absgrad: bool,
    /// `default`: scale above which a Gaussian is split instead of cloned, in scene extents.
    pub split_size: f64,
    /// `default`: scale above which a Gaussian is removed, once opacities have been lowered, in scene extents.
    pub prune_size: f64,
    /// `default`: how opacities are lowered.
    pub opacity_policy: OpacityPolicy,
    /// `default`: steps from one opacity reset to the next.
    pub reset_every: usize,
    /// `default`: share of the opacity lost at each refinement under the decay policy.
    pub decay: f64,
}

impl Default for DensityConfig {
    fn default() -> Self {
        Self {
            strategy: Strategy::Mcmc,
            cap: 100_000,
            start: 500,
            every: 100,
            stop: 0.8,
            prune_share: 0.0,
            min_opacity: 0.005,
            growth: 0.05,
            noise: 5e5,
            gradient: 2e-4,
            absgrad: false,
            split_size: 0.01,
            prune_size: 0.1,
            opacity_policy: OpacityPolicy::Reset,
            reset_every: 3000,
            decay: 0.004,
        }
    }
}

impl DensityConfig {
    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        check("density.cap", self.cap, (1..=1 << 30).contains(&self.cap), "from 1 to 2^30")?;
        check("density.start", self.start, self.start >= 1, "at least 1")?;
        check("density.every", self.every, self.every >= 1, "at least 1")?;
        check("density.stop", self.stop, (0.0..=1.0).contains(&self.stop), "from 0 to 1")?;
        check(
            "density.prune_share",
            self.prune_share,
            (0.0..1.0).contains(&self.prune_share),
            "at least 0 and below 1",
        )?;
        check("density.min_opacity", self.min_opacity, open_unit(self.min_opacity), "between 0 and 1, both excluded")?;
        check("density.growth", self.growth, not_negative(self.growth), "0 or more")?;
        check("density.noise", self.noise, not_negative(self.noise), "0 or more")?;
        check("density.gradient", self.gradient, positive(self.gradient), "positive")?;
        check("density.split_size", self.split_size, positive(self.split_size), "positive")?;
        check("density.prune_size", self.prune_size, positive(self.prune_size), "positive")?;
        check("density.reset_every", self.reset_every, self.reset_every >= 1, "at least 1")?;
        check("density.decay", self.decay, (0.0..1.0).contains(&self.decay), "at least 0 and below 1")
    }

    /// Whether the count may change at `step` of a run of `steps`.
    pub fn active(&self, step: usize, steps: usize) -> bool {
        let start = self.start.min(steps / 10).max(1);
        step >= start && (step as f64) < self.stop * steps as f64
    }

    /// Whether the count becomes fixed at `step` of a run of `steps`.
    pub fn rests_at(&self, step: usize, steps: usize) -> bool {
        self.strategy != Strategy::None && step == (self.stop * steps as f64).ceil() as usize
    }
}
