//! Eq. 2 and 3: identity at t0, order of accuracy, velocity, known trajectories recovered.

use burn::tensor::Tensor;
use gs_burn::Gaussians;
use gs_models::taylormode::window::powers_of;
use gs_models::taylormode::{Paths, RemainderFrame, TimeWindow};
use gs_tests::devices::{doubles, everywhere, reference};
use gs_tests::finite_differences::assert_derivatives;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, largest, values};

use crate::{WINDOW, gaussians, log_slope, paths, randomised, rows, standing};

/// Centres and orientations of the moving rows at one time.
fn sampled(paths: &Paths, still: &Gaussians, t: f64) -> (Tensor<2>, Tensor<2>) {
    let samples = paths.samples(&still.means.val(), &still.quats.val(), &vec![t].into());
    (samples.means, samples.quats)
}

#[test]
fn nothing_has_moved_at_t0() {
    for place in everywhere() {
        let mut random = Random::new(1);
        let still = gaussians(place, &mut random);
        let paths = paths(place, &mut random);
        let at = paths.moved(&still, WINDOW.t0);
        for (what, a, b) in [
            ("means", values(&at.means.val()), values(&still.means.val())),
            ("quats", values(&at.quats.val()), values(&still.quats.val())),
        ] {
            assert!(a.iter().zip(&b).all(|(a, b)| a.to_bits() == b.to_bits()), "{}: {what} at t0", place.name);
        }
        let (means, _) = sampled(&paths, &still, WINDOW.t0);
        let stored = still.means.val().select(0, paths.rows.clone());
        assert_eq!(values(&means), values(&stored), "{}: sampled at t0", place.name);
    }
}

#[test]
fn rows_that_are_not_listed_stay() {
    let place = reference();
    let mut random = Random::new(2);
    let still = gaussians(place, &mut random);
    let paths = paths(place, &mut random);
    let t = 0.53;
    let moved = paths.moved(&still, t);
    let (before, after) = (values(&still.means.val()), values(&moved.means.val()));
    let displacement = values(&paths.displacement(t));
    let velocities = values(&paths.velocities(6, t));
    let velocity = values(&paths.velocity(t));
    for row in 0..6 {
        for axis in 0..3 {
            let listed = [4, 1, 2].iter().position(|r| *r == row);
            let expected = listed.map_or((0.0, 0.0), |m| (displacement[3 * m + axis], velocity[3 * m + axis]));
            let i = 3 * row + axis;
            assert!((after[i] - before[i] - expected.0).abs() < 1e-15, "row {row} axis {axis}");
            assert_eq!(velocities[i], expected.1, "velocity of row {row} axis {axis}");
        }
    }
    let (means, quats) = sampled(&paths, &still, t);
    assert_eq!(values(&means), values(&moved.means.val().select(0, paths.rows.clone())));
    assert_eq!(values(&quats), values(&moved.quats.val().select(0, paths.rows.clone())));
}

/// Taylor's coefficients are `f^(k) half^k / k!`: the series of `sin(3 t)` about t0, whose error falls as `half^(n+1)`.
#[test]
fn the_error_falls_with_the_order() {
    let place = reference();
    for order in 0..=5_usize {
        let halves = [0.2, 0.1, 0.05];
        let errors = halves.map(|half| {
            let window = TimeWindow { t0: 0.7, half };
            let mut factorial = 1.0;
            let coefficients = (1..=order).map(|k| {
                factorial *= k as f64;
                let turned = 3.0 * window.t0 + k as f64 * std::f64::consts::FRAC_PI_2;
                3_f64.powi(k as i32) * turned.sin() * half.powi(k as i32) / factorial
            });
            let mut blocks: Vec<f64> = coefficients.collect();
            // The blocks whose polynomials have these coefficients, from the highest power on.
            for (k, powers) in powers_of(order).iter().enumerate().rev() {
                blocks[k] /= powers[k];
                (0..k).for_each(|power| blocks[power] -= powers[power] * blocks[k]);
            }
            let position: Vec<f64> = blocks.iter().flat_map(|block| [*block, 0.0, 0.0]).collect();
            let paths = Paths {
                rows: rows(place, &[0]),
                position: place.tensor(&position, [1, 3 * order]),
                rotation: place.tensor(&[], [1, 0]),
                window,
                remainder: None,
                kinks: None,
            };
            let t = window.t0 + half;
            (values(&paths.displacement(t))[0] - ((3.0 * t).sin() - (3.0 * window.t0).sin())).abs()
        });
        let slope = log_slope(&halves, &errors);
        assert!((slope - (order + 1) as f64).abs() < 0.25, "order {order}: the error falls as half^{slope:.2}");
    }
}

