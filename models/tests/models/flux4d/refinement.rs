//! Algorithm 2 on a toy: rows of 14 numbers, a loss that has a closed form, and networks of two small layers.

use burn::tensor::Tensor;
use gs_models::flux4d::refinement::{Term, normalised};
use gs_models::flux4d::{Feedback, FluxError, Network, Objective, PolynomialMotion, Refinement, RefinementConfig};
use gs_tests::devices::{Place, reference};
use gs_tests::finite_differences::assert_derivative;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{GRADIENT_F64, assert_gradient, assert_near, values};

const ROWS: usize = 5;
const HIDDEN: usize = 6;
/// Numbers of `f` (15 inputs, 14 + 3 outputs) and of `r` (29 inputs, 14 outputs).
const OF_FIRST: usize = (15 + 17) * HIDDEN;
const OF_NEXT: usize = (29 + 14) * HIDDEN;

/// `W_2 tanh(W_1 x)`; the first 14 outputs are residuals, three more are velocities.
struct Toy {
    first: Tensor<2>,
    second: Tensor<2>,
}

impl Network for Toy {
    fn forward(&self, features: Tensor<2>, times: Tensor<2>) -> (Tensor<2>, Option<Tensor<2>>) {
        let output =
            Tensor::cat(vec![features, times], 1).matmul(self.first.clone()).tanh().matmul(self.second.clone());
        let columns = output.dims()[1];
        (output.clone().narrow(1, 0, 14), (columns > 14).then(|| output.narrow(1, 14, columns - 14)))
    }
}

/// Weights in one list, `f` first.
fn toys(weights: &[f64], make: impl Fn(&[f64], [usize; 2]) -> Tensor<2>) -> (Toy, Toy) {
    let (first, next) = weights.split_at(OF_FIRST);
    let toy = |weights: &[f64], inputs: usize, outputs: usize| {
        let (a, b) = weights.split_at(inputs * HIDDEN);
        Toy { first: make(a, [inputs, HIDDEN]), second: make(b, [HIDDEN, outputs]) }
    };
    (toy(first, 15, 17), toy(next, 29, 14))
}

/// Squared distance of the moved rows to a target, at two times; channels have units of their own.
struct Bowl {
    target: Tensor<2>,
    units: Tensor<2>,
    times: Tensor<1>,
    held_out: bool,
}

impl Bowl {
    fn new(place: &Place, held_out: bool) -> Self {
        let units: Vec<f64> = (0..14).map(|channel| 0.3 + 0.1 * f64::from(channel)).collect();
        Self {
            target: place.tensor(&Random::new(12).values(ROWS * 14, -1.0, 1.0), [ROWS, 14]),
            units: place.tensor(&units, [1, 14]),
            times: place.tensor(&[0.0, 0.25, 0.5, 0.75, 1.0], [ROWS]),
            held_out,
        }
    }

    fn at(&self, raw: Tensor<2>, velocity: Tensor<2>, t: f64) -> Tensor<1> {
        let motion = PolynomialMotion::new(0).expect("a degree");
        let shift = motion.displacement(velocity, self.times.clone(), t);
        let moved = Tensor::cat(vec![raw.clone().narrow(1, 0, 3) + shift, raw.narrow(1, 3, 11)], 1);
        ((moved - self.target.clone()) * self.units.clone()).square().mean()
    }
}

impl Objective for Bowl {
    fn fed_back(&self) -> usize {
        2
    }

    fn held_out(&self) -> usize {
        usize::from(self.held_out)
    }

    fn term(&self, term: Term, raw: Tensor<2>, velocity: Tensor<2>) -> Tensor<1> {
        match term {
            Term::FedBack(number) => self.at(raw, velocity, 0.2) * [0.25, 0.75][number],
            Term::HeldOut(_) => self.at(raw, velocity, 0.9).sqrt(),
        }
    }
}

struct Setting {
    raw: Tensor<2>,
    times: Tensor<1>,
    weights: Vec<f64>,
}

fn setting(place: &Place) -> Setting {
    let mut random = Random::new(13);
    Setting {
        raw: place.tensor(&random.values(ROWS * 14, -1.0, 1.0), [ROWS, 14]),
        times: place.tensor(&[0.0, 0.25, 0.5, 0.75, 1.0], [ROWS]),
        weights: random.values(OF_FIRST + OF_NEXT, -0.4, 0.4),
    }
}

fn config(passes: usize) -> RefinementConfig {
    RefinementConfig { passes, feedback: Feedback::Largest }
}

