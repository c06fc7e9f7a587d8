//! The update of all learned quantities of the method (paper, 4.1: Adam with moments 0.9 and 0.999, separate rates).

use burn::tensor::Tensor;
use gs_burn::adam::{Adam, AdamRate};
use gs_burn::ops::rows::take_rows;
use gs_burn::{Gaussians, NamedGradients, RowMap};
use gs_models::taylormode::TaylorMotion;

use super::common_motion::{self, Pace};
use super::curriculum::{FOLLOW_UNTIL, SELECT_FROM, opening};
use super::score::Score;
use super::{Step, Taylormode};
use gs_train::fit::parameters::{Group, Table};
use gs_train::fit::schedule::{due, exponential};

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
            // A camera's own exposure has a gradient in one of so many steps. Adam's steps then are as long as that by
            // the root of their number in all.
            exposure: exposure * (model.cameras.len().max(1) as f64).sqrt(),
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
            "motion" if name.starts_with("motion.bodies") => common_motion::rate(&position),
            "motion" => position,
            // While held, its rate is 0 but Adam's moments still run; starting them late would make the first steps too
            // long.
            "exposure" => AdamRate::new(self.exposure),
            _ => AdamRate::new(self.network),
        }
    }
}

/// A body before its step.
struct BeforeStep {
    /// Of its rows, `[M, 4]`.
    basis: Tensor<2>,
    /// Its blocks, `[4, 3 (K + J)]`.
    blocks: Tensor<2>,
}

impl Taylormode {
    /// One Adam update of all parameters; each body's paths take their common step in addition to their own.
    pub(super) fn updated(
        self,
        gaussians: &Gaussians,
        gradients: &mut NamedGradients,
        adam: &mut Adam,
        at: &Step,
    ) -> Self {
        let rates = Rates::of(&self, at);
        let order = self.motion.order();
        let (common, of_paths) = self.common_gradients(gaussians, gradients);
        // What is computed and not learned.
        let is_fixed = |path: &str| path.starts_with("method.score.") || path.ends_with(".turn");
        let rate = |path: &str| (!is_fixed(path)).then(|| rates.at(path));
        let mut model: Self = adam.update_under(ROOT, self, gradients, rate);
        let pace = Pace { lr: rates.position, turn: at.config.method.cues.turn, order };
        let steps = model.motion.bodies.iter_mut().zip(common);
        let change = steps.map(|(body, before)| common_motion::step(body, before.basis, before.blocks, pace));
        if let Some(change) = change.reduce(|a, b| a + b) {
            let [rows, columns] = change.dims();
            let of_paths = match &mut model.motion.kinks {
                Some(kinks) => {
                    let part = |from: usize, to: usize| change.clone().slice([0..rows, from..to]);
                    kinks.jumps = kinks.jumps.clone().map(|jumps| jumps + part(3 * order, columns));
                    part(0, 3 * order)
                }
                None => change,
            };
            model.motion.position = model.motion.position.map(|position| position + of_paths);
        }
        model.score = match (model.score, of_paths) {
            (Some(score), Some(of_paths)) if at.progress() >= SELECT_FROM => Some(score.with(of_paths)),
            (score, _) => score,
        };
        if let Some(share) = opening(at) {
            model.motion.open((share * order as f64).ceil() as usize);
        }
        if at.step == (FOLLOW_UNTIL * at.config.steps as f64) as usize {
            model.motion.release();
        }
        model.held_to_orders(gaussians, adam)
    }

    /// Adds the gradients of the bodies' blocks, which are not part of the graph, to those of their rows' paths; the
    /// answer is each body's basis and its blocks before the step, and the gradients of paths and jumps.
    fn common_gradients(
        &self,
        gaussians: &Gaussians,
        gradients: &mut NamedGradients,
    ) -> (Vec<BeforeStep>, Option<Tensor<2>>) {
        let of_paths = gradients.get("method.motion.position").cloned();
        let Some(of_paths) = of_paths.filter(|gradient| gradient.dims().iter().all(|size| *size > 0)) else {
            return (Vec::new(), None);
        };
        let joined = match gradients.get("method.motion.kinks.jumps") {
            Some(of_jumps) => Tensor::cat(vec![of_paths, of_jumps.clone()], 1),
            None => of_paths,
        };
        let positions = take_rows(gaussians.means.val(), &self.motion.row_tensor());
        let bases = self.motion.bases(&positions);
        for (index, basis) in bases.iter().enumerate() {
            let of_body = common_motion::gradient(basis, joined.clone());
            gradients.insert(format!("method.motion.bodies.{index}.blocks"), of_body);
        }
        let before = self.motion.bodies.iter().map(|body| body.blocks.val());
        (
            bases
                .into_iter()
                .zip(before.collect::<Vec<_>>())
                .map(|(basis, blocks)| BeforeStep { basis, blocks })
                .collect(),
            Some(joined),
        )
    }

    /// Once every photo was seen since the last test, gives rows the blocks that they have earned beside their bodies.
    pub(super) fn tested(mut self, gaussians: &Gaussians, adam: &mut Adam, photos: usize, at: &Step) -> Self {
        let every = at.config.method.motion.select_every;
        if due(at.step, every) && self.score.is_some() {
            self.motion.turn_bodies();
        }
        let Some(score) = self.score.as_ref().filter(|score| score.photos >= photos.max(every)) else { return self };
        let earned = score.earn(&mut self.motion, &gaussians.read(Group::Means));
        tracing::debug!(step = at.step, earned, followers = self.motion.followers(), "motion beside that of bodies");
        self.score = Some(Score::new(&self.motion, &gaussians.device()));
        self.held_to_orders(gaussians, adam)
    }

    /// Keeps the blocks above each Gaussian's order at those of its body: Adam's first moment would push them on.
    pub(super) fn held_to_orders(mut self, gaussians: &Gaussians, adam: &mut Adam) -> Self {
        for (name, mask) in self.motion.order_masks() {
            if let (Some(mask), Some(moments)) = (mask, adam.moments.get_mut(&format!("method.motion.{name}"))) {
                moments.first = moments.first.clone() * mask;
            }
        }
        self.motion = self.motion.hold_orders(&gaussians.means.val());
        self
    }

    /// Follows a change of the Gaussians' rows.
    pub(super) fn followed(mut self, rows: &RowMap, adam: &mut Adam) -> Self {
        let (motion, own) = self.motion.follow(rows);
        self.motion = motion;
        self.score = self.score.map(|score| score.follow(&own));
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
