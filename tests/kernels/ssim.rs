//! `gs_burn::ops::ssim`.

use burn::tensor::Tensor;
use gs_burn::ops::ssim::{l1_ssim, l1_ssim_reference, photometric_loss};
use gs_kernels::constants::{SSIM_C1, SSIM_C2, SSIM_SIGMA, SSIM_WINDOW};
use gs_tests::devices::{doubles, everywhere, reference, singles};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{FORWARD_F32, FORWARD_F64, assert_near, assert_near_scaled, values};

/// Height, width, channels: single pixels, lines, less than a window, areas, more channels than colours.
const SHAPES: [[usize; 3]; 9] =
    [[1, 1, 1], [1, 1, 3], [1, 30, 3], [30, 1, 3], [5, 7, 2], [16, 16, 3], [37, 53, 3], [130, 21, 5], [141, 178, 3]];

#[test]
fn equal_images_are_alike() {
    for place in everywhere() {
        for shape in SHAPES {
            let image = place.tensor(&Random::new(1).values(shape.iter().product(), 0.0, 1.0), shape);
            let terms = values(&l1_ssim(image.clone(), image));
            assert_near(&format!("{shape:?} on {}", place.name), &terms, &[0.0, 1.0], FORWARD_F32);
        }
    }
}

/// The window's weights as far as they lie inside `size` pixels, summed, for each pixel.
fn weight_inside(size: usize) -> Vec<f64> {
    let reach = (SSIM_WINDOW / 2) as i64;
    let weight = |d: i64| (-(d * d) as f64 / (2.0 * SSIM_SIGMA * SSIM_SIGMA)).exp();
    let all: f64 = (-reach..=reach).map(weight).sum();
    let inside = |at: i64| (-reach..=reach).filter(|d| (0..size as i64).contains(&(at + d))).map(weight).sum::<f64>();
    (0..size as i64).map(|at| inside(at) / all).collect()
}

/// Of two constant images `a` and `b` a window of weight `w` sees means `w a`, `w b`, variances `w (1 - w) a^2`,
/// `w (1 - w) b^2` and covariance `w (1 - w) a b`.
#[test]
fn constant_images_in_closed_form() {
    let (a, b) = (0.75, 0.25);
    for [height, width, channels] in SHAPES {
        let (rows, columns) = (weight_inside(height), weight_inside(width));
        let ssim = rows.iter().flat_map(|y| columns.iter().map(move |x| x * y)).map(|w| {
            let spread = w * (1.0 - w);
            (2.0 * w * w * a * b + SSIM_C1) / (w * w * (a * a + b * b) + SSIM_C1) * (2.0 * spread * a * b + SSIM_C2)
                / (spread * (a * a + b * b) + SSIM_C2)
        });
        let mean = ssim.sum::<f64>() / (width * height) as f64;
        for place in everywhere() {
            let [one, other] =
                [a, b].map(|x| place.tensor(&vec![x; height * width * channels], [height, width, channels]));
            let terms = values(&l1_ssim(one, other));
            let case = format!("{height}x{width}x{channels} on {}", place.name);
            assert_near(&case, &terms, &[0.5, mean], FORWARD_F32);
        }
    }
}

#[test]
fn loss_is_the_mixture() {
    for place in everywhere() {
        let [image, target] =
            [2, 3].map(|seed| place.tensor(&Random::new(seed).values(20 * 30 * 3, 0.0, 1.0), [20, 30, 3]));
        let terms = values(&l1_ssim(image.clone(), target.clone()));
        for lambda in [0.0, 0.2, 1.0] {
            let loss = values(&photometric_loss(image.clone(), target.clone(), lambda));
            let expected = (1.0 - lambda) * terms[0] + lambda * (1.0 - terms[1]);
            assert_near(&place.name, &loss, &[expected], if place.is_double() { 1e-14 } else { FORWARD_F32 });
        }
    }
}

#[test]
fn every_device_follows_the_reference() {
    for shape in SHAPES {
        let noise = Random::new(4).values(shape.iter().product(), 0.0, 1.0);
        let other: Vec<f64> = noise.iter().map(|x| f64::from((0.2 + 0.7 * x * x) as f32)).collect();
        let both = |place: &gs_tests::devices::Place, op: fn(Tensor<3>, Tensor<3>) -> Tensor<1>| {
            values(&op(place.tensor(&noise, shape), place.tensor(&other, shape)))
        };
        let expected = both(reference(), l1_ssim_reference);
        for place in doubles() {
            assert_near_scaled(&format!("{shape:?} on {}", place.name), &both(place, l1_ssim), &expected, FORWARD_F64);
        }
        for place in singles() {
            assert_near(&format!("{shape:?} on {}", place.name), &both(place, l1_ssim), &expected, FORWARD_F32);
        }
    }
}
