//! The remainder in 3D: zero at the start, faster than `|s|^n` at t0, and no network throws Gaussians away.

use gs_models::taylormode::{RemainderNetwork, TaylorMotion};
use gs_tests::devices::{everywhere, reference};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{largest, values};

use crate::{WINDOW, gaussians, log_slope};

#[test]
fn it_vanishes_faster_than_the_polynomial() {
    let place = reference();
    for order in 0..=4 {
        let mut random = Random::new(order as u64);
        let network = RemainderNetwork::new(order, [0.0; 3], 1.0, 9, &place.device).map(|tensor| {
            let count = tensor.shape().num_elements();
            place.tensor(&random.values(count, -1.0, 1.0), tensor.dims())
        });
        let motion = TaylorMotion::still(&[0, 1, 2], 0, 0, WINDOW, &place.device);
        let mut motion = motion.map(|tensor| tensor.cast(place.dtype));
        motion.remainder = Some(network.evaluate(place.tensor(&random.values(9, -1.0, 1.0), [3, 3])));
        let steps = [1e-2, 1e-3, 1e-4];
        let sizes = steps.map(|s| largest(&values(&motion.displacement(WINDOW.t0 + s * WINDOW.half))));
        let slope = log_slope(&steps, &sizes);
        assert!(slope > order as f64 + 0.9, "order {order}: it vanishes as |s|^{slope:.2}");
    }
}

#[test]
fn it_starts_at_zero_and_one_step_moves_nothing_far() {
    for place in everywhere() {
        let scale = 3.0;
        let still = gaussians(place, &mut Random::new(2));
        let network = RemainderNetwork::new(2, [0.5; 3], scale, 3, &place.device)
            .map(|tensor| tensor.cast(place.dtype).autodiff().require_grad());
        let motion = TaylorMotion::still(&[0, 1, 2, 3, 4, 5], 0, 0, WINDOW, &place.device);
        let mut motion = motion.map(|tensor| tensor.cast(place.dtype));
        motion.remainder = Some(network.evaluate(still.means.val()));
        let t = WINDOW.t0 + 0.9 * WINDOW.half;
        let displacement = motion.displacement(t);
        assert!(values(&displacement).iter().all(|x| *x == 0.0), "{}: not zero at the start", place.name);

        // The first step of Adam changes every weight by its rate, in the direction of the gradient's sign.
        let gradients = (displacement.sum() + motion.velocity(t).sum()).backward();
        let stepped = network.map(|leaf| {
            let gradient = leaf.grad(&gradients).expect("tracked");
            leaf.inner() - gradient.sign() * 1e-4
        });
        motion.remainder = Some(stepped.evaluate(still.means.val()));
        for s in [-1.0, -0.5, 0.5, 1.0, 1.1, 2.0] {
            let moved = largest(&values(&motion.displacement(WINDOW.t0 + s * WINDOW.half)));
            assert!(moved > 0.0, "{}: the step changed nothing at {s}", place.name);
            assert!(moved <= 0.01 * scale, "{}: one step moved a Gaussian by {moved} at s = {s}", place.name);
        }
    }
}
