//! The moving Gaussians at given times: by the rollout, or by the baselines' deformation with one step of their
//! velocity field.

use burn::tensor::Tensor;
use gs_models::rotation::turn;
use gs_models::sparsedyn::{Asked, Rollout, RolloutOptions, State};

use super::Sparsedyn;
use super::config::MotionModel;
use gs_train::fit::parameters::indices;

/// The moving Gaussians at a time.
#[derive(Debug, Clone)]
pub struct Moved {
    /// Positions and rotations since the first frame.
    pub state: State,
    /// `[M, 3]`, added to the logarithms of the sizes; `None`: they keep their sizes.
    pub growth: Option<Tensor<2>>,
}

/// Half the time between the two positions of a difference, in steps of integration.
const DIFFERENCE: f64 = 0.05;

/// The direction of the baselines' step of integration in training.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From one step before the photo.
    Forwards,
    /// From one step after it.
    Backwards,
}

/// The moving Gaussians by what moves them, as indices among them.
struct Parts {
    of_bodies: Vec<u32>,
    of_field: Vec<u32>,
    /// The body of each of `of_bodies`.
    labels: Vec<u32>,
    /// The position of each moving Gaussian in `of_bodies` followed by `of_field`.
    order: Vec<u32>,
}

impl Sparsedyn {
    /// The Gaussians that are at `positions` `[M, 3]` in the first frame, at `times`; differentiable. Those of bodies
    /// follow the bodies' laws, the others the field.
    pub fn moved(&self, positions: &Tensor<2>, times: &[f64]) -> Vec<Moved> {
        let Some(bodies) = &self.bodies else { return self.moved_by_field(positions, times) };
        let parts = self.parts();
        let device = positions.device();
        let pick = |list: &[u32]| positions.clone().select(0, indices(list, &device));
        let own = pick(&parts.of_bodies);
        let followers = bodies.of(&own, &parts.labels);
        let by_field = match parts.of_field.is_empty() {
            true => None,
            false => Some(self.moved_by_field(&pick(&parts.of_field), times)),
        };
        let order = indices(&parts.order, &device);
        let mut others = by_field.into_iter().flatten();
        let mut one = |time: &f64| {
            let state = followers.state(*time);
            let Some(other) = others.next() else { return Moved { state, growth: None } };
            let joined = |a: Tensor<2>, b: Tensor<2>| Tensor::cat(vec![a, b], 0).select(0, order.clone());
            let growth = other.growth.map(|growth| joined(own.zeros_like(), growth));
            let positions = joined(state.positions, other.state.positions);
            Moved { state: State { positions, turns: joined(state.turns, other.state.turns) }, growth }
        };
        times.iter().map(&mut one).collect()
    }

    /// The moving Gaussians by what moves them.
    fn parts(&self) -> Parts {
        let of = |wanted: bool| -> Vec<u32> {
            let labels = self.frame.labels.iter().enumerate();
            labels.filter(|(_, label)| (**label >= 0) == wanted).map(|(index, _)| index as u32).collect()
        };
        let (of_bodies, of_field) = (of(true), of(false));
        let mut order = vec![0; self.frame.labels.len()];
        for (position, index) in of_bodies.iter().chain(&of_field).enumerate() {
            order[*index as usize] = position as u32;
        }
        let labels = of_bodies.iter().map(|index| self.frame.labels[*index as usize] as u32).collect();
        Parts { of_bodies, of_field, labels, order }
    }

    fn moved_by_field(&self, positions: &Tensor<2>, times: &[f64]) -> Vec<Moved> {
        match self.model {
            MotionModel::Rollout | MotionModel::Hybrid => {
                let states = self.rolled(&State::at_rest(positions.clone()), self.options, times);
                let corrected = |(state, time): (State, &f64)| self.corrected(positions, state, *time);
                states.into_iter().zip(times).map(corrected).collect()
            }
            MotionModel::Trace | MotionModel::Freegave => {
                times.iter().map(|time| self.seen_or_future(positions, *time)).collect()
            }
        }
    }

