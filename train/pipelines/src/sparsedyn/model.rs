//! All learned quantities of the dynamics, as one Burn module.

use std::collections::BTreeMap;

use burn::module::Module;
use burn::tensor::{Device, Int, Tensor};
use gs_base::counted;
use gs_burn::RowMap;
use gs_models::sparsedyn::bodies::motion::RHYTHMS;
use gs_models::sparsedyn::bodies::{Bodies, BodyFrame, NodeFrame, Span};
use gs_models::sparsedyn::rollout::STEPS_MAX;
use gs_models::sparsedyn::{
    CodedField, CodedFieldConfig, Deformation, DeformationConfig, DynamicsField, DynamicsFieldConfig, RolloutOptions,
};
use serde::{Deserialize, Serialize};

use super::clock::Clock;
use super::config::{DynamicsConfig, MotionModel};
use gs_train::fit::parameters::indices;

/// The module of the method, beside the Gaussians.
#[derive(Module, Debug)]
pub struct Sparsedyn {
    /// Velocity, acceleration, angular velocity and angular acceleration by position and time (Eq. 3).
    pub field: Option<DynamicsField>,
    /// Rigid motions mixed by codes, of the baseline FreeGave.
    pub coded: Option<CodedField>,
    /// The deformation field of the baselines and of the hybrid.
    pub deformation: Option<Deformation>,
    /// Rigid bodies, once they are found.
    pub bodies: Option<Bodies>,
    /// The constants of the module.
    #[module(skip)]
    pub frame: Frame,
    /// The model that moves the Gaussians.
    #[module(skip)]
    pub model: MotionModel,
    /// How the field is integrated.
    #[module(skip)]
    pub options: RolloutOptions,
}

/// The constants of a [`Sparsedyn`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// The unit of time of all that follows, and of the field and the bodies.
    #[serde(default)]
    pub clock: Clock,
    /// The Gaussians that may move, ascending.
    pub rows: Vec<u32>,
    /// The body of each of them; -1: the field moves it.
    pub labels: Vec<i32>,
    /// Constants of the bodies.
    pub bodies: Vec<BodyFrame>,
    /// Constants of the nodes that bend them.
    pub nodes: Vec<NodeFrame>,
    /// Knots of the bodies' free motion.
    pub knots: usize,
    /// A pixel at the moving Gaussians, scene units.
    #[serde(with = "gs_models::bits")]
    pub pixel: f64,
    /// The canonical time: the first frame's.
    #[serde(with = "gs_models::bits")]
    pub start: f64,
    /// First and last time that was seen.
    #[serde(with = "gs_models::bits")]
    pub span: [f64; 2],
    /// Length of an integration step.
    #[serde(with = "gs_models::bits")]
    pub step: f64,
    /// The reference point of velocities, scene units.
    #[serde(with = "gs_models::bits")]
    pub centre: [f64; 3],
    /// The unit of lengths in the field, scene units.
    #[serde(with = "gs_models::bits")]
    pub length: f64,
}

/// Most knots that a frame may name: far above any recording's, and small enough to allocate.
const KNOTS_MAX: usize = 1 << 16;

