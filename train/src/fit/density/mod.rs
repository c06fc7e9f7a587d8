//! Density control: adding, relocating and removing Gaussians. [`default`] (classic adaptive control, 3DGS) and
//! [`mcmc`] (relocation under a budget, 3DGS-MCMC) decide when and where; [`ops`] has the operations. After the last
//! refinement, [`prune`] removes the Gaussians that contribute next to nothing.

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

/// The data of one rendering for density control, in steps in which [`Density::wants_screen`] is true.
#[derive(Debug)]
pub struct Observation {
    /// Gradient of the loss with respect to each 2D mean, `[N, 4]` (`SCREEN` rows).
    pub screen: Tensor<2>,
    /// Rows whose last column is the radius of each Gaussian in the image, `[N, C]`, pixels; 0 if it was not seen.
    pub radii: Tensor<2>,
    /// Image width, pixels.
    pub width: usize,
    /// Image height, pixels.
    pub height: usize,
}

/// The state of the run at a refinement.
#[derive(Debug, Clone, Copy)]
pub struct StepContext {
    /// The step just taken, from 1.
    pub step: usize,
    /// Steps of the whole run.
    pub steps: usize,
    /// The seed of all draws.
    pub seed: u64,
    /// The scene's extent, scene units.
    pub extent: f64,
    /// Learning rate of the means at this step, in scene extents.
    pub means_lr: f64,
    /// The request of the method at this step.
    pub control: Control,
}

/// The request of a method to density control at a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// Refinements from `density.start` to `density.stop`.
    Scheduled,
    /// Gaussians are left as they are; statistics are gathered all the same.
    Rests,
    /// Refinements also after `density.stop`.
    Resumes,
}

impl StepContext {
    /// Whether the count and opacities may change now.
    fn is_active(&self, config: &DensityConfig) -> bool {
        match self.control {
            Control::Scheduled => config.active(self.step, self.steps),
            Control::Rests => false,
            Control::Resumes => true,
        }
    }
}

/// Numbers of Gaussians that a refinement changed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Changes {
    /// Added Gaussians.
    pub added: usize,
    /// Relocated dead Gaussians.
    pub moved: usize,
    /// Removed Gaussians.
    pub removed: usize,
}

/// A change of the table of Gaussians.
#[derive(Debug, Clone, Default)]
pub struct Refinement {
    /// Numbers of Gaussians changed.
    pub changes: Changes,
    /// The old row of each new row; `None` if no row moved.
    pub rows: Option<RowMap>,
}

/// The density control of a run, with its statistics.
#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant)] // there is one per run
pub enum Density {
    /// The count never changes.
    None,
    /// Relocation under a budget; keeps no statistics.
    Mcmc,
    /// Classic adaptive control.
    Adaptive(Adaptive),
}

impl Density {
    /// The density control of `config`, for `gaussians`.
    pub fn new(config: &DensityConfig, gaussians: &Gaussians) -> Self {
        match config.strategy {
            Strategy::None => Self::None,
            Strategy::Mcmc => Self::Mcmc,
            Strategy::Default => Self::Adaptive(Adaptive::new(gaussians.len(), &gaussians.device())),
        }
    }

    /// Whether the step should compute screen gradients.
    pub fn wants_screen(&self, config: &DensityConfig, control: Control, step: usize, steps: usize) -> bool {
        // Statistics are gathered from the first step on, as in 3DGS, for as long as they are used.
        let used = control == Control::Resumes || !config.rests_by(step, steps);
        used && matches!(self, Self::Adaptive(_))
    }

    /// Acts after the update of `context.step`.
    pub fn after_step(
        &mut self,
        gaussians: &mut Gaussians,
        adam: &mut Adam,
        observations: Vec<Observation>,
        config: &DensityConfig,
        context: &StepContext,
    ) -> Refinement {
        if let Self::Adaptive(adaptive) = &mut *self {
            observations.into_iter().for_each(|observation| adaptive.gather(observation, config.default.absgrad));
        }
        let mut refinement = Refinement::default();
        if due(context.step, config.interval(context.steps)) && context.is_active(config) {
            refinement = match self {
                Self::None => Refinement::default(),
                Self::Mcmc => mcmc::refine(gaussians, adam, config, context),
                Self::Adaptive(adaptive) => adaptive.refine(gaussians, adam, config, context),
            };
            tracing::debug!(step = context.step, gaussians = gaussians.len(), changes = ?refinement.changes, "density");
        }
        match self {
            Self::None => {}
            Self::Mcmc => mcmc::perturb(gaussians, config.mcmc.noise, context),
            Self::Adaptive(_) => default::lower_opacities(gaussians, adam, config, context),
        }
        refinement
    }
}
