//! Eq. 7: where the samples lie, and the exposure learned through both blur models.

use burn::module::{Module, Param};
use burn::tensor::Tensor;
use gs_models::taylormode::{Exposure, Instants, PhotoShutter, Samples};
use gs_tests::devices::{doubles, everywhere, reference};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

use crate::{WINDOW, gaussians, paths};

#[test]
fn samples_lie_where_equation_7_says() {
    assert_eq!(Samples::Ends.offsets(5), [-0.5, -0.25, 0.0, 0.25, 0.5]);
    assert_eq!(Samples::Middles.offsets(4), [-0.375, -0.125, 0.125, 0.375]);
    for samples in [Samples::Ends, Samples::Middles] {
        assert_eq!(samples.offsets(1), [0.0]);
        assert_eq!(samples.offsets(0), [0.0; 0]);
    }
    for place in everywhere() {
        let exposure = Exposure::new(0.03, 1, &place.device);
        assert!((exposure.on_host()[0] - 0.03).abs() < 1e-8);
        assert_near(&place.name, &values(&exposure.offsets(Samples::Ends, 3, WHOLE)), &[-0.015, 0.0, 0.015], 1e-8);
        assert_near(&place.name, &values(&exposure.offsets(Samples::Ends, 3, PART)), &[-0.009, 0.0, 0.009], 1e-8);
    }
}

/// The spread of N equal samples against that of the light itself, `tau^2 / 12`.
#[test]
fn ends_spread_too_far() {
    let spread = |samples: Samples, n: usize| samples.offsets(n).iter().map(|x| x * x).sum::<f64>() / n as f64 * 12.0;
    assert!((spread(Samples::Ends, 7) - 8.0 / 6.0).abs() < 1e-12);
    assert!((spread(Samples::Middles, 7) - (1.0 - 1.0 / 49.0)).abs() < 1e-12);
}

/// The shutter of a photo, and of one that was open for less than the others.
const WHOLE: PhotoShutter = PhotoShutter { exposure: 0, share: 1.0 };
const PART: PhotoShutter = PhotoShutter { exposure: 0, share: 0.6 };

#[test]
fn an_instant_carries_the_gradient_by_the_exposure() {
    for place in doubles() {
        let mut random = Random::new(1);
        let still = gaussians(place, &mut random);
        let paths = paths(place, &mut random);
        let pull =
            [place.tensor(&random.values(9, -1.0, 1.0), [3, 3]), place.tensor(&random.values(12, -1.0, 1.0), [3, 4])];
        let sum = |instants: Instants| -> Tensor<1> {
            let count = instants.len();
            let seen = paths.samples(&still.means.val(), &still.quats.val(), &instants);
            let pull = pull.clone().map(|pull| pull.repeat_dim(0, count));
            (seen.means * pull[0].clone()).square().sum() + (seen.quats * pull[1].clone()).square().sum()
        };
        let log_tau = 0.2_f64.ln();
        let exposure = |log_tau: f64| Exposure { log_tau: Param::from_tensor(place.tensor(&[log_tau], [1])) };
        let tracked = exposure(log_tau).train();
        let instants = tracked.instants(WINDOW.t0 + 0.02, &Samples::Middles.offsets(4), PART);
        let plain: f64 =
            values(&sum(exposure(log_tau).instants(WINDOW.t0 + 0.02, &Samples::Middles.offsets(4), PART)))[0];
        let loss = sum(instants);
        assert_eq!(values(&loss)[0], plain, "{}: the shift changes values", place.name);
        let gradients = loss.backward();
        let gradient = values(&tracked.log_tau.grad(&gradients).expect("tracked"))[0];
        let at = |x: f64| values(&sum(exposure(x).instants(WINDOW.t0 + 0.02, &Samples::Middles.offsets(4), PART)))[0];
        let difference = (at(log_tau + 1e-5) - at(log_tau - 1e-5)) / 2e-5;
        assert!((gradient - difference).abs() < 1e-6 * difference.abs(), "{}: {gradient} {difference}", place.name);
    }
}

#[test]
fn offsets_are_differentiable() {
    let place = reference();
    let exposure = Exposure::new(0.5, 1, &place.device).train();
    let weights = Tensor::<1>::from_data([1.0, 0.0, 3.0], &place.device);
    let gradients = (exposure.offsets(Samples::Ends, 3, WHOLE) * weights).sum().backward();
    // d/d(ln tau) of -tau / 2 + 3 tau / 2.
    assert_near("log_tau", &values(&exposure.log_tau.grad(&gradients).expect("tracked")), &[0.5], 1e-6);
}

/// Each exposure gets the gradient of its own photos.
#[test]
fn cameras_learn_their_own_exposures() {
    let place = reference();
    let exposure = Exposure::new(0.5, 3, &place.device).train();
    let weights = Tensor::<1>::from_data([1.0, 0.0, 3.0], &place.device);
    let second = PhotoShutter { exposure: 1, ..WHOLE };
    let gradients = (exposure.offsets(Samples::Ends, 3, second) * weights).sum().backward();
    assert_near("log_tau", &values(&exposure.log_tau.grad(&gradients).expect("tracked")), &[0.0, 0.5, 0.0], 1e-6);
}
