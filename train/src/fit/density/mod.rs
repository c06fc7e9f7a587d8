//! Where Gaussians are added, moved and removed: [`default`] (classic adaptive control, 3DGS) and [`mcmc`] (relocation
//! under a budget, 3DGS-MCMC) decide when and where, with the verbs of [`ops`]. At its end, [`prune`] removes the Gaussians that add nothing.

pub mod default;
pub mod mcmc;
pub mod ops;
pub mod prune;

use burn::tensor::Tensor;
use gs_burn::Gaussians;

use crate::config::{DensityConfig, Strategy};
use crate::fit::schedule::due;
use gs_burn::RowMap;
use gs_burn::adam::Adam;

pub use default::Adaptive;

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
pub struct StepContext {
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
    /// Dead ones that were relocated.
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
    pub rows: Option<RowMap>,
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
    /// The control that `config` asks for, over `gaussians`.
    pub fn new(config: &DensityConfig, gaussians: &Gaussians) -> Self {
        match config.strategy {
            Strategy::None => Self::None,
            Strategy::Mcmc => Self::Mcmc,
            Strategy::Default => Self::Adaptive(Adaptive::new(gaussians.len(), &gaussians.device())),
        }
    }

    /// Whether the step should compute screen gradients.
    pub fn wants_screen(&self, config: &DensityConfig, step: usize, steps: usize) -> bool {
        // Statistics gather from the first step on, as in 3DGS, and as long as they are still used.
        matches!(self, Self::Adaptive(_)) && (step as f64) < config.stop * steps as f64
    }

    /// What happens after the update of `context.step`.
    pub fn after_step(
        &mut self,
        gaussians: &mut Gaussians,
        adam: &mut Adam,
        observations: &[Observation],
        config: &DensityConfig,
        context: &StepContext,
    ) -> Refinement {
        if let Self::Adaptive(adaptive) = &mut *self {
            for observation in observations {
                if let Some(screen) = &observation.screen {
                    adaptive.gather(screen, observation, config.absgrad);
                }
            }
        }
        let mut refinement = Refinement::default();
        if due(context.step, config.every) && config.active(context.step, context.steps) {
            refinement = match self {
                Self::None => Refinement::default(),
                Self::Mcmc => mcmc::refine(gaussians, adam, config, context),
                Self::Adaptive(adaptive) => adaptive.refine(gaussians, adam, config, context),
            };
            tracing::debug!(step = context.step, gaussians = gaussians.len(), changes = ?refinement.changes, "density");
        }
        match self {
            Self::None => {}
            Self::Mcmc => mcmc::perturb(gaussians, config.noise, context),
            Self::Adaptive(_) => default::lower_opacities(gaussians, adam, config, context),
        }
        refinement
    }
}
