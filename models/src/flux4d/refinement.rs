//! Iterative refinement, Algorithm 2: pass 0 corrects the lifted Gaussians, later passes read the gradient of the loss
//! as well.
//!
//! `G_0 = G_init + f(G_init, T)`, `G_j = G_(j-1) + r(G_(j-1), T, dL/dG_(j-1))`; the velocity is `f`'s. Departures from
//! the text:
//!
//! - The closing sum of A.2 starts at j = 1 and would drop `f`; Algorithm 2 adds all residuals, and so does this.
//! - State and gradient are detached when they enter a pass, so each pass has a graph of its own.
//! - The gradient that is fed back may be of other views than the supervision ([`Objective`]): at inference only the
//!   input views exist, and a network that reads the gradient of its own targets learns to copy them.
//!
//! The inner gradient is taken on leaves that hold the values of `G_j` and `V`. The outer one follows from the
//! surrogate `<G_j, dL_j/dG_j> + <V, dL_j/dV>`, whose gradient by the networks' parameters is that of `L_j`. Surrogates
//! of later passes are handed out as they come and may be differentiated at once; that of pass 0 is handed out last,
//! when the gradients of all losses by the velocity are known. At most two passes' graphs are then alive.

use burn::tensor::{Tensor, assert_shape};
use gs_burn::ops::sum::sum;
use gs_burn::profile;
use serde::{Deserialize, Serialize};

use super::channels::CHANNELS;
use super::error::{FluxError, check_range};

/// Passes in the paper.
pub const PASSES: usize = 3;
/// More passes than the paper ever tried are a mistake in a configuration.
const PASSES_MAX: usize = 100;
/// Below this a channel's gradient is zero but for rounding, and dividing by it would feed back noise.
const GRADIENT_FLOOR: f64 = 1e-20;

/// Residuals from Gaussians.
pub trait Network {
    /// Residuals `[N, 14]`, and velocities `[N, 3 (l + 1)]` (metres per window) from a network that predicts them, of
    /// `features` `[N, 14]`, or `[N, 28]` with the gradient, and `times` `[N, 1]`.
    fn forward(&self, features: Tensor<2>, times: Tensor<2>) -> (Tensor<2>, Option<Tensor<2>>);
}

/// A term of the loss of a snippet, by its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Term {
    /// A term of the input views: the gradient of all these by the channels is fed back.
    FedBack(usize),
    /// A term of held-out views, part of the training alone.
    HeldOut(usize),
}

/// The losses of a snippet as sums of terms. Each term has a backward of its own, so that memory does not grow with the
/// number of views.
pub trait Objective {
    /// Terms that are fed back, at least one.
    fn fed_back(&self) -> usize {
        1
    }

    /// Terms of the held-out views; none is Algorithm 2.
    fn held_out(&self) -> usize {
        0
    }

    /// The velocities `[N, 3 (l + 1)]` that count at inference, of those that the base network predicts.
    fn settled(&self, predicted: Tensor<2>) -> Tensor<2> {
        predicted
    }

    /// A term `[1]` of raw channels `[N, 14]` and velocities `[N, 3 (l + 1)]`.
    fn term(&self, term: Term, raw: Tensor<2>, velocity: Tensor<2>) -> Tensor<1>;
}

/// The form in which the gradient enters the next pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Feedback {
    /// As it is. Channels differ by orders of magnitude.
    Raw,
    /// Each channel divided by its largest magnitude (G3R).
    #[default]
    Largest,
    /// Each channel divided by its root mean square.
    RootMeanSquare,
}

/// Settings of the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RefinementConfig {
    /// Passes N, `f` included; 1 is Flux4D-base.
    pub passes: usize,
    /// The form in which the gradient enters.
    pub feedback: Feedback,
}

impl Default for RefinementConfig {
    fn default() -> Self {
        Self { passes: PASSES, feedback: Feedback::default() }
    }
}

/// Result of a refinement, outside autodiff.
#[derive(Debug, Clone)]
pub struct Refined {
    /// `[N, 14]`.
    pub raw: Tensor<2>,
    /// `[N, 3 (l + 1)]`, metres per window.
    pub velocity: Tensor<2>,
    /// The loss that was computed after each pass: in training all of it, at inference that of the input views, without
    /// the last pass.
    pub losses: Vec<f64>,
}

/// `f`, `r` and the settings.
#[derive(Debug, Clone, Copy)]
pub struct Refinement<'a, F, R> {
    /// The base network `f`.
    pub first: &'a F,
    /// The refinement network `r`, one for all later passes.
    pub next: &'a R,
    /// The settings.
    pub config: RefinementConfig,
}

