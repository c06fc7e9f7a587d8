use super::*;
use crate::testing::{Random, assert_same_gradients, gradient_of, tensor, values};

#[test]
fn the_lookup_is_the_reference_with_its_gradients() {
    for (height, width, channels) in [(6, 7, 3), (1, 5, 2), (4, 1, 1), (33, 40, 3)] {
        let image = Random(1).tensor([height, width, channels], -1.0, 1.0).require_grad();
        // Inside, and up to two pixels beyond each border.
        let positions = Random(2).tensor([300, 2], -2.0, width.max(height) as f64 + 2.0).require_grad();
        let expected = bilinear_reference(image.clone(), positions.clone());
        let leaves: [(&str, &crate::testing::GradientOf); 2] =
            [("image", &gradient_of(&image)), ("positions", &gradient_of(&positions))];
        assert_same_gradients(bilinear(image.clone(), positions.clone()), expected, &leaves);
    }
}

#[test]
fn one_tracked_argument_alone_gets_a_gradient() {
    let image = Random(3).tensor([5, 4, 3], -1.0, 1.0);
    let positions = Random(4).tensor([9, 2], 0.0, 4.0);
    let leaf = image.clone().require_grad();
    let gradients = bilinear(leaf.clone(), positions.clone()).sum().backward();
    let total: f64 = values(&leaf.grad(&gradients).expect("tracked")).iter().sum();
    // The shares of a lookup sum to 1.
    assert!((total - 27.0).abs() < 1e-12, "{total}");
    let leaf = positions.require_grad();
    let gradients = bilinear(image, leaf.clone()).sum().backward();
    assert!(values(&leaf.grad(&gradients).expect("tracked")).iter().all(|g| g.is_finite()));
}

#[test]
fn no_positions_are_a_shape() {
    let none = bilinear(tensor(vec![1.0; 12], [2, 2, 3]), tensor(Vec::new(), [0, 2]));
    assert_eq!(none.dims(), [0, 3]);
}
