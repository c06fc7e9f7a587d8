//! Where Gaussians are added, moved and removed: [`default`] (classic adaptive control, 3DGS) and [`mcmc`] (relocation
//! under a budget, 3DGS-MCMC) decide when and where, with the verbs of [`ops`]. At the end of it, [`trim`] drops what adds nothing.

pub mod default;
pub mod mcmc;
pub mod ops;
pub mod trim;

use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};

use crate::experiment::{ConfigError, check, not_negative, open_unit, positive};
use crate::optimiser::Optimiser;
use crate::parameters::Parameters;
use crate::schedule::due;

pub use default::{Adaptive, OpacityPolicy};
pub use ops::Succession;

/// Which density control.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Relocation under a budget (3DGS-MCMC): the count grows to the cap and stays there.
    Mcmc,
    /// Classic adaptive control (3DGS): the count follows screen gradients, never above the cap.
    Default,
    /// The first Gaussians stay.
    None,
}

/// Density control of both kinds; steps count from 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DensityConfig {
    /// Which density control.
    pub strategy: Strategy,
    /// Gaussians, at most. Memory is about 1.2 kB each at SH degree 3; see what a run prints first.
    pub cap: usize,
    /// First step at which the count changes; a short run starts after a tenth of its steps at the latest.
    pub start: usize,
    /// Steps from one change to the next.
    pub every: usize,
    /// Share of the run after which the count rests, so that the last Gaussians still learn.
    pub stop: f64,
    /// Share of all that the training photos show which the Gaussians dropped when the count comes to rest may have had between
    /// them, 0 to 1; 0: none are dropped.
    pub trim: f64,
    /// Opacity under which a Gaussian counts as dead.
    pub min_opacity: f64,
    /// `mcmc`: growth per change, a share of the count.
    pub growth: f64,
    /// `mcmc`: strength of the position noise of nearly dead Gaussians, relative to the centres' rate; 0: none. With few
    /// photos less is better: nothing contradicts a Gaussian that wandered off.
    pub noise: f64,
    /// `default`: mean screen gradient above which a Gaussian is cloned or split, in half image widths.
    pub gradient: f64,
    /// `default`: add up the gradient's magnitude over pixels (AbsGS) instead of the gradient; wants a threshold about four
    /// times as high.
    pub absgrad: bool,
    /// `default`: size that separates cloning (below) from splitting, in scene extents.
    pub split_size: f64,
    /// `default`: size above which a Gaussian is removed once opacities were first lowered, in scene extents.
    pub prune_size: f64,
    /// `default`: how opacities are lowered so that useless Gaussians die.
    pub opacity_policy: OpacityPolicy,
    /// `default`: steps from one opacity reset to the next.
    pub reset_every: usize,
    /// `default`: opacity lost at each change under the decay policy, as a share.
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
            trim: 0.0,
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
        check("density.trim", self.trim, (0.0..1.0).contains(&self.trim), "at least 0 and below 1")?;
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

    /// Whether the count comes to rest at `step` of a run of `steps`.
    pub fn rests_at(&self, step: usize, steps: usize) -> bool {
        self.strategy != Strategy::None && step == (self.stop * steps as f64).ceil() as usize
    }
}

/// What a step tells density control.
#[derive(Debug)]
pub struct Observation {
    /// Gradient of the loss by each 2D mean, `[N, 4]` (`SCREEN` rows); present when [`Density::wants_screen`] said so.
    pub screen: Option<Tensor<2>>,
    /// Radius of each Gaussian in the image, `[N]`, pixels; 0 when it was not seen.
    pub radii: Tensor<1>,
    /// Image width, pixels.
    pub width: usize,
    /// Image height, pixels.
    pub height: usize,
}

/// Where in the run a change happens.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// The step just taken, from 1.
    pub step: usize,
    /// Steps of the whole run.
    pub steps: usize,
    /// The seed of all draws.
    pub seed: u64,
    /// The scene's size, scene units.
    pub extent: f64,
    /// Rate of the centres at this step, in scene extents.
    pub means_lr: f64,
}

/// How many Gaussians a change touched.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Changes {
    /// New ones.
    pub added: usize,
    /// Dead ones given a new place.
    pub moved: usize,
    /// Removed ones.
    pub removed: usize,
}

/// A change of the table.
#[derive(Debug, Clone, Default)]
pub struct Refinement {
    /// How many Gaussians it touched.
    pub changes: Changes,
    /// Where each row came from; `None` when no row moved.
    pub succession: Option<Succession>,
}

/// The density control of a run, with its statistics.
#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant)] // there is one per run
pub enum Density {
    /// Nothing changes.
    None,
    /// Relocation under a budget; keeps no statistics.
    Mcmc,
    /// Classic adaptive control.
    Adaptive(Adaptive),
}

impl Density {
    /// The control that `config` asks for, over `parameters`.
    pub fn new(config: &DensityConfig, parameters: &Parameters) -> Self {
        match config.strategy {
            Strategy::None => Self::None,
            Strategy::Mcmc => Self::Mcmc,
            Strategy::Default => Self::Adaptive(Adaptive::new(parameters.len(), &parameters.device())),
        }
    }

    /// Whether the step should compute screen gradients.
    pub fn wants_screen(&self, config: &DensityConfig, step: usize, steps: usize) -> bool {
        // Statistics gather from the first step on, as in 3DGS, and as long as they are still used.
        matches!(self, Self::Adaptive(_)) && (step as f64) < config.stop * steps as f64
    }

    /// What happens after the update of `moment.step`.
    pub fn after_step(
        &mut self,
        parameters: &mut Parameters,
        optimiser: &mut Optimiser,
        observation: &Observation,
        config: &DensityConfig,
        moment: &Moment,
    ) -> Refinement {
        if let (Self::Adaptive(adaptive), Some(screen)) = (&mut *self, &observation.screen) {
            adaptive.gather(screen, observation, config.absgrad);
        }
        let mut refinement = Refinement::default();
        if due(moment.step, config.every) && config.active(moment.step, moment.steps) {
            refinement = match self {
                Self::None => Refinement::default(),
                Self::Mcmc => mcmc::refine(parameters, optimiser, config, moment),
                Self::Adaptive(adaptive) => adaptive.refine(parameters, optimiser, config, moment),
            };
            tracing::debug!(step = moment.step, gaussians = parameters.len(), changes = ?refinement.changes, "density");
        }
        match self {
            Self::None => {}
            Self::Mcmc => mcmc::perturb(parameters, config.noise, moment),
            Self::Adaptive(_) => default::lower_opacities(parameters, optimiser, config, moment),
        }
        refinement
    }
}
