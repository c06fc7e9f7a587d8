//! Relocation under a budget: "3D Gaussian Splatting as Markov Chain Monte Carlo" (Kheradmand et al. 2024), sections
//! 3.2 to 3.4.
//!
//! - [`refine`]: dead Gaussians are relocated to live ones drawn by opacity, then the count grows up to the cap. A
//!   Gaussian and its copies share opacity and scale (Eq. 9), so that the image does not change.
//! - [`perturb`]: after each step, the means get noise with the Gaussian's own covariance, gated to nearly transparent
//!   ones: `mean += Sigma n * rate * noise * sigmoid(100 (0.005 - opacity))` (Eq. 8), `n` standard normal.
//!
//! Departures: a Gaussian and its copies stand apart by
//! [`McmcConfig::separation`](crate::config::McmcConfig::separation) along its longest axis, because coincident copies
//! have equal gradients and the noise, which is gated, does not part opaque ones; covariance and rate are in scene
//! extents, which makes the noise independent of the scene's unit and equal to the paper's at extent 1; the moments of
//! both the live Gaussian and its copies are reset to zero.

use burn::module::Param;
use burn::tensor::Tensor;
use gs_burn::Gaussians;
use gs_burn::ops::noise::{NoiseConfig, perturb as add_noise};

use super::{Changes, Refinement, StepContext};
use crate::config::DensityConfig;
use crate::fit::density::ops::{Draft, sample};
use crate::fit::parameters::{Group, Table};
use crate::fit::random::{Purpose, stream};
use gs_burn::adam::Adam;

/// Relocates dead Gaussians to live ones and grows as [`DensityConfig::grown`] says.
pub fn refine(gaussians: &mut Gaussians, adam: &mut Adam, config: &DensityConfig, context: &StepContext) -> Refinement {
    let mut rng = stream(context.seed, Purpose::Density, context.step as u64);
    let mut draft = Draft::read(gaussians);
    let before = draft.len();

    let (dead, alive): (Vec<usize>, Vec<usize>) = (0..before).partition(|row| {
        let opacity = draft.opacity(*row);
        opacity <= config.min_opacity || opacity.is_nan()
    });
    let weights: Vec<f64> = alive.iter().map(|row| draft.opacity(*row)).collect();
    let onto: Vec<usize> = sample(&weights, dead.len(), &mut rng).into_iter().map(|i| alive[i]).collect();
    draft.share_out(&onto, config.min_opacity);
    // Coincident copies need none, and on a GPU a read waits.
    let quats = if config.mcmc.separation > 0.0 { gaussians.read(Group::Quats) } else { Vec::new() };
    let means = draft.spread_out(&onto, &quats, config.mcmc.separation);
    for ((dead, onto), mean) in dead.iter().zip(&onto).zip(means) {
        draft.overwrite(*dead, *onto);
        draft.means[*dead] = mean;
    }

    let wanted = config.grown(before, context.step, context.steps);
    let weights: Vec<f64> = (0..before).map(|row| draft.opacity(row)).collect();
    let copied = sample(&weights, wanted.saturating_sub(before), &mut rng);
    draft.share_out(&copied, config.min_opacity);
    let means = draft.spread_out(&copied, &quats, config.mcmc.separation);
    for (row, mean) in copied.iter().zip(means) {
        let copy = draft.duplicate(*row);
        draft.means[copy] = mean;
    }

    let changes = Changes { added: copied.len(), moved: onto.len(), removed: 0 };
    let rows = (changes != Changes::default()).then(|| draft.commit(gaussians, adam));
    Refinement { changes, rows }
}

/// Adds the position noise of one step.
pub fn perturb(gaussians: &mut Gaussians, noise: f64, context: &StepContext) {
    // In scene units: the covariance over extent^2, times the extent.
    let strength = noise * context.means_lr / context.extent;
    if strength == 0.0 || gaussians.is_empty() {
        return;
    }
    let config = NoiseConfig::new(strength, context.seed, context.step as u64);
    let (quats, log_scales) = (gaussians.quats.val(), gaussians.log_scales.val());
    // The update in place needs a single owner.
    let none = Param::from_tensor(Tensor::empty([0, 3], &gaussians.device()));
    let means = std::mem::replace(&mut gaussians.means, none).into_value();
    gaussians.means = Param::from_tensor(add_noise(means, quats, log_scales, gaussians.opacity_logits.val(), &config));
}