impl Frame {
    /// Checks that the numbers are usable, after they were read from a file.
    ///
    /// # Errors
    /// A sentence when they are not.
    pub fn check(&self) -> Result<(), String> {
        let numbers = self.centre.iter().chain(&self.span).chain([&self.start, &self.step, &self.length]);
        let usable = numbers.clone().all(|x| x.is_finite()) && self.step > 0.0 && self.length > 0.0;
        let usable = usable && self.clock.is_usable();
        // Every time that was seen is within a rollout, so that a page of the scene can be made.
        let seen = self.span.iter().all(|time| (time - self.start).abs() <= (STEPS_MAX - 1.0) * self.step);
        let ascending = self.rows.windows(2).all(|pair| pair[0] < pair[1]);
        let labelled = self.labels.len() == self.rows.len()
            && self.labels.iter().all(|label| (-1..self.bodies.len() as i32).contains(label));
        let known = self.knots <= KNOTS_MAX && self.bodies.iter().all(|body| body.law.is_known());
        let is_body = |body: &BodyFrame| {
            let sure = body.confidence.is_none_or(|share| (0.0..=1.0).contains(&share));
            let usable = body.centre.iter().all(|x| x.is_finite()) && body.since.is_finite();
            let tied = body.multiples.is_empty() || body.multiples.len() == body.rhythms as usize;
            usable && sure && tied && body.rhythms as usize <= RHYTHMS
        };
        let is_node = |node: &NodeFrame| {
            node.body < self.bodies.len() && node.width > 0.0 && node.centre.iter().all(|x| x.is_finite())
        };
        let known = known && self.bodies.iter().all(is_body) && self.nodes.iter().all(is_node);
        match usable && seen && ascending && labelled && known {
            true => Ok(()),
            false => Err("the constants of the dynamics are not usable".into()),
        }
    }
}

impl Frame {
    /// The motion of a body in words, with the time of the data set from which its law holds.
    pub fn words(&self, body: &BodyFrame) -> String {
        let law = body.law.in_words();
        match (body.rhythms, body.since > self.start) {
            (0, false) => law.into(),
            (0, true) if body.since >= self.span[1] => "moves freely".into(),
            (0, true) => format!("{law} from time {:.3} on", self.clock.outer(body.since)),
            (count, _) => format!("{law} and bends by {}", counted(count as usize, "oscillation")),
        }
    }

    /// The time that bodies were seen in, and the size of their tables.
    pub fn bodies_span(&self) -> Span {
        Span { times: self.span, knots: self.knots, length: self.length }
    }
}

impl Sparsedyn {
    /// A module in which nothing moves yet, but for TRACE's future.
    pub fn new(frame: Frame, dynamics: &DynamicsConfig, seed: u64, device: &Device) -> Self {
        let options = RolloutOptions {
            ask: dynamics.ask.into(),
            integrator: dynamics.integrator.into(),
            step: frame.step,
            start: frame.start,
        };
        let (centre, length) = (frame.centre, frame.length);
        let field = DynamicsFieldConfig::new(centre, length)
            .with_bands(dynamics.bands)
            .with_width(dynamics.width)
            .with_layers(dynamics.layers)
            .with_squared(dynamics.model == MotionModel::Trace)
            .with_seed(seed);
        let coded = CodedFieldConfig::new(centre, length).with_motions(dynamics.bases).with_seed(seed);
        let is_coded = dynamics.model == MotionModel::Freegave;
        let codes = if is_coded { coded.motions } else { 0 };
        let deformation = DeformationConfig::new(centre, length).with_codes(codes).with_seed(seed ^ 3);
        Self {
            field: (!is_coded).then(|| field.init(device)),
            coded: is_coded.then(|| coded.init(device)),
            deformation: (dynamics.model != MotionModel::Rollout).then(|| deformation.init(device)),
            model: dynamics.model,
            bodies: (!frame.bodies.is_empty())
                .then(|| Bodies::at_rest(frame.bodies.clone(), frame.nodes.clone(), frame.bodies_span(), device)),
            frame,
            options,
        }
    }

    /// The moving rows as a tensor.
    pub fn row_tensor(&self, device: &Device) -> Tensor<1, Int> {
        indices(&self.frame.rows, device)
    }

    /// Follows a change of the Gaussians' rows: a copy of a moving Gaussian moves.
    pub fn followed(mut self, rows: &RowMap) -> Self {
        let labels: BTreeMap<u32, i32> =
            self.frame.rows.iter().copied().zip(self.frame.labels.iter().copied()).collect();
        let moving = rows.from.iter().enumerate().filter_map(|(new, old)| Some((new as u32, *labels.get(old)?)));
        (self.frame.rows, self.frame.labels) = moving.unzip();
        self
    }
}
