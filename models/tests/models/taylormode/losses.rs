//! Eq. 13, 15, 17 and 18 against numbers worked out by hand.

use burn::tensor::Tensor;
use gs_models::taylormode::losses::{blur_loss, hybrid_target, smoothness_loss, velocity_loss};
use gs_tests::devices::everywhere;
use gs_tests::tolerance::{assert_near, values};

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
    }
}