/// The sum over passes of the loss with everything that enters a pass held: `states[j]` and `fed[j]` enter pass j + 1.
fn detached(place: &Place, setting: &Setting, bowl: &Bowl, held: &[(Tensor<2>, Tensor<2>)], weights: &[f64]) -> f64 {
    let (f, r) = toys(weights, |values, shape| place.tensor(values, shape));
    let times: Tensor<2> = setting.times.clone().reshape([ROWS, 1]);
    let (residual, velocity) = f.forward(setting.raw.clone(), times.clone());
    let velocity = velocity.expect("velocities");
    let loss = |raw: Tensor<2>| {
        let held_out =
            if bowl.held_out { values(&bowl.term(Term::HeldOut(0), raw.clone(), velocity.clone()))[0] } else { 0.0 };
        values(&bowl.at(raw, velocity.clone(), 0.2))[0] + held_out
    };
    let mut sum = loss(setting.raw.clone() + residual);
    for (state, fed) in held {
        let (residual, _) = r.forward(Tensor::cat(vec![state.clone(), fed.clone()], 1), times.clone());
        sum += loss(state.clone() + residual);
    }
    sum
}

/// The inputs of the later passes, computed by hand.
fn entering(place: &Place, setting: &Setting, bowl: &Bowl, passes: usize) -> Vec<(Tensor<2>, Tensor<2>)> {
    let (f, r) = toys(&setting.weights, |values, shape| place.tensor(values, shape));
    let times: Tensor<2> = setting.times.clone().reshape([ROWS, 1]);
    let (residual, velocity) = f.forward(setting.raw.clone(), times.clone());
    let velocity = velocity.expect("velocities");
    let mut state = setting.raw.clone() + residual;
    let mut held = Vec::new();
    for _ in 1..passes {
        let leaf = state.clone().autodiff().require_grad();
        let loss = bowl.at(leaf.clone(), velocity.clone(), 0.2);
        let gradient = leaf.grad(&loss.backward()).expect("a gradient");
        let fed = gradient.clone() / gradient.abs().max_dim(0);
        held.push((state.clone(), fed.clone()));
        let (residual, _) = r.forward(Tensor::cat(vec![state.clone(), fed], 1), times.clone());
        state = state + residual;
    }
    held
}

#[test]
fn gradients_are_those_of_the_detached_definition() {
    let place = reference();
    let setting = setting(place);
    for (passes, held_out) in [(1, false), (2, true), (3, false), (3, true)] {
        let bowl = Bowl::new(place, held_out);
        let (f, r) = toys(&setting.weights, |values, shape| place.leaf(values, shape));
        let refinement = Refinement { first: &f, next: &r, config: config(passes) };
        let leaves = [&f.first, &f.second, &r.first, &r.second];
        let mut sums: Vec<Option<Tensor<2>>> = vec![None; 4];
        let mut calls = 0;
        let refined = refinement
            .train(setting.raw.clone(), setting.times.clone(), &bowl, &mut |surrogate| {
                // Each surrogate has a graph of its own and may be differentiated at once.
                let gradients = surrogate.backward();
                calls += 1;
                for (sum, leaf) in sums.iter_mut().zip(leaves) {
                    let gradient = leaf.grad(&gradients);
                    *sum = match (sum.take(), gradient) {
                        (Some(a), Some(b)) => Some(a + b),
                        (a, b) => a.or(b),
                    };
                }
            })
            .expect("finite losses");
        assert_eq!((calls, refined.losses.len()), (passes, passes));
        let gradient: Vec<f64> = sums
            .iter()
            .zip(leaves)
            .flat_map(|(sum, leaf)| sum.as_ref().map_or_else(|| vec![0.0; leaf.shape().num_elements()], values))
            .collect();
        let held = entering(place, &setting, &bowl, passes);
        let f = |weights: &[f64]| detached(place, &setting, &bowl, &held, weights);
        assert_near("losses", &[refined.losses.iter().sum()], &[f(&setting.weights)], 1e-12);
        let until = if passes == 1 { OF_FIRST } else { setting.weights.len() };
        let rest = setting.weights[until..].to_vec();
        assert_derivative(&format!("{passes} passes"), &setting.weights[..until], &gradient[..until], 90, |weights| {
            f(&[weights, rest.as_slice()].concat())
        });
    }
}

