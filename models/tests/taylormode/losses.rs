//! Eq. 13 to 19 against numbers worked out by hand.

use burn::tensor::Tensor;
use gs_models::taylormode::losses::{
    DEPTH_EPSILON, Terms, Weights, blur_loss, depth_loss, hybrid_target, sharp_loss, smoothness_loss, velocity_loss,
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
        let target = hybrid_target(pseudo, photo.clone(), moving);
        assert_eq!(values(&target), [1.0, 1.0, 1.0, 0.5, 0.5, 0.5], "{name}: Eq. 13");
        near("Eq. 14 of the same", sharp_loss(photo.clone(), photo), 0.0);

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
fn the_total_leaves_out_what_is_missing() {
    for place in everywhere() {
        let one = |x: f64| place.tensor(&[x], [1]);
        let terms =
            Terms { sharp: one(0.5), blur: Some(one(2.0)), depth: None, velocity: Some(one(100.0)), smooth: None };
        let total = values(&terms.clone().total(&Weights::default()));
        assert_near(&place.name, &total, &[0.5 + 0.5 * 2.0 + 5e-5 * 100.0], 1e-6);
        let none = Weights { blur: 0.0, velocity: 0.0, ..Weights::default() };
        assert_near(&place.name, &values(&terms.total(&none)), &[0.5], 1e-6);
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