    /// The baselines in training: deformed one integration step away from `time`, then integrated to it. The step
    /// begins at a position that gets no gradient through the field; near the first frame there is only the
    /// deformation.
    pub fn moved_by_one_step(&self, positions: &Tensor<2>, time: f64, direction: Direction) -> Moved {
        let step = self.options.step;
        if time < self.frame.start + step {
            return self.deformed(positions, time);
        }
        let away = match direction {
            Direction::Forwards => time - step,
            Direction::Backwards => time + step,
        };
        let from = away.clamp(self.frame.start, self.frame.span[1]);
        let deformed = self.deformed(positions, from);
        let begin = deformed.state.positions.clone().detach();
        let options = RolloutOptions { start: from, ..self.options };
        let end = self.rolled_from(positions, &State::at_rest(begin.clone()), options, &[time]).remove(0);
        let state = State {
            positions: deformed.state.positions + end.positions - begin,
            turns: gs_models::rotation::product(end.turns, deformed.state.turns),
        };
        Moved { state, growth: deformed.growth }
    }

    /// The baselines outside training: the deformation while frames are seen, integrated from its last one on.
    fn seen_or_future(&self, positions: &Tensor<2>, time: f64) -> Moved {
        let last = self.frame.span[1];
        let deformed = self.deformed(positions, time.min(last));
        if time <= last {
            return deformed;
        }
        let options = RolloutOptions { start: last, ..self.options };
        let state = self.rolled_from(positions, &deformed.state, options, &[time]).remove(0);
        Moved { state, growth: deformed.growth }
    }

    fn deformed(&self, positions: &Tensor<2>, time: f64) -> Moved {
        self.corrected(positions, State::at_rest(positions.clone()), time)
    }

    /// `state` with the deformation at `time`, or at the last frame that was seen.
    fn corrected(&self, positions: &Tensor<2>, state: State, time: f64) -> Moved {
        let Some(deformation) = &self.deformation else { return Moved { state, growth: None } };
        let codes = self.coded.as_ref().map(|coded| coded.codes(positions));
        let by = deformation.forward(positions, codes, time.min(self.frame.span[1]));
        let turns = state.turns.clone() + turn(state.turns, by.rotation);
        Moved { state: State { positions: state.positions + by.shift, turns }, growth: Some(by.growth) }
    }

    /// The states at `times` of Gaussians that begin in `start`.
    pub fn rolled(&self, start: &State, options: RolloutOptions, times: &[f64]) -> Vec<State> {
        self.rolled_from(&start.positions.clone(), start, options, times)
    }

    /// The same for Gaussians that were at `first` `[M, 3]` in the first frame, to which codes belong.
    fn rolled_from(&self, first: &Tensor<2>, start: &State, options: RolloutOptions, times: &[f64]) -> Vec<State> {
        match (&self.field, &self.coded) {
            (_, Some(coded)) => Rollout { field: &coded.of(first), options }.states(start, times),
            (Some(field), None) => Rollout { field, options }.states(start, times),
            (None, None) => times.iter().map(|_| start.clone()).collect(),
        }
    }

    /// Velocities of the Gaussians that are at `first` `[M, 3]` in the first frame, at `time`, `[M, 3]`, scene units
    /// per unit of time.
    pub fn velocities(&self, first: &Tensor<2>, time: f64) -> Tensor<2> {
        if self.bodies.is_some() {
            // Laws are smooth functions of time: central differences over a share of a frame are exact to f32.
            let half = DIFFERENCE * self.options.step;
            let moved = self.moved(first, &[time - half, time + half]);
            return (moved[1].state.positions.clone() - moved[0].state.positions.clone()) / (2.0 * half);
        }
        let (start, options) = match self.model {
            MotionModel::Rollout | MotionModel::Hybrid => (State::at_rest(first.clone()), self.options),
            MotionModel::Trace | MotionModel::Freegave => {
                let from = time.min(self.frame.span[1]);
                (self.deformed(first, from).state, RolloutOptions { start: from, ..self.options })
            }
        };
        fn of(field: &impl Asked, options: RolloutOptions, start: &State, time: f64) -> Tensor<2> {
            Rollout { field, options }.velocities(start, time)
        }
        match (&self.field, &self.coded) {
            (_, Some(coded)) => of(&coded.of(first), options, &start, time),
            (Some(field), None) => of(field, options, &start, time),
            (None, None) => first.zeros_like(),
        }
    }
}
