//! `gs_burn::ops::bilinear`: values, borders, gradients by image and place.

use gs_burn::ops::bilinear::bilinear;
use gs_tests::devices::{everywhere, reference};
use gs_tests::finite_differences::assert_derivative;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

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
    let (image, at) = (place.leaf(&numbers, [height, width, 2]), place.leaf(&places, [12, 2]));
    let gradients = (bilinear(image.clone(), at.clone()) * pull.clone()).sum().backward();
    let by_image = values(&image.grad(&gradients).expect("tracked"));
    let by_place = values(&at.grad(&gradients).expect("tracked"));
    assert_derivative("image", &numbers, &by_image, 40, |x| {
        let image = place.tensor(x, [height, width, 2]);
        values(&(bilinear(image, place.tensor(&places, [12, 2])) * pull.clone()).sum())[0]
    });
    assert_derivative("places", &places, &by_place, 24, |x| {
        let image = place.tensor(&numbers, [height, width, 2]);
        values(&(bilinear(image, place.tensor(x, [12, 2])) * pull.clone()).sum())[0]
    });
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
