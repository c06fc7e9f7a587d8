//! `gs_burn::ops::opacity`.

use gs_burn::ops::opacity::opacities;
use gs_tests::devices::everywhere;
use gs_tests::tolerance::{FORWARD_F32, FORWARD_F64, assert_near, values};

const LOGITS: [f64; 12] = [f64::NAN, -200.0, -90.0, -20.0, -3.0, -0.5, 0.0, 0.5, 3.0, 20.0, 200.0, f64::NEG_INFINITY];

#[test]
fn opacities_and_slopes_are_the_formula_and_never_broken() {
    for place in everywhere() {
        let bound = if place.is_double() { FORWARD_F64 } else { FORWARD_F32 };
        let leaf = place.leaf(&LOGITS, [12]);
        let found = opacities(leaf.clone());
        let expected = LOGITS.map(|x| if x.is_nan() { 0.0 } else { 1.0 / (1.0 + (-x).exp()) });
        assert_near(&place.name, &values(&found), &expected, bound);
        let gradients = found.sum().backward();
        let slopes = LOGITS.map(|x| {
            let e = (-x.abs()).exp();
            if x.is_nan() { 0.0 } else { e / (1.0 + e).powi(2) }
        });
        assert_near(&place.name, &values(&leaf.grad(&gradients).expect("tracked")), &slopes, bound);
    }
}
