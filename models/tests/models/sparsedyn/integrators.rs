//! Steps against exact solutions: measured orders, drift, and the way back.

use gs_models::sparsedyn::{Ask, Dynamics, Integrator, Rollout, RolloutOptions, State};
use gs_tests::devices::{Place, reference};
use gs_tests::tolerance::{assert_near, values};

use super::{CENTRE, constant_field, start};

const ALL: [Integrator; 3] = [Integrator::Rk2, Integrator::Rk4, Integrator::Screw];

fn options(integrator: Integrator, step: f64) -> RolloutOptions {
    RolloutOptions { ask: Ask::Start, integrator, step, start: 0.0 }
}

fn end(place: &Place, quantities: [[f64; 3]; 4], integrator: Integrator, step: f64, time: f64) -> State {
    let field = constant_field(place, quantities);
    let rollout = Rollout { field: &field, options: options(integrator, step) };
    rollout.states(&start(place, 5), &[time]).remove(0)
}

fn distance(a: &State, b: &State) -> f64 {
    let largest = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    largest(values(&a.positions), values(&b.positions)).max(largest(values(&a.turns), values(&b.turns)))
}

/// A rotation of 6.28 rad about an axis that misses the reference point: constant `v` and `omega`.
const ROTATION: [[f64; 3]; 4] = [[0.7, -0.4, 0.2], [0.0; 3], [0.0, 0.0, std::f64::consts::TAU], [0.0; 3]];

#[test]
fn a_full_turn_returns_exactly_by_screw_and_grows_by_the_known_factor_in_rk2() {
    let place = reference();
    let before = start(place, 5);
    let [vx, vy, vz] = ROTATION[0];
    let screw = end(place, ROTATION, Integrator::Screw, 1.0 / 30.0, 1.0);
    // One turn about z: only the translation along the axis is left.
    let expected: Vec<f64> = values(&before.positions).chunks(3).flat_map(|x| [x[0], x[1], x[2] + vz]).collect();
    assert_near("screw", &values(&screw.positions), &expected, 1e-12);

    // The pivot: v + omega x (p - c) = 0.
    let w = std::f64::consts::TAU;
    let pivot = [CENTRE[0] - vy / w, CENTRE[1] + vx / w];
    let radius = |x: &[f64]| (x[0] - pivot[0]).hypot(x[1] - pivot[1]);
    let h = 1.0 / 30.0;
    let rk2 = end(place, ROTATION, Integrator::Rk2, h, 1.0);
    let factor = (1.0 + (w * h).powi(4) / 4.0).powf(15.0);
    for (after, before) in values(&rk2.positions).chunks(3).zip(values(&before.positions).chunks(3)) {
        let growth = radius(after) / radius(before);
        assert!((growth / factor - 1.0).abs() < 1e-10, "radius grew by {growth}, known factor {factor}");
    }
}

#[test]
fn a_falling_body_is_exact_in_every_method() {
    let place = reference();
    let fall = [[0.4, 0.1, 2.0], [0.0, 0.0, -9.81], [0.0; 3], [0.0; 3]];
    let before = values(&start(place, 5).positions);
    let t: f64 = 0.83;
    let expected: Vec<f64> =
        before.chunks(3).flat_map(|x| [x[0] + 0.4 * t, x[1] + 0.1 * t, x[2] + 2.0 * t - 0.5 * 9.81 * t * t]).collect();
    for integrator in ALL {
        let state = end(place, fall, integrator, 1.0 / 30.0, t);
        assert_near(&format!("{integrator:?}"), &values(&state.positions), &expected, 1e-12);
    }
}

/// Halving the step divides the error by `2^order`; 0.1 is left for the next order's share.
#[test]
fn measured_orders_are_two_four_and_two() {
    let place = reference();
    // An axis that turns while it speeds up: nothing about it is exact.
    let tumble = [[0.7, -0.4, 0.2], [-0.5, 0.3, -1.0], [1.0, -2.0, 1.5], [2.0, 1.0, -3.0]];
    let truth = end(place, tumble, Integrator::Rk4, 1.0 / 2048.0, 1.0);
    for (integrator, order) in [(Integrator::Rk2, 2.0), (Integrator::Rk4, 4.0), (Integrator::Screw, 2.0)] {
        let errors = [32.0, 64.0, 128.0].map(|n| distance(&end(place, tumble, integrator, 1.0 / n, 1.0), &truth));
        for pair in errors.windows(2) {
            let slope = (pair[0] / pair[1]).log2();
            assert!((slope - order).abs() < 0.1, "{integrator:?}: slope {slope}, errors {errors:?}");
        }
    }
}

#[test]
fn a_step_back_returns() {
    let place = reference();
    let vector = |v: [f64; 3]| place.tensor(&v, [1, 3]).repeat_dim(0, 5);
    let dynamics = Dynamics {
        velocity: vector([0.7, -0.4, 0.2]),
        acceleration: vector([0.0; 3]),
        angular: vector([1.0, -2.0, 1.5]),
        angular_acceleration: vector([0.0; 3]),
    };
    let centre = place.tensor(&CENTRE, [1, 3]);
    let before = start(place, 5);
    // The error of a step is its local one, to the order one above: (|w| h)^3 / 4 and (|w| h)^5 / 60, |w| h = 0.1.
    for (integrator, bound) in [(Integrator::Rk2, 3e-4), (Integrator::Rk4, 3e-7), (Integrator::Screw, 1e-14)] {
        let step = |state: &State, h: f64| integrator.step(state, h, &centre, None, |_, later| dynamics.twist(later));
        let h = 0.1 / 7.25_f64.sqrt();
        let back = step(&step(&before, h), -h);
        let error = distance(&back, &before);
        assert!(error <= bound, "{integrator:?}: {error}");
    }
}

#[test]
fn orientations_stay_unit_quaternions_over_a_thousand_steps() {
    let place = reference();
    for integrator in ALL {
        let state = end(place, ROTATION, integrator, 1e-3, 1.0);
        for q in values(&state.turns).chunks(4) {
            let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
            // Rounding of each product adds up to a thousand times 1e-16 times a few.
            assert!((norm - 1.0).abs() < 1e-12, "{integrator:?}: {norm}");
        }
    }
}
