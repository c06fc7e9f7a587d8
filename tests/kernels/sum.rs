//! `gs_burn::ops::sum`.

use burn::tensor::Tensor;
use gs_burn::ops::opacity::opacities_reference;
use gs_burn::ops::sum::{Activation, activated_sum, largest, mark_not_finite, mean, sum};
use gs_tests::devices::{doubles, everywhere};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_same_gradients, bits, gradient_of, values};

/// Lengths around a unit's, a cube's and a grid's work.
const LENGTHS: [usize; 8] = [1, 255, 256, 1024, 1025, 70_000, 262_145, 1_500_000];

#[test]
fn sums_of_small_whole_numbers_are_exact() {
    for place in everywhere() {
        assert_eq!(values(&sum(place.tensor(&[], [0, 3]))), [0.0], "{}", place.name);
        for length in LENGTHS {
            let numbers: Vec<f64> = (0..length).map(|i| (i % 5) as f64 - 1.0).collect();
            let total: f64 = numbers.iter().sum();
            assert_eq!(values(&sum(place.tensor(&numbers, [length]))), [total], "{length} on {}", place.name);
        }
    }
}

#[test]
fn sums_and_means_are_burns_with_their_gradients() {
    for place in doubles() {
        let leaf = Random::new(4).leaf(place, [5, 7, 3], -1.0, 1.0);
        let squares = || leaf.clone().square();
        let same = |actual, expected| assert_same_gradients(actual, expected, &[("leaf", gradient_of(&leaf))]);
        same(sum(squares()), squares().sum());
        // The backward of Burn's `mean` divides in f32.
        same(mean(squares()), squares().sum() * (1.0 / 105.0));
        same(activated_sum(leaf.clone(), Activation::Exp, 0.25), leaf.clone().exp().sum() * 0.25);
        let sigmoid = opacities_reference(leaf.clone().flatten(0, 2));
        same(activated_sum(leaf.clone(), Activation::Sigmoid, 3.0), sigmoid.sum() * 3.0);
    }
}

#[test]
fn the_largest_is_found_wherever_it_is() {
    for place in everywhere() {
        for length in LENGTHS {
            for at in [0, length / 2, length - 1] {
                let mut numbers = vec![-3.0; length];
                numbers[at] = -1.5;
                let found = values(&largest(place.tensor(&numbers, [length])));
                assert_eq!(found, [-1.5], "{at} of {length} on {}", place.name);
            }
        }
    }
}

#[test]
fn sums_are_equal_to_the_bit_and_pass_on_a_constant() {
    let numbers = Random::new(5).values(70_001, -1.0, 1.0);
    for place in everywhere().filter(|place| !place.is_double()) {
        let once = |_| bits(&sum(place.tensor(&numbers, [70_001])));
        assert!((0..3).map(once).all(|result| result == once(0)), "{}", place.name);
        let leaf = place.leaf(&numbers, [70_001]);
        let gradients = (mean(leaf.clone()) * 70_001.0).backward();
        let gradient: Tensor<1> = leaf.grad(&gradients).expect("the leaf is tracked");
        assert!(values(&gradient).iter().all(|g| (g - 1.0).abs() < 1e-6), "{}", place.name);
    }
}

#[test]
fn one_number_that_is_not_finite_is_found_wherever_it_is() {
    for place in everywhere() {
        for length in [1, 300, 2048, 70_000] {
            for broken in [0, length / 2, length - 1] {
                for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                    let mut numbers = vec![1.0; length];
                    let mark = mark_not_finite(None, place.tensor(&numbers, [length]));
                    assert_eq!(values(&mark), [0.0], "{length} on {}", place.name);
                    numbers[broken] = bad;
                    let mark = mark_not_finite(Some(mark), place.tensor(&numbers, [length]));
                    assert!(values(&mark)[0].is_nan(), "{broken} of {length} on {}", place.name);
                    let mark = mark_not_finite(Some(mark), place.tensor(&[1.0, 2.0], [2]));
                    assert!(values(&mark)[0].is_nan(), "the mark stays on {}", place.name);
                }
            }
        }
    }
}
