//! The gradient of a rollout by recomputation: the states at grid points are kept, the activations of a step are
//! computed again when its gradient is due. The gradient is that of the discrete steps, as with stored activations, at
//! the memory of one step.

use burn::module::Module;
use gs_burn::{NamedGradients, profile};

use super::dynamics::Dynamics;
use super::field::DynamicsField;
use super::rollout::{Place, Rollout, RolloutOptions};
use super::state::State;

/// A rollout without a graph, to be differentiated afterwards.
#[derive(Debug, Clone)]
pub struct Recorded {
    /// The state at each asked time, in their order, outside autodiff.
    pub states: Vec<State>,
    field: DynamicsField,
    options: RolloutOptions,
    places: Vec<Place>,
    /// The states at grid points 0 to the last one needed.
    grid: Vec<State>,
}

impl Rollout<'_> {
    /// The states at `times`, none of them before the start, outside autodiff, with what [`Recorded::backward`] needs.
    ///
    /// # Panics
    /// When a time is before the start, not finite, or more than 30 000 steps after it.
    pub fn record(&self, start: &State, times: &[f64]) -> Recorded {
        let _stage = profile::stage("rollout");
        let field = self.field.valid();
        let plain = Rollout { field: &field, options: self.options };
        let places: Vec<Place> = times.iter().map(|time| self.options.place(*time)).collect();
        assert!(places.iter().all(|place| place.steps >= 0 && place.rest >= 0.0), "{times:?} reach before the start");
        let start = start.clone().inner();
        let held = plain.held(&start.positions);
        let last = places.iter().map(|place| place.steps).max().unwrap_or(0);
        let mut grid = vec![start];
        for steps in 0..last {
            let next = plain.step(&grid[steps as usize], steps, self.options.step, held.as_ref());
            grid.push(next);
        }
        let states =
            places.iter().map(|place| plain.step(&grid[place.steps as usize], place.steps, place.rest, held.as_ref()));
        let states = states.collect();
        Recorded { states, options: self.options, places, grid, field }
    }
}

impl Recorded {
    /// The gradients of a loss with respect to the state at the start and to the field's parameters (by their paths in
    /// the field), given its gradients with respect to [`states`](Self::states), in their order, all outside autodiff.
    ///
    /// # Panics
    /// When there is not one gradient for each state.
    pub fn backward(&self, gradients: &[State]) -> (State, NamedGradients) {
        let _stage = profile::stage("gradient of the rollout");
        assert_eq!(gradients.len(), self.states.len(), "a gradient for each state");
        let plain = Rollout { field: &self.field, options: self.options };
        let held = plain.held(&self.grid[0].positions);
        let mut of_held = held.as_ref().map(Dynamics::zeros_like);
        let mut of_field = NamedGradients::default();
        let mut later = self.grid[0].zeros_like();
        for (steps, state) in self.grid.iter().enumerate().rev() {
            let field = self.field.clone().train();
            let rollout = Rollout { field: &field, options: self.options };
            let leaf = state.clone().leaf();
            let held = held.clone().map(Dynamics::leaf);
            let step = |h: f64| rollout.step(&leaf, steps as i64, h, held.as_ref());
            let mut products = Vec::new();
            if steps + 1 < self.grid.len() {
                products.push(step(self.options.step).product(&later));
            }
            for (place, gradient) in self.places.iter().zip(gradients) {
                if place.steps as usize == steps {
                    products.push(step(place.rest).product(gradient));
                }
            }
            let Some(product) = products.into_iter().reduce(|a, b| a + b) else { continue };
            let mut graph = product.backward();
            later = leaf.take_gradient(&mut graph);
            match (of_held.take(), &held) {
                (Some(sum), Some(held)) => of_held = Some(sum.plus(held.take_gradient(&mut graph))),
                _ => of_field.add(NamedGradients::take(&field, &mut graph)),
            }
        }
        if let Some(of_held) = of_held {
            let field = self.field.clone().train();
            let leaf = self.grid[0].clone().leaf();
            let mut graph = field.forward(leaf.positions.clone(), self.options.start).product(&of_held).backward();
            later = later.plus(leaf.take_gradient(&mut graph));
            of_field.add(NamedGradients::take(&field, &mut graph));
        }
        (later, of_field)
    }
}
