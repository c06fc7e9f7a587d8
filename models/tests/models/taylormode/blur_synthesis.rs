//! Eq. 12 on a plane that moves at constant velocity, whose blur is known, and the decoupled gradient.

use std::f64::consts::PI;

use burn::module::Param;
use burn::tensor::Tensor;
use gs_base::Intrinsics;
use gs_models::Pixels;
use gs_models::light::{Mixing, to_encoded};
use gs_models::taylormode::blur_path::blur_path;
use gs_models::taylormode::{Exposure, PhotoShutter, Samples, blurred_color, decoupled};
use gs_tests::devices::{Place, doubles, everywhere, reference};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

const WIDTH: usize = 160;
/// Pixels of one wave of the plane's texture.
const WAVE: f64 = 64.0;
const AMPLITUDE: f64 = 0.4;

fn wave(x: f64, amplitude: f64) -> f64 {
    0.5 + amplitude * (2.0 * PI * x / WAVE).sin()
}

/// The middle row of a plane with a sinusoidal texture, encoded or linear, that slides `pixels` to the right during the
/// exposure: the synthetic blur, and each sample's x.
fn slide(place: &Place, pixels: f64, samples: Samples, count: usize, mixing: Mixing) -> (Vec<f64>, Vec<f64>) {
    let (depth, focal, tau) = (3.0, 90.0, 0.03);
    let encoded = |x: f64| {
        let linear = place.tensor(&[wave(x, AMPLITUDE)], [1]);
        if mixing == Mixing::Linear { values(&to_encoded(linear))[0] } else { wave(x, AMPLITUDE) }
    };
    let row: Vec<f64> = (0..WIDTH).flat_map(|i| [encoded(i as f64 + 0.5); 3]).collect();
    let image = place.tensor(&row, [1, WIDTH, 3]);
    let camera = Intrinsics { fx: focal, fy: focal, cx: 80.0, cy: 0.5 };
    let mask: Vec<u8> = (0..WIDTH).map(|i| u8::from((40..120).contains(&i))).collect();
    let chosen = Pixels::masked(&mask, WIDTH, 1, &place.device).expect("pixels are set");
    let speed = pixels * depth / focal / tau;
    let velocity: Vec<f64> = [speed, 0.0, 0.0].repeat(80);
    let exposure = Exposure { log_tau: Param::from_tensor(place.tensor(&[f64::ln(tau)], [1])) };
    let path = blur_path(
        &chosen,
        place.tensor(&[depth; 80], [80, 1]),
        place.tensor(&velocity, [80, 3]),
        &camera,
        exposure.offsets(samples, count, PhotoShutter { exposure: 0, share: 1.0 }),
    );
    let blurred = values(&blurred_color(image, path, None, mixing));
    (blurred.into_iter().step_by(3).collect(), (40..120).map(|i| f64::from(i) + 0.5).collect())
}

/// A sliding sinusoid averaged over a box stays one, its amplitude times `sinc`.
#[test]
fn a_sliding_plane_blurs_as_the_integral_says() {
    for place in doubles() {
        for mixing in [Mixing::Encoded, Mixing::Linear] {
            let (found, xs) = slide(place, 24.0, Samples::Middles, 33, mixing);
            let half_angle = PI * 24.0 / WAVE;
            let amplitude = AMPLITUDE * half_angle.sin() / half_angle;
            let expected: Vec<f64> = xs.iter().map(|x| wave(*x, amplitude)).collect();
            let expected = match mixing {
                Mixing::Encoded => expected,
                Mixing::Linear => values(&to_encoded(place.tensor(&expected, [80]))),
            };
            // Bilinear interpolation flattens the wave by (2 pi / 64)^2 / 8 of 0.4, 33 middles are off by
            // (pi 24 / 64 / 33)^2 / 6 of it; encoding stretches dark differences by up to 2.
            assert_near(&format!("{} {mixing:?}", place.name), &found, &expected, 1.5e-3);
        }
    }
}

/// Seven samples a whole pixel apart need no interpolation: the sum is exact.
#[test]
fn whole_pixels_are_exact() {
    for place in doubles() {
        let (found, xs) = slide(place, 6.0, Samples::Ends, 7, Mixing::Encoded);
        let mean = |x: &f64| (-3..=3).map(|i| wave(x + f64::from(i), AMPLITUDE)).sum::<f64>() / 7.0;
        assert_near(&place.name, &found, &xs.iter().map(mean).collect::<Vec<_>>(), 1e-12);
    }
}

#[test]
fn without_motion_the_image_stays() {
    for place in everywhere() {
        let mut random = Random::new(3);
        let numbers = random.values(5 * 4 * 3, 0.0, 1.0);
        let image = place.tensor(&numbers, [5, 4, 3]);
        let pixels = Pixels::all(4, 5, &place.device);
        let centres = pixels.centres.clone().cast(place.dtype).reshape([1, 20, 2]);
        let path = Tensor::cat(vec![centres; 3], 0);
        let weights = place.tensor(&[0.2, 0.5, 0.3].repeat(20), [20, 3]);
        for weights in [None, Some(weights)] {
            let blurred = values(&blurred_color(image.clone(), path.clone(), weights, Mixing::Linear));
            // Decoding and encoding in f32: 1e-6 of the value, and the knee's two sides differ by 3e-8.
            assert_near(&place.name, &blurred, &numbers, 2e-6);
        }
    }
}

#[test]
fn weights_choose_the_moment() {
    let place = reference();
    let image = place.tensor(&[0.0, 0.0, 0.0, 1.0, 1.0, 1.0], [1, 2, 3]);
    let path = place.tensor(&[0.5, 0.5, 1.5, 0.5], [2, 1, 2]);
    let weights = place.tensor(&[0.25, 0.75], [1, 2]);
    let blurred = values(&blurred_color(image.clone(), path.clone(), Some(weights), Mixing::Encoded));
    assert_near("encoded", &blurred, &[0.75; 3], 1e-15);
    let linear = values(&blurred_color(image, path, None, Mixing::Linear));
    assert_near("linear", &linear, &[0.735_356_98; 3], 1e-7);
}

#[test]
fn the_background_gets_no_gradient() {
    for place in everywhere() {
        let numbers = Random::new(4).values(12, 0.0, 1.0);
        let color = place.leaf(&numbers, [2, 2, 3]);
        let moving = place.tensor(&[1.0, 0.0, 0.0, 1.0], [2, 2, 1]);
        let result = decoupled(color.clone(), moving);
        assert_eq!(values(&result), numbers, "{}: the colour changed", place.name);
        let gradients = result.sum().backward();
        let gradient = values(&color.grad(&gradients).expect("tracked"));
        assert_eq!(gradient, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0], "{}", place.name);
    }
}