#[test]
fn velocity_is_the_derivative_of_displacement() {
    for place in doubles() {
        let mut random = Random::new(3);
        let mut paths = paths(place, &mut random);
        let frame = RemainderFrame { centre: [0.1, 0.2, 0.3], scale: 2.0, order: paths.order() };
        let network = randomised(frame.init(5, &place.device), 0.5, place, &mut random);
        paths.remainder = Some(network.evaluate(place.tensor(&random.values(9, -1.0, 1.0), [3, 3])));
        // Inside, at the edge's two sides, in the fade, beyond it.
        for s in [-2.7, -1.1, -0.98, -0.3, 0.0, 0.4, 0.999, 1.001, 1.2, 1.6] {
            let t = WINDOW.t0 + s * WINDOW.half;
            let h = 1e-6;
            let (up, down) = (values(&paths.displacement(t + h)), values(&paths.displacement(t - h)));
            let differences: Vec<f64> = up.iter().zip(&down).map(|(u, d)| (u - d) / (2.0 * h)).collect();
            // h^2 f''' and 1e-16 / h, with derivatives by t up to (pi 2 / half)^3 of the displacement.
            let bound = 1e-6 * largest(&differences).max(1.0);
            assert_near(&format!("{} at s = {s}", place.name), &values(&paths.velocity(t)), &differences, bound);
        }
    }
}

#[test]
fn gradients_reach_coefficients_and_gaussians() {
    let place = reference();
    let mut random = Random::new(4);
    let still = gaussians(place, &mut random);
    let (means, quats) = (values(&still.means.val()), values(&still.quats.val()));
    let base = paths(place, &mut random);
    let pull = [random.values(18, -1.0, 1.0), random.values(24, -1.0, 1.0), random.values(18, -1.0, 1.0)];
    let t = 0.57;
    let (position, rotation) = (values(&base.position), values(&base.rotation));
    let arguments: [(&str, &[f64]); 4] =
        [("position", &position), ("rotation", &rotation), ("means", &means), ("quats", &quats)];
    assert_derivatives("paths", place, arguments, 30, |[position, rotation, means, quats]| {
        let (position, rotation) = (position.reshape([3, 9]), rotation.reshape([3, 6]));
        let paths = Paths { position, rotation, ..base.clone() };
        (paths.means_at(means.reshape([6, 3]), t) * place.tensor(&pull[0], [6, 3])).sum()
            + (paths.quats_at(quats.reshape([6, 4]), t).square() * place.tensor(&pull[1], [6, 4])).sum()
            + (paths.velocities(6, t) * place.tensor(&pull[2], [6, 3])).sum()
    });
}

/// A cubic path and an accelerating turn, from where three points on the Gaussian's axes are at 16 times.
#[test]
fn known_trajectories_are_recovered() {
    for place in doubles() {
        let mut random = Random::new(6);
        let truth = paths(place, &mut random);
        let truth = [truth.position.clone() * 0.5, truth.rotation.clone() * 0.5];
        let of = |[position, rotation]: &[Tensor<2>; 2]| Paths {
            position: position.clone(),
            rotation: rotation.clone(),
            rows: rows(place, &[4, 1, 2]),
            ..standing(place, &[])
        };
        let still = gaussians(place, &mut random);
        let times: Vec<f64> = (0..16).map(|i| WINDOW.t0 + WINDOW.half * ((f64::from(i) + 0.5) / 8.0 - 1.0)).collect();
        let seen = |paths: &Paths, t: f64| {
            let (means, quats) = sampled(paths, &still, t);
            Tensor::cat(vec![means, quats], 1)
        };
        let targets: Vec<Tensor<2>> = times.iter().map(|t| seen(&of(&truth), *t)).collect();
        let mut found = truth.clone().map(|tensor| tensor.zeros_like());
        let mut momenta = found.clone();
        // Heavy ball, for a quadratic of condition 100: the polynomials on -1..1 make one below it.
        for _ in 0..600 {
            let leaves = found.clone().map(|tensor| tensor.autodiff().require_grad());
            let tracked = of(&leaves);
            let errors =
                times.iter().zip(&targets).map(|(t, target)| (seen(&tracked, *t) - target.clone()).square().sum());
            let loss = errors.reduce(|a, b| a + b).expect("16 times") / 16.0;
            let gradients = loss.backward();
            for i in 0..2 {
                let gradient = leaves[i].grad(&gradients).expect("tracked");
                momenta[i] = momenta[i].clone() * 0.9 - gradient * 0.2;
                found[i] = found[i].clone() + momenta[i].clone();
            }
        }
        for (what, found, truth) in [("position", &found[0], &truth[0]), ("rotation", &found[1], &truth[1])] {
            assert_near(&format!("{}: {what}", place.name), &values(found), &values(truth), 1e-3);
        }
    }
}

#[test]
fn nothing_that_moves_is_no_special_case() {
    for place in everywhere() {
        let still = gaussians(place, &mut Random::new(7));
        let none = standing(place, &[]);
        assert_eq!(values(&none.means_at(still.means.val(), 0.6)), values(&still.means.val()));
        assert_eq!(values(&none.velocities(6, 0.6)).len(), 18);
        let (means, quats) = sampled(&none, &still, 0.6);
        assert_eq!([means.dims(), quats.dims()], [[0, 3], [0, 4]], "{}", place.name);
        let flat = standing(place, &[0, 5]);
        assert_eq!(flat.displacement(0.6).dims(), [2, 3]);
    }
}
