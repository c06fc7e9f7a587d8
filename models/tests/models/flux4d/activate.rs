//! Activations: values at the ends of the range, and derivatives.

use burn::tensor::Tensor;
use gs_burn::Gaussians;
use gs_models::flux4d::activate::softplus;
use gs_models::flux4d::{ScaleLimits, activate, activate_within};
use gs_tests::devices::{everywhere, reference};
use gs_tests::finite_differences::assert_derivatives;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_finite, assert_near, values};

/// A number that depends on all of the Gaussians.
fn mixture(gaussians: &Gaussians) -> Tensor<1> {
    let sum = |tensor: Tensor<2>| (tensor.clone() * 1.3).sin().sum() + tensor.square().sum() * 0.1;
    let [rows, ..] = gaussians.sh.dims();
    sum(gaussians.means.val())
        + sum(gaussians.quats.val())
        + sum(gaussians.log_scales.val())
        + sum(gaussians.opacities().reshape([rows, 1]))
        + sum(gaussians.sh.val().reshape([rows, 3]))
}

#[test]
fn gradients_are_differences() {
    let place = reference();
    let mut raw = Random::new(1).values(8 * 14, -2.0, 2.0);
    // Scales inside the clamps on both sides, so that no difference crosses one.
    raw.chunks_mut(14).take(5).for_each(|row| row[7..10].iter_mut().for_each(|s| *s = s.abs().mul_add(-2.0, 0.3)));
    let limits = ScaleLimits { near: 1.0, sky: 30.0, sky_rows: 3 };
    assert_derivatives("activation", place, [("raw", &raw)], 112, |[raw]| {
        mixture(&activate_within(raw.reshape([8, 14]), &limits))
    });
}

#[test]
fn scales_are_clamped_and_extremes_stay_finite() {
    for place in everywhere() {
        let raw: Vec<f64> = [-1e4, -50.0, 0.0, 0.5, 50.0, 1e4].iter().flat_map(|x| [*x; 14]).collect();
        let gaussians = activate(place.tensor(&raw, [6, 14]));
        for tensor in [values(&gaussians.quats.val()), values(&gaussians.log_scales.val()), values(&gaussians.sh.val())]
        {
            assert_finite(&place.name, &tensor);
        }
        let scales: Vec<f64> = values(&gaussians.scales()).chunks(3).map(|row| row[0]).collect();
        // Logarithm and exponential in `f32`: 1e-6 of the value.
        assert_near(
            &place.name,
            &scales,
            &[1e-3, 1e-3, 2.0_f64.ln(), 1.5_f64.exp().ln_1p().min(0.5_f64.exp().ln_1p()), 1.0, 1.0],
            2e-6,
        );
    }
}

#[test]
fn softplus_has_a_slope_at_zero() {
    let place = reference();
    let leaf = place.leaf(&[0.0, -30.0, 800.0], [3]);
    let gradients = softplus(leaf.clone()).sum().backward();
    let gradient = values(&leaf.grad(&gradients).expect("a gradient"));
    assert_near("softplus", &gradient, &[0.5, (-30.0_f64).exp(), 1.0], 1e-12);
}
