//! `gs_burn::ops::bilinear`: values, borders, gradients by image and place.

use gs_burn::ops::bilinear::{bilinear, bilinear_reference};
use gs_tests::devices::{doubles, everywhere, reference};
use gs_tests::finite_differences::{Course, assert_course_derivatives};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, assert_same_gradients, gradient_of, values};

#[test]
fn values_are_those_of_the_patches() {
    for place in everywhere() {
        let image = place.tensor(&[0.0, 10.0, 1.0, 20.0, 2.0, 30.0, 4.0, 40.0], [2, 2, 2]);
        // Centres, the middle, a quarter, and beyond the corners.
        let places = [0.5, 0.5, 1.5, 1.5, 1.0, 1.0, 0.75, 0.5, -9.0, 1.5, 7.0, -3.0];
        let found = values(&bilinear(image, place.tensor(&places, [6, 2])));
        let expected = [0.0, 10.0, 4.0, 40.0, 1.75, 25.0, 0.25, 12.5, 2.0, 30.0, 1.0, 20.0];
        assert_near(&place.name, &found, &expected, 1e-5);
    }
}

#[test]
fn its_own_centres_give_the_image_back() {
    for place in everywhere() {
        for (height, width) in [(3, 4), (1, 5), (4, 1), (1, 1)] {
            let numbers = Random::new(1).values(height * width * 3, 0.0, 1.0);
            let image = place.tensor(&numbers, [height, width, 3]);
            let centres: Vec<f64> =
                (0..height * width).flat_map(|i| [(i % width) as f64 + 0.5, (i / width) as f64 + 0.5]).collect();
            let found = values(&bilinear(image, place.tensor(&centres, [height * width, 2])));
            assert_eq!(found, numbers, "{}: {height} x {width}", place.name);
        }
    }
}

#[test]
fn gradients_are_derivatives() {
    let place = reference();
    let mut random = Random::new(2);
    let (height, width) = (4, 5);
    let numbers = random.values(height * width * 2, 0.0, 1.0);
    // Between centres, some of them beyond the border.
    let places: Vec<f64> =
        (0..24).map(|_| f64::from(random.uniform(-1.0, 6.0) as i32) + random.uniform(0.1, 0.4)).collect();
    let pull = place.tensor(&random.values(24, -1.0, 1.0), [12, 2]);
    assert_course_derivatives(
        "lookup",
        Course::Smooth,
        place,
        [("image", &numbers), ("places", &places)],
        40,
        |[image, at]| (bilinear(image.reshape([height, width, 2]), at.reshape([12, 2])) * pull.clone()).sum(),
    );
}

#[test]
fn doubles_follow_the_reference() {
    for place in doubles() {
        for (height, width, channels) in [(6, 7, 3), (1, 5, 2), (4, 1, 1), (33, 40, 3)] {
            let image = Random::new(1).leaf(place, [height, width, channels], -1.0, 1.0);
            // Inside, and up to two pixels beyond each border.
            let at = Random::new(2).leaf(place, [300, 2], -2.0, width.max(height) as f64 + 2.0);
            let [actual, expected] = [bilinear, bilinear_reference].map(|lookup| lookup(image.clone(), at.clone()));
            assert_same_gradients(actual, expected, &[("image", gradient_of(&image)), ("places", gradient_of(&at))]);
        }
    }
}

#[test]
fn one_tracked_argument_alone_gets_a_gradient() {
    let place = reference();
    let (image, at) = (Random::new(3).values(60, -1.0, 1.0), Random::new(4).values(18, 0.0, 4.0));
    let leaf = place.leaf(&image, [5, 4, 3]);
    let gradients = bilinear(leaf.clone(), place.tensor(&at, [9, 2]).autodiff()).sum().backward();
    let total: f64 = values(&leaf.grad(&gradients).expect("tracked")).iter().sum();
    // The shares of a lookup sum to 1.
    assert!((total - 27.0).abs() < 1e-12, "{total}");
    let leaf = place.leaf(&at, [9, 2]);
    let gradients = bilinear(place.tensor(&image, [5, 4, 3]).autodiff(), leaf.clone()).sum().backward();
    assert!(values(&leaf.grad(&gradients).expect("tracked")).iter().all(|g| g.is_finite()));
}

#[test]
fn no_positions_are_a_shape() {
    let place = reference();
    assert_eq!(bilinear(place.tensor(&[1.0; 12], [2, 2, 3]), place.tensor(&[], [0, 2])).dims(), [0, 3]);
}

#[test]
fn places_that_are_no_numbers_harm_only_their_own_row() {
    for place in everywhere() {
        let image = place.tensor(&[0.25; 12], [2, 2, 3]);
        let places = place.tensor(&[f64::NAN, 0.5, 0.5, f64::INFINITY, 1.0, 1.0], [3, 2]);
        let found = values(&bilinear(image, places));
        assert_near(&place.name, &found[3..], &[0.25; 6], 1e-6);
    }
}
