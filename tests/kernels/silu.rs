//! `gs_burn::ops::silu`.

use gs_burn::ops::silu::{silu, silu_reference};
use gs_tests::devices::everywhere;
use gs_tests::tolerance::{FORWARD_F32, FORWARD_F64, assert_near, values};

const VALUES: [f64; 18] =
    [-200.0, -90.0, -20.0, -7.0, -3.0, -1.28, -0.5, -1e-3, 0.0, 1e-3, 0.5, 1.28, 3.0, 7.0, 20.0, 60.0, 90.0, 200.0];

#[test]
fn values_and_gradients_are_those_of_the_definition() {
    let weights: Vec<f64> = (0..VALUES.len()).map(|k| 1.0 - 0.3 * k as f64).collect();
    for place in everywhere() {
        let bound = if place.is_double() { FORWARD_F64 } else { FORWARD_F32 };
        let leaf = place.leaf(&VALUES, [6, 3]);
        let found = silu(leaf.clone());
        let expected = VALUES.map(|x| x / (1.0 + (-x).exp()));
        assert_near(&place.name, &values(&found), &expected, bound);
        let gradients = (found * place.tensor(&weights, [6, 3])).sum().backward();
        let slope = |x: f64| {
            let s = 1.0 / (1.0 + (-x).exp());
            s * (1.0 + x * (1.0 - s))
        };
        let slopes: Vec<f64> = VALUES.iter().zip(&weights).map(|(x, weight)| weight * slope(*x)).collect();
        assert_near(&place.name, &values(&leaf.grad(&gradients).expect("tracked")), &slopes, bound);
        assert_near(&place.name, &values(&silu_reference(leaf)), &expected, bound);
    }
}
