//! The terms of the refinement by hand.

use gs_models::sparsedyn::refinement::{masked_depth, opacity_sparsity, outline_misfit};
use gs_tests::devices::everywhere;
use gs_tests::tolerance::values;

#[test]
fn terms_are_means_over_what_counts() {
    for place in everywhere() {
        let opacities = place.tensor(&[0.25, 0.75, 0.5, 0.1], [4]);
        assert!((values(&opacity_sparsity(opacities))[0] - 0.4).abs() < 1e-6);
        let rendered = place.leaf(&[1.0, 2.0, 3.0, 9.0], [2, 2, 1]);
        let prior = place.tensor(&[2.0, 2.5, 3.0, 0.0], [2, 2, 1]).autodiff();
        let weights = place.tensor(&[1.0, 0.5, 1.0, 0.0], [2, 2, 1]).autodiff();
        let loss = masked_depth(rendered.clone(), prior, weights);
        // (1 + 0.25) / 2.5.
        assert!((values(&loss.clone().inner())[0] - 0.5).abs() < 1e-6, "{}", place.name);
        let gradients = loss.backward();
        let gradient = values(&rendered.grad(&gradients).expect("tracked"));
        let expected = [-0.4, -0.2, 0.0, 0.0];
        assert!(gradient.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{}: {gradient:?}", place.name);
    }
}

#[test]
fn an_outline_counts_what_lacks_inside_and_what_stands_outside() {
    for place in everywhere() {
        let alpha = place.leaf(&[0.75, 0.25, 0.5, 1.0], [2, 2, 1]);
        let loss = outline_misfit(alpha.clone(), place.tensor(&[1.0, -1.0, 0.0, 1.0], [2, 2, 1]).autodiff());
        // A quarter lacks inside, a quarter stands outside, one pixel takes no side, one is right.
        assert!((values(&loss.clone().inner())[0] - 0.5 / 4.0).abs() < 1e-6, "{}", place.name);
        let gradient = values(&alpha.grad(&loss.backward()).expect("tracked"));
        let expected = [-0.25, 0.25, 0.0, -0.25];
        assert!(gradient.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{}: {gradient:?}", place.name);
    }
}
