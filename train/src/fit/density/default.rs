//! Classic adaptive density control (3DGS, section 5.2): clone small Gaussians and split large ones where the screen
//! gradient is high, remove transparent and oversized ones, and lower opacities at intervals.

use burn::tensor::{Device, Tensor};
use glam::Vec3;
use gs_burn::Gaussians;
use gs_burn::ops::statistics::{StatisticsConfig, gather_statistics};

use super::{Changes, Observation, Refinement, StepContext};
use crate::config::{DensityConfig, OpacityPolicy};
use crate::fit::density::ops::{Draft, logit, rotation, sigmoid};
use crate::fit::parameters::{Group, Table, from_host, to_host};
use crate::fit::random::{Purpose, normal_triple, stream};
use crate::fit::schedule::due;
use gs_burn::adam::Adam;

/// The scales of a split Gaussian's parts are divided by this factor (3DGS: phi).
const SPLIT_SHRINK: f64 = 1.6;

/// Scale above which a Gaussian is split instead of cloned, in scene extents (3DGS).
const SPLIT_SIZE: f64 = 0.01;

/// Scale above which a Gaussian is removed, once opacities have been lowered, in scene extents (3DGS).
const PRUNE_SIZE: f64 = 0.1;

/// Share of the opacity lost at each refinement under the decay policy (Brush).
const DECAY: f64 = 0.004;

/// Opacities are lowered to at most this many times the opacity of a dead Gaussian (3DGS: 0.01 for 0.005).
const RESET_TO: f64 = 2.0;

/// Statistics of classic adaptive control since the last refinement.
#[derive(Debug, Clone)]
pub struct Adaptive {
    /// Sum over views of the norm of the screen gradient, `[N]`, by image coordinates from -1 to 1.
    pub gradient: Tensor<1>,
    /// Number of views that showed the Gaussian, `[N]`.
    pub views: Tensor<1>,
}

impl Adaptive {
    /// Empty statistics of `n` Gaussians.
    pub fn new(n: usize, device: &Device) -> Self {
        Self { gradient: Tensor::zeros([n], device), views: Tensor::zeros([n], device) }
    }

    /// Adds one view. The gradient is with respect to image coordinates from -1 to 1, as in 3DGS, so that one threshold
    /// serves every resolution.
    pub fn gather(&mut self, observation: Observation, absolute: bool) {
        let Observation { screen, radii, width, height } = observation;
        let [_, columns] = radii.dims();
        let config = StatisticsConfig { width: width as u32, height: height as u32, absolute, columns };
        // An update in place needs a single owner.
        let device = screen.device();
        let none = Self { gradient: Tensor::empty([0], &device), views: Tensor::empty([0], &device) };
        let Self { gradient, views } = std::mem::replace(self, none);
        let (gradient, views) = gather_statistics(gradient, views, screen, radii, &config);
        *self = Self { gradient, views };
    }

    /// Clones, splits and removes, never above `config.cap`; the statistics are reset.
    pub fn refine(
        &mut self,
        gaussians: &mut Gaussians,
        adam: &mut Adam,
        config: &DensityConfig,
        context: &StepContext,
    ) -> Refinement {
        let mut draft = Draft::read(gaussians);
        let before = draft.len();
        let mut chosen = self.above_threshold(config.default.gradient);
        // If the budget does not allow all, the highest gradients come first.
        chosen.truncate(config.cap.saturating_sub(before));
        let split = split_or_clone(&mut draft, gaussians, chosen.iter().map(|(row, _)| *row), context);

        let opacities_were_lowered =
            config.default.opacity_policy != OpacityPolicy::Reset || context.step > config.default.reset_every;
        let largest = if opacities_were_lowered { PRUNE_SIZE * context.extent } else { f64::INFINITY };
        let grown = draft.len();
        let was_split = |row: usize| split.get(row).is_some_and(|split| *split);
        // A comparison with NaN is false, so a Gaussian that is not finite is removed too.
        let counts = |draft: &Draft, row| draft.opacity(row) > config.min_opacity && draft.size(row) <= largest;
        let some_stay = (0..grown).any(|row| !was_split(row) && counts(&draft, row));
        if !some_stay {
            // No gradient could restore a scene without Gaussians.
            tracing::warn!(
                step = context.step,
                "density.min_opacity and the largest scale would leave no Gaussian: none is removed"
            );
        }
        draft.retain(|draft, row| !was_split(row) && (!some_stay || counts(draft, row)));
        let after = draft.len();
        let rows = Some(draft.commit(gaussians, adam));
        *self = Self::new(after, &gaussians.device());
        Refinement { changes: Changes { added: grown - before, moved: 0, removed: grown - after }, rows }
    }

    /// Rows whose mean gradient is at least `threshold`, in descending order, ties by row.
    fn above_threshold(&self, threshold: f64) -> Vec<(usize, f32)> {
        let (sums, views) = (to_host(self.gradient.clone()), to_host(self.views.clone()));
        let means = sums.iter().zip(&views).map(|(sum, views)| sum / views.max(1.0));
        let mut rows: Vec<(usize, f32)> = means.enumerate().filter(|(_, mean)| f64::from(*mean) >= threshold).collect();
        rows.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        rows
    }
}

/// Appends a copy of each small row, and two smaller parts of each large one at random positions inside it. Returns
/// which of the old rows were split and must be removed; the count grows by one per chosen row either way.
fn split_or_clone(
    draft: &mut Draft,
    gaussians: &Gaussians,
    rows: impl Iterator<Item = usize>,
    context: &StepContext,
) -> Vec<bool> {
    let mut rng = stream(context.seed, Purpose::Density, context.step as u64);
    let quats = gaussians.read(Group::Quats);
    let mut split = vec![false; draft.len()];
    for row in rows {
        if draft.size(row) <= SPLIT_SIZE * context.extent {
            draft.duplicate(row);
            continue;
        }
        split[row] = true;
        let rotation = rotation(&quats, row);
        for _ in 0..2 {
            let part = draft.duplicate(row);
            let size = Vec3::from(draft.log_scales[row]).exp();
            let offset = rotation * (size * normal_triple(&mut rng).as_vec3());
            draft.means[part] = (Vec3::from(draft.means[row]) + offset).to_array();
            draft.scale(part, 1.0 / SPLIT_SHRINK);
        }
    }
    split
}

/// Lowers opacities if `config.default.opacity_policy` does so after this step.
pub fn lower_opacities(gaussians: &mut Gaussians, adam: &mut Adam, config: &DensityConfig, context: &StepContext) {
    if !context.is_active(config) {
        return;
    }
    let lower: Box<dyn Fn(f64) -> f64> = match config.default.opacity_policy {
        OpacityPolicy::Reset if due(context.step, config.default.reset_every) => {
            adam.forget(Group::Opacity.path());
            Box::new(|opacity| opacity.min(RESET_TO * config.min_opacity))
        }
        OpacityPolicy::Decay if due(context.step, config.every) => Box::new(|opacity| opacity * (1.0 - DECAY)),
        _ => return,
    };
    let logits = gaussians.read(Group::Opacity);
    let lowered = logits.iter().map(|x| logit(lower(sigmoid(f64::from(*x)))) as f32).collect();
    gaussians.set(Group::Opacity, from_host(lowered, 1, &gaussians.device()));
}
