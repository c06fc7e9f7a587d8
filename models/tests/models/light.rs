//! The transfer curve on tensors.

use gs_models::light::{Mixing, to_encoded, to_linear};
use gs_tests::devices::everywhere;
use gs_tests::tolerance::{assert_finite, assert_near, values};

#[test]
fn known_values_and_back() {
    for place in everywhere() {
        let encoded = [0.0, 0.02, 0.04045, 0.0405, 0.25, 0.5, 0.735_356_98, 1.0];
        let linear = [0.0, 0.001_547_988, 0.003_130_805, 0.003_134_62, 0.050_876_09, 0.214_041_14, 0.5, 1.0];
        let tensor = place.tensor(&encoded, [8]);
        assert_near(&place.name, &values(&to_linear(tensor.clone())), &linear, 1e-6);
        let back = values(&to_encoded(to_linear(tensor)));
        // The standard rounds the knee: its two sides differ by 3e-8.
        assert_near(&place.name, &back, &encoded, 1e-6);
    }
}

#[test]
fn gradients_are_finite_from_below_black_to_above_white() {
    for place in everywhere() {
        let colors = [-0.5, 0.0, 1e-6, 0.003, 0.04, 1.0, 3.0];
        for decode in [true, false] {
            let leaf = place.leaf(&colors, [7]);
            let result = if decode { to_linear(leaf.clone()) } else { to_encoded(leaf.clone()) };
            assert_finite(&place.name, &values(&result));
            let gradient = values(&leaf.grad(&result.sum().backward()).expect("tracked"));
            assert_finite(&place.name, &gradient);
            let black = if decode { 1.0 / 12.92 } else { 12.92 };
            assert_near(&place.name, &gradient[..3], &[black; 3], 1e-5);
            assert!(gradient.iter().all(|g| *g > 0.0), "{}: the curve must rise", place.name);
        }
        let tensor = place.tensor(&[0.3], [1]);
        assert_eq!(values(&Mixing::Encoded.encode(Mixing::Encoded.decode(tensor.clone()))), values(&tensor));
    }
}
