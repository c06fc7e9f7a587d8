//! Eq. 13 and 15 to 18 against numbers worked out by hand.

use burn::tensor::Tensor;
use gs_models::taylormode::DepthSpace;
use gs_models::taylormode::losses::{
    DEPTH_EPSILON, blur_loss, depth_correlation_loss, depth_loss, hybrid_target, smoothness_loss, velocity_loss,
};
use gs_tests::devices::{Place, everywhere};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_finite, assert_near, values};

#[test]
fn each_term_is_its_equation() {
    for place in everywhere() {
        let name = &place.name;
        let near = |what: &str, found: Tensor<1>, expected: f64| {
            assert_near(&format!("{name}: {what}"), &values(&found), &[expected], 1e-6);
        };
        let image = |numbers: [f64; 6]| place.tensor(&numbers, [1, 2, 3]);
        let pseudo = image([1.0; 6]);
        let photo = image([0.5; 6]);
        let moving = place.tensor(&[1.0, 0.0], [1, 2, 1]);
        let target = hybrid_target(pseudo, photo, moving);
        assert_eq!(values(&target), [1.0, 1.0, 1.0, 0.5, 0.5, 0.5], "{name}: Eq. 13");

        let rows = |numbers: [f64; 6]| place.tensor(&numbers, [2, 3]);
        let blurred = rows([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
        near("Eq. 15", blur_loss(blurred, rows([0.0; 6]), 10), 2.1 / 30.0);
        near(
            "Eq. 17",
            velocity_loss(rows([1.0, 2.0, 3.0, -1.0, 0.0, 1.0]), place.tensor(&[1.0, 1.0, 1.0], [1, 3]), 4),
            6.0 / 12.0,
        );
        let weights = place.tensor(&[0.5, 0.3, 0.2, 0.2, 0.2, 0.6], [2, 3]);
        near("Eq. 18", smoothness_loss(weights, 5), (0.04 + 0.01 + 0.0 + 0.16) / 5.0);
        near("Eq. 18 of one", smoothness_loss(place.tensor(&[1.0, 1.0], [2, 1]), 5), 0.0);

        let e = DEPTH_EPSILON;
        let rendered = place.tensor(&[2.0, 0.0, 3.0, 1.0], [2, 2, 1]);
        let prior = place.tensor(&[1.0, 4.0, 0.0, 1.0], [2, 2, 1]);
        near("Eq. 16", depth_loss(rendered, prior), ((2.0 + e) / (1.0 + e)).ln() / 4.0);
    }
}

#[test]
fn correlation_of_depth_knows_no_scale_and_shift() {
    for place in everywhere() {
        let numbers = Random::new(3).values(6, 1.0, 3.0);
        let rendered = place.leaf(&numbers, [2, 3, 1]);
        let prior =
            |f: &dyn Fn(f64) -> f64| place.tensor(&numbers.iter().map(|z| f(*z)).collect::<Vec<_>>(), [2, 3, 1]);
        let loss = |prior, space| depth_correlation_loss(rendered.clone(), prior, space);
        let near = |found: Tensor<1>, expected| assert_near(&place.name, &values(&found), &[expected], 1e-5);
        near(loss(prior(&|z| 0.3 * z + 2.0), DepthSpace::Depth), 0.0);
        near(loss(prior(&|z| 5.0 / z - 0.1), DepthSpace::InverseDepth), 0.0);
        near(loss(prior(&|z| 9.0 - z), DepthSpace::Depth), 2.0);
        near(loss(prior(&|_| 1.0), DepthSpace::Depth), 0.0);
        // The other space bends it, and the gradient says how.
        let bent = loss(prior(&|z| 1.0 / z), DepthSpace::Depth);
        let gradients = bent.backward();
        let gradient = values(&rendered.grad(&gradients).expect("tracked"));
        assert!(gradient.iter().all(|g| g.is_finite()) && gradient.iter().any(|g| *g != 0.0), "{}", place.name);
        let flat = place.leaf(&[2.0; 6], [2, 3, 1]);
        let gradients = depth_correlation_loss(flat.clone(), prior(&|z| z), DepthSpace::Depth).backward();
        assert_finite(&place.name, &values(&flat.grad(&gradients).expect("tracked")));
    }
}

#[test]
fn depth_gradients_stay_finite_where_nothing_is_known() {
    fn check(place: &Place) {
        let numbers = Random::new(1).values(6, 0.0, 3.0);
        let rendered = place.leaf(&[0.0, 0.0, numbers[0], numbers[1], numbers[2], 1e-6], [2, 3, 1]);
        let prior = place.tensor(&[0.0, 1.0, 0.0, numbers[3], 2.0, 5.0], [2, 3, 1]);
        let gradients = depth_loss(rendered.clone(), prior).backward();
        let gradient = values(&rendered.grad(&gradients).expect("tracked"));
        assert_finite(&place.name, &gradient);
        assert!(gradient[..3].iter().all(|g| *g == 0.0), "{}: unknown pixels pull", place.name);
        assert!(gradient[3..].iter().all(|g| *g != 0.0), "{}: known pixels do not pull", place.name);
    }
    everywhere().for_each(check);
}
