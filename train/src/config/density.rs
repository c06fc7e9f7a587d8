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

/// Refinements of a run whose growth follows its length, at the least.
const REFINEMENTS: usize = 20;

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
    /// Steps from one refinement to the next; fewer in a short run whose growth follows `full`, so that it refines twenty times.
    pub every: usize,
    /// Share of the run after which the count is fixed, so that the last Gaussians added still converge.
    pub stop: f64,
    /// Largest summed contribution of the Gaussians pruned when the count becomes fixed, as a share of the sum over all Gaussians
    /// and training photos, 0 to 1. 0: none is pruned.
    pub prune_share: f64,
    /// Opacity below which a Gaussian is dead.
    pub min_opacity: f64,
    /// `mcmc`: growth per refinement, a share of the count; the largest one where growth follows `full`.
    pub growth: f64,
    /// `mcmc`: share of the run after which the count has reached the cap, by equal shares of growth; 0: by `growth` alone. Earlier: steps
    /// cost more from then on. Later: the last Gaussians have little time to converge.
    pub full: f64,
    /// `mcmc`: strength of the position noise of nearly dead Gaussians, relative to the learning rate of the means; 0: none. Few
    /// photos need less: no photo contradicts a Gaussian that has drifted away.
    pub noise: f64,
    /// `mcmc`: root mean square distance of a Gaussian and its copies from its former mean, along its longest axis, in standard deviations. They
    /// shrink there so that together they are as wide as before. 0: they coincide, as in the paper, and part slowly.
    pub separation: f64,
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
            growth: 0.2,
            full: 0.45,
            noise: 5e5,
            separation: 0.7,
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
        check("density.full", self.full, (0.0..=1.0).contains(&self.full), "from 0 to 1")?;
        check("density.noise", self.noise, not_negative(self.noise), "0 or more")?;
        check(
            "density.separation",
            self.separation,
            (0.0..0.95).contains(&self.separation),
            "at least 0 and below 0.95",
        )?;
        check("density.gradient", self.gradient, positive(self.gradient), "positive")?;
        check("density.split_size", self.split_size, positive(self.split_size), "positive")?;
        check("density.prune_size", self.prune_size, positive(self.prune_size), "positive")?;
        check("density.reset_every", self.reset_every, self.reset_every >= 1, "at least 1")?;
        check("density.decay", self.decay, (0.0..1.0).contains(&self.decay), "at least 0 and below 1")
    }

    /// Steps from one refinement to the next in a run of `steps`.
    pub fn interval(&self, steps: usize) -> usize {
        match self.follows_run() {
            true => self.every.min(steps / REFINEMENTS).max(1),
            false => self.every,
        }
    }

    fn follows_run(&self) -> bool {
        self.strategy == Strategy::Mcmc && self.full > 0.0
    }

    /// The count after the refinement of `step` of a run of `steps` that begins it with `count`, under `mcmc`.
    pub fn grown(&self, count: usize, step: usize, steps: usize) -> usize {
        // A few Gaussians would never become more.
        let least = if self.growth > 0.0 && count > 0 { count as f64 + 1.0 } else { 0.0 };
        let most = (count as f64 * (1.0 + self.growth)).round().max(least);
        let wanted = match self.follows_run() {
            true => {
                // This refinement and those after it until the cap is to be reached.
                let last = (self.full * steps as f64) as usize;
                let left = 1 + last.saturating_sub(step) / self.interval(steps);
                let factor = (self.cap as f64 / count.max(1) as f64).powf(1.0 / left as f64);
                (count as f64 * factor).round().max(least).min(most)
            }
            false => most,
        };
        (wanted as usize).min(self.cap)
    }

    /// Whether the count may change at `step` of a run of `steps`.
    pub fn active(&self, step: usize, steps: usize) -> bool {
        let start = self.start.min(steps / 10).max(1);
        step >= start && step < self.first_fixed(steps)
    }

    /// Whether the count becomes fixed at `step` of a run of `steps`.
    pub fn rests_at(&self, step: usize, steps: usize) -> bool {
        self.strategy != Strategy::None && step == self.first_fixed(steps)
    }

    /// Whether the count has become fixed by `step` of a run of `steps`; never without density control, to which nothing comes to an end.
    pub fn rests_by(&self, step: usize, steps: usize) -> bool {
        self.strategy != Strategy::None && step >= self.first_fixed(steps)
    }

    /// The first step of a run of `steps` at which the count is fixed.
    pub fn first_fixed(&self, steps: usize) -> usize {
        (self.stop * steps as f64).ceil() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The counts after each refinement of a run that begins with `count`.
    fn counts(config: &DensityConfig, mut count: usize, steps: usize) -> Vec<usize> {
        let due = (1..=steps).filter(|step| step.is_multiple_of(config.interval(steps)) && config.active(*step, steps));
        due.map(|step| {
            count = config.grown(count, step, steps);
            count
        })
        .collect()
    }

    #[test]
    fn growth_reaches_the_cap_at_its_share_of_the_run() {
        let config = DensityConfig::default();
        for steps in [300, 1000, 3000, 7000, 30_000] {
            let counts = counts(&config, 55_000, steps);
            let full = counts.iter().position(|count| *count == config.cap).expect("the cap is reached");
            let first = config.start.min(steps / 10).div_ceil(config.interval(steps));
            let at = (first + full) as f64 * config.interval(steps) as f64 / steps as f64;
            assert!((at - config.full).abs() < 0.06, "{steps} steps: at {at}");
            assert!(counts.windows(2).all(|pair| pair[0] <= pair[1]));
        }
    }

    #[test]
    fn few_gaussians_grow_by_no_more_than_the_largest_share() {
        let config = DensityConfig::default();
        let grown = config.grown(1000, 450, 1000);
        assert_eq!(grown, 1200);
        assert_eq!(config.grown(0, 100, 1000), 0);
    }

    #[test]
    fn without_a_share_the_count_grows_by_its_own() {
        let config = DensityConfig { full: 0.0, growth: 0.05, ..DensityConfig::default() };
        assert_eq!((config.grown(1000, 100, 1000), config.grown(99_000, 100, 1000)), (1050, 100_000));
        assert_eq!((config.interval(300), DensityConfig::default().interval(300)), (100, 15));
    }
}
