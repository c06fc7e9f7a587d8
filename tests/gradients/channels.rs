//! `gs_burn::ops::channels`.

use gs_burn::ops::channels::channels;
use gs_tests::devices::{doubles, everywhere};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_same_gradients, gradient_of, values};

/// A selection hands the gradient back where it came from; two selections of one image add up.
#[test]
fn gradient_lands_in_its_channels() {
    let shape = [37, 53, 5];
    for place in everywhere() {
        let [image, weights] = [1, 2].map(|seed| Random::new(seed).values(37 * 53 * 5, -1.0, 1.0));
        let leaf = place.leaf(&image, shape);
        let part = |first: usize, count: usize| {
            let weights: Vec<f64> = weights.chunks(5).flat_map(|pixel| &pixel[first..first + count]).copied().collect();
            let weights = place.tensor(&weights, [37, 53, count]).autodiff();
            (channels(leaf.clone(), first, count) * weights).sum()
        };
        // Channel 3 is asked for twice, channel 0 never.
        let gradients = (part(1, 3) + part(3, 2)).backward();
        let expected: Vec<f64> =
            weights.iter().enumerate().map(|(i, w)| w * [0.0, 1.0, 1.0, 2.0, 1.0][i % 5]).collect();
        assert_eq!(values(&leaf.grad(&gradients).expect("the image is tracked")), expected, "{}", place.name);
    }
}

#[test]
fn channels_are_those_narrowed_to() {
    for place in doubles() {
        for (first, count) in [(0, 3), (4, 1), (1, 4), (0, 5)] {
            let image = Random::new(13).leaf(place, [7, 6, 5], -1.0, 1.0);
            let [actual, expected] = [channels(image.clone(), first, count), image.clone().narrow(2, first, count)];
            assert_same_gradients(actual, expected, &[("image", gradient_of(&image))]);
        }
    }
}