impl<F: Network, R: Network> Refinement<'_, F, R> {
    /// The Gaussians of a snippet without any gradient of the networks: `raw` `[N, 14]`, `times` `[N]`.
    ///
    /// # Errors
    /// When the settings are out of range or a loss or gradient is not finite.
    pub fn infer(&self, raw: Tensor<2>, times: Tensor<1>, objective: &impl Objective) -> Result<Refined, FluxError> {
        self.run(raw, times, objective, None)
    }

    /// The same for training: `surrogate` receives one scalar `[1]` for each pass, later passes first, whose gradient
    /// by the networks' parameters is that of the pass's loss; their sum is that of all losses. The networks live on an
    /// autodiff device.
    ///
    /// # Errors
    /// When the settings are out of range or a loss or gradient is not finite; pass 0's surrogate is not handed out
    /// then, and no gradient of the snippet should be used.
    pub fn train(
        &self,
        raw: Tensor<2>,
        times: Tensor<1>,
        objective: &impl Objective,
        surrogate: &mut dyn FnMut(Tensor<1>),
    ) -> Result<Refined, FluxError> {
        self.run(raw, times, objective, Some(surrogate))
    }

    fn run(
        &self,
        raw: Tensor<2>,
        times: Tensor<1>,
        objective: &impl Objective,
        mut surrogate: Option<&mut dyn FnMut(Tensor<1>)>,
    ) -> Result<Refined, FluxError> {
        let RefinementConfig { passes, feedback } = self.config;
        check_range("the number of passes", passes as f64, [1.0, PASSES_MAX as f64], "1 to 100")?;
        let rows = raw.dims()[0];
        assert_shape!(raw, [rows, CHANNELS]);
        let (init, times) = (raw.inner(), times.inner().reshape([rows, 1]));
        let (residual, velocity) = self.first.forward(init.clone(), times.clone());
        let tracked_velocity = velocity.expect("the base network predicts velocities");
        let predicted = tracked_velocity.clone().inner();
        let velocity = if surrogate.is_some() { predicted } else { objective.settled(predicted) };
        let tracked_first = init.clone() + residual;
        let mut state = tracked_first.clone().inner();
        let (mut losses, mut first_gradient) = (Vec::new(), None);
        let mut velocity_gradient = velocity.zeros_like();
        let mut tracked: Option<Tensor<2>> = None;
        for pass in 0..passes {
            let is_last = pass + 1 == passes;
            if is_last && surrogate.is_none() {
                break;
            }
            let inner = inner_gradient(&state, &velocity, objective, surrogate.is_some(), pass)?;
            losses.push(inner.loss);
            velocity_gradient = velocity_gradient + inner.velocity;
            match (tracked.take(), surrogate.as_mut()) {
                (None, _) => first_gradient = Some(inner.raw),
                (Some(tracked), Some(surrogate)) => surrogate(sum(tracked * inner.raw)),
                (Some(_), None) => {}
            }
            if !is_last {
                let fed = normalised(inner.fed, feedback);
                let (residual, _) = self.next.forward(Tensor::cat(vec![state.clone(), fed], 1), times.clone());
                let next = state + residual;
                state = next.clone().inner();
                tracked = Some(next);
            }
        }
        if let (Some(surrogate), Some(gradient)) = (surrogate, first_gradient) {
            surrogate(sum(tracked_first * gradient) + sum(tracked_velocity * velocity_gradient));
        }
        Ok(Refined { raw: state, velocity, losses })
    }
}

/// Gradients of one pass, outside autodiff.
struct Inner {
    loss: f64,
    /// Gradient of the whole loss by the channels.
    raw: Tensor<2>,
    /// Gradient of the whole loss by the velocity.
    velocity: Tensor<2>,
    /// Gradient of the input views' loss by the channels.
    fed: Tensor<2>,
}

fn inner_gradient(
    state: &Tensor<2>,
    velocity: &Tensor<2>,
    objective: &impl Objective,
    is_training: bool,
    pass: usize,
) -> Result<Inner, FluxError> {
    let _stage = profile::stage("inner gradient");
    let of_term = |term: Term| {
        let leaf = |tensor: &Tensor<2>| tensor.clone().autodiff().require_grad();
        let (raw, speed) = (leaf(state), leaf(velocity));
        let loss = objective.term(term, raw.clone(), speed.clone());
        let value = scalar(loss.clone().inner());
        if !value.is_finite() {
            return Err(FluxError::NotFinite { what: "the loss", pass });
        }
        let gradients = loss.backward();
        let taken = |leaf: Tensor<2>| leaf.grad(&gradients).unwrap_or_else(|| leaf.inner().zeros_like());
        Ok((value, taken(raw), taken(speed)))
    };
    let mut all = of_term(Term::FedBack(0))?;
    for number in 1..objective.fed_back() {
        all = added(all, of_term(Term::FedBack(number))?);
    }
    let fed = all.1.clone();
    let held_out = if is_training { objective.held_out() } else { 0 };
    for number in 0..held_out {
        all = added(all, of_term(Term::HeldOut(number))?);
    }
    let (loss, raw, velocity) = all;
    if !scalar(sum(raw.clone().abs()) + sum(velocity.clone().abs()) + sum(fed.clone().abs())).is_finite() {
        return Err(FluxError::NotFinite { what: "the gradient", pass });
    }
    Ok(Inner { loss, raw, velocity, fed })
}

/// Loss and gradients of one term and of another.
fn added(a: (f64, Tensor<2>, Tensor<2>), b: (f64, Tensor<2>, Tensor<2>)) -> (f64, Tensor<2>, Tensor<2>) {
    (a.0 + b.0, a.1 + b.1, a.2 + b.2)
}

/// The gradient `[N, 14]` as it enters the network.
pub fn normalised(gradient: Tensor<2>, feedback: Feedback) -> Tensor<2> {
    if feedback == Feedback::Raw {
        return gradient;
    }
    let largest = gradient.clone().abs().max_dim(0).clamp_min(GRADIENT_FLOOR);
    let unit = gradient / largest;
    if feedback == Feedback::Largest {
        return unit;
    }
    // After the first division no square underflows.
    let root = unit.clone().square().mean_dim(0).sqrt();
    let empty = root.clone().equal_elem(0.0);
    unit / root.mask_fill(empty, 1.0)
}

fn scalar(tensor: Tensor<1>) -> f64 {
    tensor.to_data().iter::<f64>().next().expect("a tensor of one number")
}
