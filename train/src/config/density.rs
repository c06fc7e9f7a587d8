//! `[density]`: adding, relocating and removing Gaussians.

use super::ranges::{NOT_NEGATIVE, OPEN_UNIT, Only, POSITIVE, SHARE};
use crate::{choice, section};

choice! {
    /// How opacities are lowered, so that Gaussians that no photo needs fall below the pruning threshold.
    pub enum OpacityPolicy {
        /// All at once every `reset_every` steps (3DGS); renderings are too dark for some steps.
        Reset,
        /// By a small share at each refinement (Brush).
        Decay,
        /// Never.
        None,
    }
}

choice! {
    /// The density control.
    pub enum Strategy {
        /// Relocation under a budget (3DGS-MCMC): the count grows to the cap.
        Mcmc,
        /// Classic adaptive control (3DGS): the count follows screen gradients.
        Default,
        /// The initial Gaussians are kept.
        None,
    }
}

/// Refinements until the count has reached the cap, in a run whose growth follows its length, and how many of them come
/// before the first one that acts.
const REFINEMENTS: usize = 9;
const IDLE: usize = 2;

section! {
    /// Options of all kinds of density control; steps count from 1. The section of a strategy that is not chosen has no
    /// effect.
    pub struct DensityConfig {
        /// The density control.
        strategy: Strategy = Strategy::Mcmc;
        /// Most Gaussians, about 1.2 kB each at SH degree 3.
        cap: usize = 100_000, in Only("from 1 to 2^30", |cap| (1..=1 << 30).contains(cap));
        /// First step at which the count changes; a tenth of a short run. Under `mcmc.full` the second refinement, if
        /// that is earlier.
        start: usize = 500, in 1..;
        /// Steps from one refinement to the next; under `mcmc.full` a ninth of those until the cap, if that is fewer.
        every: usize = 100, in 1..;
        /// Share of the run after which the count is fixed, so that the last Gaussians still converge.
        stop: f64 = 0.8, in SHARE;
        /// Share of the summed contribution to training photos that Gaussians pruned at `stop` have together; 0: none
        /// is pruned.
        prune_share: f64 = 0.0, in 0.0..1.0;
        /// Opacity below which a Gaussian is dead.
        min_opacity: f64 = 0.005, in OPEN_UNIT;
        /// Options of the strategy `mcmc`.
        mcmc: McmcConfig;
        /// Options of the strategy `default`.
        default: ClassicConfig;
    }
}

section! {
    /// Options of relocation under a budget (3DGS-MCMC).
    pub struct McmcConfig {
        /// Growth per refinement, a share of the count; the largest one under `full`.
        growth: f64 = 0.2, in NOT_NEGATIVE;
        /// Share of the run after which the count has reached the cap, at most `full_steps`; 0: by `growth` alone.
        /// Earlier: steps cost more. Later: the last Gaussians have little time.
        full: f64 = 0.45, in SHARE;
        /// Most steps until the cap under `full`. More: a long run is cheaper, and behind a shorter one on the way.
        full_steps: usize = 450, in 1..;
        /// Strength of the position noise of nearly dead Gaussians, in rates of the means. Few photos need less: none
        /// contradicts a Gaussian that has drifted away.
        noise: f64 = 5e5, in NOT_NEGATIVE;
        /// Root mean square distance of a Gaussian and its copies from its former mean, along its longest axis, in
        /// standard deviations. 0: they coincide, as in the paper, and part slowly.
        separation: f64 = 0.7, in 0.0..0.95;
    }
}

section! {
    /// Options of classic adaptive control (3DGS).
    pub struct ClassicConfig {
        /// Mean screen gradient above which a Gaussian is cloned or split, in half image widths.
        gradient: f64 = 2e-4, in POSITIVE;
        /// Whether magnitudes of the gradient are summed over pixels (AbsGS); needs a threshold about four times as
        /// high.
        absgrad: bool = false;
        /// How opacities are lowered.
        opacity_policy: OpacityPolicy = OpacityPolicy::Reset;
        /// Steps from one opacity reset to the next.
        reset_every: usize = 3000, in 1..;
    }
}

impl DensityConfig {
    /// Steps from one refinement to the next in a run of `steps`.
    pub fn interval(&self, steps: usize) -> usize {
        match self.follows_run() {
            true => self.every.min(self.full_step(steps) / REFINEMENTS).max(1),
            false => self.every,
        }
    }

    /// The step of a run of `steps` by which the count is to have reached the cap, under `mcmc.full`.
    fn full_step(&self, steps: usize) -> usize {
        self.mcmc.full_steps.min((self.mcmc.full * steps as f64) as usize)
    }

    fn follows_run(&self) -> bool {
        self.strategy == Strategy::Mcmc && self.mcmc.full > 0.0
    }

    /// The count after the refinement of `step` of a run of `steps` that begins it with `count`, under `mcmc`.
    pub fn grown(&self, count: usize, step: usize, steps: usize) -> usize {
        // A few Gaussians would never become more.
        let least = if self.mcmc.growth > 0.0 && count > 0 { count as f64 + 1.0 } else { 0.0 };
        let most = (count as f64 * (1.0 + self.mcmc.growth)).round().max(least);
        let wanted = match self.follows_run() {
            true => {
                // This refinement and those after it until the cap is to be reached.
                let left = 1 + self.full_step(steps).saturating_sub(step) / self.interval(steps);
                let factor = (self.cap as f64 / count.max(1) as f64).powf(1.0 / left as f64);
                (count as f64 * factor).round().max(least).min(most)
            }
            false => most,
        };
        (wanted as usize).min(self.cap)
    }

    /// Whether the count may change at `step` of a run of `steps`.
    pub fn active(&self, step: usize, steps: usize) -> bool {
        let soon = if self.follows_run() { IDLE * self.interval(steps) } else { usize::MAX };
        step >= self.start.min(steps / 10).min(soon).max(1) && step < self.first_fixed(steps)
    }

    /// Whether the count becomes fixed at `step` of a run of `steps`.
    pub fn rests_at(&self, step: usize, steps: usize) -> bool {
        self.strategy != Strategy::None && step == self.first_fixed(steps)
    }

    /// Whether the count has become fixed by `step` of a run of `steps`; never without density control, to which
    /// nothing comes to an end.
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
    fn growth_reaches_the_cap_at_its_share_of_the_run_and_no_later_in_a_long_one() {
        let config = DensityConfig::default();
        for steps in [300, 1000, 3000, 7000, 30_000] {
            let counts = counts(&config, 55_000, steps);
            let full = counts.iter().position(|count| *count == config.cap).expect("the cap is reached");
            let at = (IDLE + full) * config.interval(steps);
            let wanted = (config.mcmc.full * steps as f64).min(450.0);
            assert!((at as f64 - wanted).abs() <= config.interval(steps) as f64, "{steps} steps: at {at}");
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
        let config = DensityConfig {
            mcmc: McmcConfig { full: 0.0, growth: 0.05, ..McmcConfig::default() },
            ..DensityConfig::default()
        };
        assert_eq!((config.grown(1000, 100, 1000), config.grown(99_000, 100, 1000)), (1050, 100_000));
        assert_eq!((config.interval(300), DensityConfig::default().interval(300)), (100, 15));
    }
}
