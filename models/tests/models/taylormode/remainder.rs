//! The remainder in 3D: zero at the start, faster than `|s|^n` at t0, and no network throws Gaussians away.

use burn::module::Module;
use gs_burn::{NamedGradients, map_parameters};
use gs_models::taylormode::{Paths, RemainderFrame};
use gs_tests::devices::{everywhere, reference};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{largest, values};

use crate::{WINDOW, cast, gaussians, log_slope, randomised, standing};

#[test]
fn it_vanishes_faster_than_the_polynomial() {
    let place = reference();
    for order in 0..=4 {
        let mut random = Random::new(order as u64);
        let network = RemainderFrame { centre: [0.0; 3], scale: 1.0, order }.init(9, &place.device);
        let network = randomised(network, 1.0, place, &mut random);
        let remainder = network.evaluate(place.tensor(&random.values(9, -1.0, 1.0), [3, 3]));
        let paths = Paths { remainder: Some(remainder), ..standing(place, &[0, 1, 2]) };
        let steps = [1e-2, 1e-3, 1e-4];
        let sizes = steps.map(|s| largest(&values(&paths.displacement(WINDOW.t0 + s * WINDOW.half))));
        let slope = log_slope(&steps, &sizes);
        assert!(slope > order as f64 + 0.9, "order {order}: it vanishes as |s|^{slope:.2}");
    }
}

#[test]
fn it_starts_at_zero_and_one_step_moves_nothing_far() {
    for place in everywhere() {
        let scale = 3.0;
        let still = gaussians(place, &mut Random::new(2));
        let network = RemainderFrame { centre: [0.5; 3], scale, order: 2 }.init(3, &place.device);
        let network = cast(network, place).train();
        let remainder = network.evaluate(still.means.val());
        let mut paths = Paths { remainder: Some(remainder), ..standing(place, &[0, 1, 2, 3, 4, 5]) };
        let t = WINDOW.t0 + 0.9 * WINDOW.half;
        let displacement = paths.displacement(t);
        assert!(values(&displacement).iter().all(|x| *x == 0.0), "{}: not zero at the start", place.name);

        // The first step of Adam changes every weight by its rate, in the direction of the gradient's sign.
        let mut gradients = (displacement.sum() + paths.velocity(t).sum()).backward();
        let gradients = NamedGradients::take(&network, &mut gradients);
        let stepped = map_parameters(network.valid(), |path, table| {
            table - gradients.get(path).expect("every leaf has one").clone().sign() * 1e-4
        });
        paths.remainder = Some(stepped.evaluate(still.means.val()));
        for s in [-1.0, -0.5, 0.5, 1.0, 1.1, 2.0] {
            let moved = largest(&values(&paths.displacement(WINDOW.t0 + s * WINDOW.half)));
            assert!(moved > 0.0, "{}: the step changed nothing at {s}", place.name);
            assert!(moved <= 0.01 * scale, "{}: one step moved a Gaussian by {moved} at s = {s}", place.name);
        }
    }
}
