//! Rotations by a vector, against glam and by quadrature.

use gs_burn::glam::{DQuat, DVec3};
use gs_models::sparsedyn::turning::Factors;
use gs_tests::devices::{doubles, everywhere, reference};
use gs_tests::finite_differences::assert_derivatives;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_finite, assert_near, values};

#[test]
fn rotations_are_those_of_glam_from_tiny_to_large_angles() {
    for place in doubles() {
        let mut random = Random::new(1);
        for size in [1e-9, 1e-4, 0.1, 0.28, 0.29, 1.0, 3.0, 12.0] {
            let (r, u) = (random.values(30, -size, size), random.values(30, -1.0, 1.0));
            let rotation = place.tensor(&r, [10, 3]);
            let turned = Factors::of(&rotation).turned_by(&rotation, &place.tensor(&u, [10, 3]));
            let expected = r.chunks(3).zip(u.chunks(3)).flat_map(|(r, u)| {
                let u = DVec3::from_slice(u);
                (DQuat::from_scaled_axis(DVec3::from_slice(r)) * u - u).to_array()
            });
            // Rounding of glam's own unit quaternion.
            assert_near(&format!("{} at {size}", place.name), &values(&turned), &expected.collect::<Vec<_>>(), 2e-12);
        }
    }
}

#[test]
fn the_integral_is_that_of_the_rotation() {
    let place = reference();
    let mut random = Random::new(2);
    for size in [1e-5, 0.2, 0.3, 2.0] {
        let (r, u) = (random.values(12, -size, size), random.values(12, -1.0, 1.0));
        let rotation = place.tensor(&r, [4, 3]);
        let integral = Factors::of(&rotation).integrated(&rotation, &place.tensor(&u, [4, 3]));
        let expected = r.chunks(3).zip(u.chunks(3)).flat_map(|(r, u)| {
            let (r, u) = (DVec3::from_slice(r), DVec3::from_slice(u));
            // Gauss, three nodes in each of 64 parts: below 1e-14 for these angles.
            let nodes = [(0.5 - 0.15_f64.sqrt(), 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + 0.15_f64.sqrt(), 5.0 / 18.0)];
            let at = |s: f64| DQuat::from_scaled_axis(r * s) * u;
            let parts = (0..64).flat_map(|k| nodes.map(|(x, weight)| at((f64::from(k) + x) / 64.0) * weight / 64.0));
            (parts.sum::<DVec3>() - u).to_array()
        });
        assert_near(&format!("{size}"), &values(&integral), &expected.collect::<Vec<_>>(), 2e-12);
    }
}

#[test]
fn gradients_are_right_on_both_sides_of_the_series() {
    let place = reference();
    let mut random = Random::new(3);
    for size in [1e-3, 0.2, 0.6, 3.0] {
        let at = random.values(12, -size, size);
        let [u, pull] = [(); 2].map(|()| place.tensor(&random.values(12, -1.0, 1.0), [4, 3]).autodiff());
        assert_derivatives(&format!("size {size}"), place, [("rotation vector", &at)], 12, |[at]| {
            let rotation = at.reshape([4, 3]);
            let factors = Factors::of(&rotation);
            ((factors.turned_by(&rotation, &u) + factors.integrated(&rotation, &u)) * pull.clone()).sum()
        });
    }
    for place in everywhere() {
        for size in [0.0, 1e-30, 1e-12, 1e-4, 1e3] {
            let leaf = place.leaf(&[size, -size, 0.5 * size], [1, 3]);
            let u = place.tensor(&[1.0, 2.0, 3.0], [1, 3]).autodiff();
            let gradients = Factors::of(&leaf).turned_by(&leaf, &u).sum().backward();
            assert_finite(&place.name, &values(&leaf.grad(&gradients).expect("tracked")));
        }
    }
}