/// Fed-back gradients do not depend on other snippets: two snippets one after the other add up their gradients.
#[test]
fn inference_gives_the_gaussians_of_training() {
    let place = reference();
    let setting = setting(place);
    let bowl = Bowl::new(place, false);
    let (f, r) = toys(&setting.weights, |values, shape| place.leaf(values, shape));
    let training = Refinement { first: &f, next: &r, config: config(3) };
    let trained = training.train(setting.raw.clone(), setting.times.clone(), &bowl, &mut |_| ()).expect("finite");
    let (f, r) = toys(&setting.weights, |values, shape| place.tensor(values, shape));
    let plain = Refinement { first: &f, next: &r, config: config(3) };
    let inferred = plain.infer(setting.raw.clone(), setting.times.clone(), &bowl).expect("finite");
    assert!(!inferred.raw.is_autodiff() && !trained.raw.is_autodiff());
    assert_near("raw", &values(&inferred.raw), &values(&trained.raw), 0.0);
    assert_near("velocity", &values(&inferred.velocity), &values(&trained.velocity), 0.0);
    assert_eq!(inferred.losses, trained.losses[..2], "no loss is computed after the last pass");
}

#[test]
fn training_lowers_the_loss_and_later_passes_lower_it_further_than_the_first() {
    let place = reference();
    let Setting { raw, times, mut weights } = setting(place);
    let bowl = Bowl::new(place, false);
    let mut losses = Vec::new();
    for _ in 0..250 {
        let (f, r) = toys(&weights, |values, shape| place.leaf(values, shape));
        let refinement = Refinement { first: &f, next: &r, config: config(3) };
        let mut sum: Option<Tensor<1>> = None;
        let add = &mut |surrogate: Tensor<1>| sum = Some(sum.take().map_or(surrogate.clone(), |sum| sum + surrogate));
        let refined = refinement.train(raw.clone(), times.clone(), &bowl, add).expect("finite losses");
        let gradients = sum.expect("surrogates").backward();
        let of = |leaf: &Tensor<2>| values(&leaf.grad(&gradients).expect("a gradient"));
        let gradient = [of(&f.first), of(&f.second), of(&r.first), of(&r.second)].concat();
        weights.iter_mut().zip(gradient).for_each(|(weight, gradient)| *weight -= 0.2 * gradient);
        losses.push(refined.losses);
    }
    let (first, last) = (&losses[0], &losses[249]);
    assert!(last[0] < 0.7 * first[0], "pass 0: from {} to {}", first[0], last[0]);
    // Normalised gradients do not say how near the end is, so the third pass may undo a part of the second.
    assert!(last[2] < 0.5 * last[0] && last[1] < 0.5 * last[0], "passes: {last:?}");
}

#[test]
fn the_fed_back_gradient_is_in_units_of_its_channel() {
    let place = reference();
    let gradient = place.tensor(&[1e-8, 3.0, 0.0, -4e-8, 4.0, 0.0], [2, 3]);
    assert_eq!(values(&normalised(gradient.clone(), Feedback::Raw)), values(&gradient));
    let largest = normalised(gradient.clone(), Feedback::Largest);
    assert_gradient("largest", &values(&largest), &[0.25, 0.75, 0.0, -1.0, 1.0, 0.0], GRADIENT_F64);
    let root = values(&normalised(gradient, Feedback::RootMeanSquare));
    let (a, b) = (8.5_f64.sqrt(), 12.5_f64.sqrt());
    assert_gradient("root mean square", &root, &[1.0 / a, 3.0 / b, 0.0, -4.0 / a, 4.0 / b, 0.0], GRADIENT_F64);
}

/// A loss that is not a number, as of a broken photo.
struct Broken;

impl Objective for Broken {
    fn term(&self, _term: Term, raw: Tensor<2>, _velocity: Tensor<2>) -> Tensor<1> {
        raw.sum() * f64::NAN
    }
}

#[test]
fn a_loss_that_is_not_a_number_is_told() {
    let place = reference();
    let Setting { raw, times, weights } = setting(place);
    let (f, r) = toys(&weights, |values, shape| place.leaf(values, shape));
    let refinement = Refinement { first: &f, next: &r, config: config(3) };
    let mut surrogates = 0;
    let told = refinement.train(raw.clone(), times.clone(), &Broken, &mut |_| surrogates += 1);
    assert_eq!(told.unwrap_err(), FluxError::NotFinite { what: "the loss", pass: 0 });
    assert_eq!(surrogates, 0);
    let none = Refinement { first: &f, next: &r, config: config(0) };
    assert!(none.infer(raw, times, &Broken).unwrap_err().to_string().starts_with("the number of passes is 0"));
}
