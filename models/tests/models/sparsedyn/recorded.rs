//! The recomputed gradient is that of stored activations.

use burn::module::Module;
use gs_burn::NamedGradients;
use gs_models::sparsedyn::{Ask, Integrator, Rollout, RolloutOptions, State};
use gs_tests::devices::reference;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

use super::{random_field, start};

#[test]
fn the_gradient_is_that_of_stored_activations() {
    let place = reference();
    let before = start(place, 4);
    let mut random = Random::new(11);
    // Grid points, times between them, the start itself, a time twice, and none in order; the latest is 30 steps away.
    let times = [0.9, 0.25, 0.25 + 5.0 / 30.0, 0.33, 1.25, 0.9, 0.41];
    let gradients: Vec<State> = times
        .iter()
        .map(|_| State {
            positions: place.tensor(&random.values(12, -1.0, 1.0), [4, 3]),
            turns: place.tensor(&random.values(16, -1.0, 1.0), [4, 4]),
        })
        .collect();
    for ask in [Ask::Stage, Ask::Step, Ask::Start] {
        for integrator in [Integrator::Rk2, Integrator::Rk4, Integrator::Screw] {
            let what = format!("{ask:?} {integrator:?}");
            let options = RolloutOptions { ask, integrator, step: 1.0 / 30.0, start: 0.25 };
            let field = random_field(place, 8, 0.3).train();
            let rollout = Rollout { field: &field, options };

            let leaf = before.clone().leaf();
            let states = rollout.states(&leaf, &times);
            let products = states.iter().zip(&gradients).map(|(state, gradient)| {
                (state.positions.clone() * gradient.positions.clone().autodiff()).sum()
                    + (state.turns.clone() * gradient.turns.clone().autodiff()).sum()
            });
            let mut graph = products.reduce(|a, b| a + b).expect("terms").backward();
            let stored = leaf.take_gradient(&mut graph);
            let stored_field = NamedGradients::take(&field, &mut graph);

            let recorded = rollout.record(&before, &times);
            for (a, b) in recorded.states.iter().zip(&states) {
                assert_eq!(values(&a.positions), values(&b.positions.clone().inner()), "{what}");
            }
            let (again, again_field) = recorded.backward(&gradients);
            assert_near(&what, &values(&again.positions), &values(&stored.positions), 1e-11);
            assert_near(&what, &values(&again.turns), &values(&stored.turns), 1e-11);
            let mut parameters = 0;
            for (path, gradient) in stored_field.iter() {
                let other = again_field.get(path).expect("the same parameters");
                assert_near(&format!("{what} {path}"), &values(other), &values(gradient), 1e-10);
                parameters += 1;
            }
            assert_eq!(parameters, 6, "three layers with weights and biases");
        }
    }
}
