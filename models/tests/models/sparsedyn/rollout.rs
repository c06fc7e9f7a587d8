//! Rollouts: times, the first state, gradients of a few steps.

use gs_models::sparsedyn::{Ask, DynamicsField, DynamicsFieldConfig, Integrator, Rollout, RolloutOptions, State};
use gs_tests::devices::{everywhere, reference};
use gs_tests::finite_differences::assert_derivatives;
use gs_tests::tolerance::{assert_near, values};

use super::{CENTRE, constant_field, random_field, start};

const ASKS: [Ask; 3] = [Ask::Stage, Ask::Step, Ask::Start];

fn options(ask: Ask, integrator: Integrator) -> RolloutOptions {
    RolloutOptions { ask, integrator, step: 1.0 / 30.0, start: 0.25 }
}

#[test]
fn an_untrained_field_moves_nothing() {
    for place in everywhere() {
        let field = DynamicsFieldConfig::new(CENTRE, 2.0).with_width(8).init(&place.device);
        let field = gs_burn::map_parameters(field, |_, table| table.cast(place.dtype));
        let before = start(place, 4);
        for ask in ASKS {
            let rollout = Rollout { field: &field, options: options(ask, Integrator::Rk2) };
            for state in rollout.states(&before, &[0.25, 0.9, -0.3]) {
                assert_eq!(values(&state.positions), values(&before.positions), "{} {ask:?}", place.name);
                assert_eq!(values(&state.turns), values(&before.turns), "{} {ask:?}", place.name);
            }
        }
    }
}

/// TRACE's code: accelerations are `r |r| / 10`.
#[test]
fn squared_accelerations_are_those_of_trace() {
    let place = reference();
    let plain = constant_field(place, [[1.0, 2.0, 3.0], [3.0, -4.0, 0.0], [-0.5, 0.1, 0.2], [-2.0, 1.0, 6.0]]);
    let squared = DynamicsField { squared: true, ..plain.clone() };
    let positions = start(place, 3).positions;
    let (plain, squared) = (plain.forward(positions.clone(), 0.4), squared.forward(positions, 0.4));
    assert_eq!(values(&squared.velocity), values(&plain.velocity));
    assert_eq!(values(&squared.angular), values(&plain.angular));
    // Raw lengths are in units of 2.
    let of = |raw: f64| raw * raw.abs() / 10.0;
    for (found, raw, unit) in [
        (&squared.acceleration, &plain.acceleration, 2.0),
        (&squared.angular_acceleration, &plain.angular_acceleration, 1.0),
    ] {
        let expected: Vec<f64> = values(raw).into_iter().map(|x| unit * of(x / unit)).collect();
        assert_near("accelerations", &values(found), &expected, 1e-12);
    }
    let begins = DynamicsFieldConfig::new(CENTRE, 2.0).with_width(8).with_squared(true).init(&place.device);
    let begins = gs_burn::map_parameters(begins, |_, table| table.cast(place.dtype));
    let raw = values(&begins.forward(start(place, 3).positions, 0.4).acceleration);
    assert!(raw.iter().all(|x| *x != 0.0), "a gradient moves them: {raw:?}");
}

#[test]
fn a_time_has_one_state_whatever_else_is_asked() {
    let place = reference();
    let field = random_field(place, 8, 0.3);
    let before = start(place, 4);
    for ask in ASKS {
        let rollout = Rollout { field: &field, options: options(ask, Integrator::Rk2) };
        let times = [0.7, 0.25, 0.41, 0.1, 0.7, 1.3, 0.25 + 3.0 / 30.0];
        let together = rollout.states(&before, &times);
        for (time, state) in times.iter().zip(&together) {
            let alone = rollout.states(&before, &[*time]).remove(0);
            assert_eq!(values(&alone.positions), values(&state.positions), "{ask:?} at {time}");
            assert_eq!(values(&alone.turns), values(&state.turns), "{ask:?} at {time}");
        }
        assert_eq!(values(&together[1].positions), values(&before.positions), "the start is the start");
    }
}

#[test]
fn velocities_are_derivatives_of_positions() {
    let place = reference();
    let field = random_field(place, 8, 0.3);
    let before = start(place, 4);
    for ask in ASKS {
        let options = RolloutOptions { step: 1.0 / 240.0, ..options(ask, Integrator::Rk4) };
        let rollout = Rollout { field: &field, options };
        let h = 1e-4;
        let states = rollout.states(&before, &[0.6 - h, 0.6 + h]);
        let difference = (states[1].positions.clone() - states[0].positions.clone()) / (2.0 * h);
        // Asked once a step, the field's own change over the step is left out: a share of one step, 1/240.
        let bound = if ask == Ask::Step { 1e-2 } else { 1e-6 };
        assert_near(&format!("{ask:?}"), &values(&rollout.velocities(&before, 0.6)), &values(&difference), bound);
    }
}

#[test]
fn the_gradient_of_five_steps_is_right() {
    let place = reference();
    let field = random_field(place, 6, 0.3);
    let at = values(&start(place, 3).positions);
    let pull = place.tensor(&gs_tests::scenes::Random::new(9).values(9, -1.0, 1.0), [3, 3]);
    for ask in ASKS {
        for integrator in [Integrator::Rk2, Integrator::Rk4, Integrator::Screw] {
            let rollout = Rollout { field: &field, options: options(ask, integrator) };
            let time = 0.25 + 4.4 / 30.0;
            assert_derivatives(&format!("{ask:?} {integrator:?}"), place, [("positions", &at)], 9, |[at]| {
                let state = rollout.states(&State::at_rest(at.reshape([3, 3])), &[time]).remove(0);
                (state.positions * pull.clone().autodiff()).sum()
            });
        }
    }
}
