//! The rollout (Eq. 9): a state integrated from the first frame to several times in one sweep.
//!
//! Steps lie on a grid of one length from the start. A time between two grid points is reached by one shorter step from
//! the point before it, so the state at a time depends on that time alone and not on the other times asked for.

use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};

use super::dynamics::{Dynamics, Twist};
use super::field::{Asked, DynamicsField, centre_row, offsets};
use super::integrators::Integrator;
use super::state::State;

/// When a rollout asks the field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ask {
    /// At every stage of every step (the paper's Eq. 4 with the usual meaning of Runge-Kutta). Accelerations bend the
    /// way to the first inner stage.
    Stage,
    /// Once a step; accelerations are held over the step.
    Step,
    /// Once, at the start; every Gaussian keeps its accelerations for good (as the code of TRACE does). Motion of
    /// bodies under constant accelerations is then exact, and the network costs nothing over the horizon.
    Start,
}

/// How a rollout integrates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RolloutOptions {
    /// When the field is asked.
    pub ask: Ask,
    /// The method of a step.
    pub integrator: Integrator,
    /// Length of a step, above 0, in the data set's unit of time. The paper: two frames.
    pub step: f64,
    /// The time of the state that rollouts begin with.
    pub start: f64,
}

/// Times closer to a grid point than this share of a step are taken for it: rounding of `start + k step`.
const ON_GRID: f64 = 1e-6;

/// Most steps of a rollout: 1000 times the longest of the paper.
pub const STEPS_MAX: f64 = 30_000.0;

/// A time by the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// Whole steps from the start, negative before it.
    pub steps: i64,
    /// The rest, of the sign of `steps`, in the unit of time; 0 on a grid point.
    pub rest: f64,
}

impl RolloutOptions {
    /// The earliest and the latest time of a rollout. It is one step less than the most, so that a velocity, which is a
    /// difference about its time, exists at both ends.
    pub fn reach(&self) -> [f64; 2] {
        let most = (STEPS_MAX - 1.0) * self.step;
        [self.start - most, self.start + most]
    }

    /// Where a time lies.
    ///
    /// # Panics
    /// When the time is not finite or more than 30 000 steps away: whoever takes times from outside compares them with
    /// [`reach`](Self::reach).
    pub(super) fn place(&self, time: f64) -> Place {
        let steps = (time - self.start) / self.step;
        assert!(steps.abs() <= STEPS_MAX, "a rollout of {steps} steps of {} to the time {time}", self.step);
        let nearest = steps.round();
        if (steps - nearest).abs() < ON_GRID {
            return Place { steps: nearest as i64, rest: 0.0 };
        }
        Place { steps: steps.trunc() as i64, rest: (steps - steps.trunc()) * self.step }
    }

    /// The time of grid point `steps`.
    pub(super) fn time(&self, steps: i64) -> f64 {
        self.start + steps as f64 * self.step
    }
}

/// A field with the way it is integrated.
#[derive(Debug, Clone)]
pub struct Rollout<'a, F = DynamicsField> {
    /// The dynamics field.
    pub field: &'a F,
    /// How it is integrated.
    pub options: RolloutOptions,
}

impl<F: Asked> Rollout<'_, F> {
    /// The states at `times`, in their order, of Gaussians that are at `start` at the time `options.start`;
    /// differentiable, with every activation stored. For training over long horizons with a field that is asked at
    /// every step see [`record`](Self::record).
    ///
    /// # Panics
    /// When a time is not finite or more than 30 000 steps away.
    pub fn states(&self, start: &State, times: &[f64]) -> Vec<State> {
        let places: Vec<Place> = times.iter().map(|time| self.options.place(*time)).collect();
        let held = self.held(&start.positions);
        let mut states: Vec<Option<State>> = vec![None; times.len()];
        for sign in [1_i64, -1] {
            let mut state = start.clone();
            let last = places.iter().map(|place| place.steps * sign).max().unwrap_or(0).max(0);
            for k in 0..=last {
                let steps = sign * k;
                for (place, found) in places.iter().zip(&mut states) {
                    if place.steps == steps && found.is_none() && (place.rest * sign as f64) >= 0.0 {
                        *found = Some(self.step(&state, steps, place.rest, held.as_ref()));
                    }
                }
                if k < last {
                    state = self.step(&state, steps, sign as f64 * self.options.step, held.as_ref());
                }
            }
        }
        states.into_iter().map(|state| state.expect("every place lies on one of the two sweeps")).collect()
    }

    /// The velocity of each Gaussian of `start` at `time`, `[M, 3]`, scene units per unit of time.
    pub fn velocities(&self, start: &State, time: f64) -> Tensor<2> {
        let state = &self.states(start, &[time])[0];
        let twist = match self.held(&start.positions) {
            Some(held) => held.twist(time - self.options.start),
            None => self.field.ask(state.positions.clone(), time).twist(0.0),
        };
        twist.at(&offsets(self.field, &state.positions))
    }

    /// The angular velocity of each Gaussian of `start` at `time`, `[M, 3]`, radians per unit of time, world axes.
    pub fn angular_velocities(&self, start: &State, time: f64) -> Tensor<2> {
        match self.held(&start.positions) {
            Some(held) => held.twist(time - self.options.start).angular,
            None => {
                let state = &self.states(start, &[time])[0];
                self.field.ask(state.positions.clone(), time).angular
            }
        }
    }

    /// The quantities that are asked once, at the start; `None` if they are asked again.
    pub(super) fn held(&self, positions: &Tensor<2>) -> Option<Dynamics> {
        (self.options.ask == Ask::Start).then(|| self.field.ask(positions.clone(), self.options.start))
    }

    /// The state `h` after grid point `steps`.
    pub(super) fn step(&self, state: &State, steps: i64, h: f64, held: Option<&Dynamics>) -> State {
        if h == 0.0 {
            return state.clone();
        }
        let RolloutOptions { ask, integrator, .. } = self.options;
        let time = self.options.time(steps);
        let centre = centre_row(self.field, &state.positions);
        if let Some(held) = held {
            let since = time - self.options.start;
            return integrator.step(state, h, &centre, None, |_, later| held.twist(since + later));
        }
        let first = self.field.ask(state.positions.clone(), time);
        if ask == Ask::Step {
            return integrator.step(state, h, &centre, None, |_, later| first.twist(later));
        }
        let bend = first.acceleration_at(&offsets(self.field, &state.positions));
        integrator.step(state, h, &centre, Some(bend), |positions, later| -> Twist {
            if later == 0.0 { first.twist(0.0) } else { self.field.ask(positions.clone(), time + later).twist(0.0) }
        })
    }
}
