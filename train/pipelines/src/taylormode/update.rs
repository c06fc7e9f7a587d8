//! The update of all learned quantities of the method (paper, 4.1: Adam with moments 0.9 and 0.999, separate rates).

use burn::tensor::Tensor;
use gs_burn::adam::{Adam, AdamRate};
use gs_burn::ops::rows::take_rows;
use gs_burn::{Gaussians, NamedGradients, RowMap};
use gs_models::taylormode::TaylorMotion;

use super::common_motion::{CommonMotion, bases};
use super::config::BlurMode;
use super::curriculum::opening;
use super::{Config, Step, Taylormode};
use gs_train::fit::schedule::exponential;

/// Steps over which the learning rates of motion rise linearly to their full value.
const WARM_UP: f64 = 100.0;

/// Largest share of a run for this rise.
const WARM_UP_SHARE: f64 = 0.1;

/// Learning rate of the remainder's network (paper: of all networks). All Gaussians share it, so a larger rate perturbs
/// the whole object at each step.
const REMAINDER_LR: f64 = 1e-4;

/// Path of the method in the model's tree.
const ROOT: &str = "method";

/// Learning rates of one step.
struct Rates {
    /// Rate of the paths' coefficients, scene units.
    position: f64,
    /// Rate of the rotations' coefficients, radians.
    rotation: f64,
    /// Rate of the exposure's logarithm.
    exposure: f64,
    /// Rate of the networks that form the blur.
    network: f64,
    /// Rate of the 3D remainder's network.
    remainder: f64,
}

impl Rates {
    fn of(model: &Taylormode, at: &Step) -> Self {
        let (config, step) = (at.config, at.step);
        let (motion, blur) = (&config.method.motion, &config.method.blur);
        // Adam's first steps have full length in every block whatever the gradient: together they would move a path
        // across the scene.
        let warm = (step as f64 / WARM_UP.min(WARM_UP_SHARE * config.steps as f64).max(1.0)).min(1.0);
        let decay = warm * exponential(1.0, motion.final_share, step, config.steps);
        let held =
            if model.stated_exposure.is_some() { (blur.exposure_from * config.steps as f64) as usize } else { 0 };
        let exposure = match blur.learn_exposure && step > held {
            true => blur.exposure_lr * exponential(1.0, motion.final_share, step - held, config.steps - held),
            false => 0.0,
        };
        Self {
            position: motion.position_lr * decay * at.facts.extent,
            rotation: motion.rotation_lr * decay,
            exposure,
            network: blur.network_lr,
            remainder: REMAINDER_LR * decay,
        }
    }

    /// The rate of the parameter at a path below the method.
    fn at(&self, path: &str) -> AdamRate {
        let name = path.strip_prefix("method.").unwrap_or(path);
        let position = AdamRate::new(self.position);
        match name.split('.').next().unwrap_or_default() {
            "motion" if name.starts_with("motion.rotation") => AdamRate::new(self.rotation),
            "motion" if name.starts_with("motion.remainder") => AdamRate::new(self.remainder),
            "motion" => position,
            // While held, its rate is 0 but Adam's moments still run; starting them late would make the first steps too
            // long.
            "exposure" => AdamRate::new(self.exposure),
            "objects" => CommonMotion::rate(&position),
            _ => AdamRate::new(self.network),
        }
    }
}

/// Whether the exposure is ever learned, through a formed blur that is compared.
pub fn learns_exposure(model: &Taylormode, config: &Config) -> bool {
    let blur = &config.method.blur;
    let is_compared = match blur.mode {
        BlurMode::None => false,
        BlurMode::Warp => config.method.prior.blur > 0.0,
        BlurMode::Integrate => true,
    };
    blur.learn_exposure && is_compared && !(model.stated_exposure.is_some() && blur.exposure_from >= 1.0)
}

impl Taylormode {
    /// One Adam update of all parameters; each object's paths take their common step in addition to their own.
    pub(super) fn updated(
        self,
        gaussians: &Gaussians,
        gradients: &mut NamedGradients,
        adam: &mut Adam,
        at: &Step,
    ) -> Self {
        let rates = Rates::of(&self, at);
        let of_paths = gradients.get("method.motion.position").cloned();
        let common = of_paths.filter(|gradient| gradient.dims().iter().all(|size| *size > 0)).map(|gradient| {
            let positions = take_rows(gaussians.means.val(), &self.motion.row_tensor());
            let bases = bases(&self.objects, &positions, at.config.method.cues.turn);
            for (index, basis) in bases.iter().enumerate() {
                // The sum is not part of the graph: its gradient is that of the paths.
                let of_sum = CommonMotion::gradient(basis, gradient.clone());
                gradients.insert(format!("method.objects.{index}.sum"), of_sum);
            }
            let before: Vec<Tensor<2>> = self.objects.iter().map(|object| object.sum.val()).collect();
            bases.into_iter().zip(before).collect::<Vec<_>>()
        });
        // Without a path the sums have no gradient, and their moments are kept.
        let rests = |path: &str| common.is_none() && path.starts_with("method.objects.");
        let rate = |path: &str| (!rests(path)).then(|| rates.at(path));
        let mut model: Self = adam.update_under(ROOT, self, gradients, rate);
        // Blocks that are not learned yet would shorten the step of the others.
        let learned = model.motion.learned_blocks();
        let changes = common.into_iter().flatten().zip(&model.objects);
        let change =
            changes.map(|((basis, before), object)| object.change(basis, before, learned.as_ref(), rates.position));
        if let Some(change) = change.reduce(|a, b| a + b) {
            model.motion.position = model.motion.position.map(|position| position + change);
        }
        if let Some(share) = opening(at) {
            model.motion.open((share * model.motion.order() as f64).ceil() as usize);
        }
        model.held_to_orders(adam)
    }

    /// Keeps the blocks above each Gaussian's order at zero: Adam's first moment would push them on.
    pub(super) fn held_to_orders(mut self, adam: &mut Adam) -> Self {
        for (name, mask) in self.motion.order_masks() {
            if let (Some(mask), Some(moments)) = (mask, adam.moments.get_mut(&format!("method.motion.{name}"))) {
                moments.first = moments.first.clone() * mask;
            }
        }
        self.motion = self.motion.hold_orders();
        self
    }

    /// Follows a change of the Gaussians' rows.
    pub(super) fn followed(mut self, rows: &RowMap, adam: &mut Adam) -> Self {
        let (motion, own) = self.motion.follow(rows);
        self.motion = motion;
        follow_moments(adam, &own);
        self
    }
}

/// Moments of tensors with a row per moving Gaussian follow a change of those rows.
pub(super) fn follow_moments(adam: &mut Adam, own: &RowMap) {
    for name in TaylorMotion::ROW_PARAMETERS {
        adam.follow(&format!("method.motion.{name}"), own);
    }
}
