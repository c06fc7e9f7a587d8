//! The exponential map and the product of quaternions, against glam and by differences.

use gs_burn::glam::{DQuat, DVec3};
use gs_models::rotation::{exp_less_one, product, turn};
use gs_tests::devices::{doubles, everywhere, reference};
use gs_tests::finite_differences::assert_derivatives;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_finite, assert_near, values};

fn quats(values: &[f64]) -> Vec<DQuat> {
    values.chunks(4).map(|q| DQuat::from_xyzw(q[1], q[2], q[3], q[0])).collect()
}

#[test]
fn turns_as_glam_does() {
    for place in doubles() {
        let mut random = Random::new(1);
        // From a hair to several full turns.
        let mut vectors = random.values(30, -1.0, 1.0);
        vectors.iter_mut().enumerate().for_each(|(i, x)| *x *= 10_f64.powi((i / 3) as i32 - 8));
        let start = random.values(40, -1.0, 1.0);
        let turned = turn(place.tensor(&start, [10, 4]), place.tensor(&vectors, [10, 3]));
        let expected = vectors.chunks(3).zip(quats(&start)).zip(start.chunks(4)).flat_map(|((r, q), old)| {
            let new = DQuat::from_scaled_axis(DVec3::from_slice(r)) * q;
            [new.w - old[0], new.x - old[1], new.y - old[2], new.z - old[3]]
        });
        assert_near(&place.name, &values(&turned), &expected.collect::<Vec<_>>(), 1e-14);
    }
}

#[test]
fn no_turn_is_exactly_none_and_has_a_gradient() {
    for place in everywhere() {
        let zero = place.leaf(&[0.0; 3], [1, 3]);
        let quats = place.tensor(&[0.3, -0.5, 0.7, 0.2], [1, 4]);
        let change = turn(quats.clone(), zero.clone());
        assert_eq!(values(&(quats.clone() + change)), values(&quats), "{}", place.name);
        // The real part does not change to first order, so this sum sees half of each component.
        let gradients = exp_less_one(zero.clone()).sum().backward();
        let gradient = values(&zero.grad(&gradients).expect("tracked"));
        assert_near(&place.name, &gradient, &[0.5; 3], 1e-6);
    }
}

#[test]
fn the_gradient_is_right_from_tiny_to_large_angles() {
    let place = reference();
    let mut random = Random::new(3);
    for size in [1e-3, 1.0, 5.0] {
        let at = random.values(12, -size, size);
        let pull = place.tensor(&random.values(16, -1.0, 1.0), [4, 4]);
        assert_derivatives(&format!("size {size}"), place, [("rotation vector", &at)], 12, |[at]| {
            (exp_less_one(at.reshape([4, 3])) * pull.clone()).sum()
        });
    }
    // Where differences cannot look: no angle gives anything that is not a number.
    for place in everywhere() {
        for size in [1e-30, 1e-20, 1e-9, 1e-7, 1e-4, 1e3] {
            let leaf = place.leaf(&[size, -size, 0.5 * size], [1, 3]);
            let gradients = exp_less_one(leaf.clone()).sum().backward();
            let gradient = values(&leaf.grad(&gradients).expect("tracked"));
            assert_finite(&place.name, &gradient);
            if size < 1e-3 {
                assert_near(&format!("{} at {size}", place.name), &gradient, &[0.5; 3], 1e-3);
            }
        }
    }
}

#[test]
fn products_are_hamiltons() {
    let place = reference();
    let mut random = Random::new(4);
    let (a, b) = (random.values(20, -1.0, 1.0), random.values(20, -1.0, 1.0));
    let found = values(&product(place.tensor(&a, [5, 4]), place.tensor(&b, [5, 4])));
    let expected = quats(&a).into_iter().zip(quats(&b)).flat_map(|(a, b)| {
        let q = a * b;
        [q.w, q.x, q.y, q.z]
    });
    assert_near("product", &found, &expected.collect::<Vec<_>>(), 1e-15);
}
