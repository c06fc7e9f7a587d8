//! The loss of a snippet: its gradient, and what the gradient must not depend on.

use burn::tensor::Tensor;
use gs_base::Intrinsics;
use gs_burn::Camera;
use gs_burn::glam::DMat4;
use gs_models::flux4d::losses::LossConfig;
use gs_models::flux4d::{PolynomialMotion, ScaleLimits, ShownMotion, SnippetFrame, TargetView};
use gs_tests::devices::{Place, reference};
use gs_tests::finite_differences::assert_derivatives;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

const ROWS: usize = 6;

fn frame(place: &Place) -> SnippetFrame {
    let motion = PolynomialMotion::new(1).expect("a degree");
    let times = place.tensor(&[0.0, 0.2, 0.4, 0.6, 0.8, 0.5], [ROWS]);
    // Rows 1 and 3 are known to move, row 4 to rest, the far row as well; rows 0 and 2 are the network's.
    let mut velocity = [0.0; 6 * ROWS];
    [1, 3].into_iter().for_each(|row| velocity[6 * row..6 * (row + 1)].fill(0.05));
    let shown = Some(ShownMotion {
        velocity: place.tensor(&velocity, [ROWS, 6]),
        is_known: place.tensor(&[0.0, 1.0, 0.0, 1.0, 1.0, 1.0], [ROWS, 1]),
        weights: place.tensor(&[0.0, 4.0, 0.0, 4.0, 1.0, 0.0], [ROWS, 1]),
    });
    SnippetFrame { times, far: 1, limits: ScaleLimits::default(), motion, shown, frame: 0.1 }
}

/// The motion that the sweeps show counts before the network, whose velocities are held to it and count elsewhere.
#[test]
fn the_sweeps_count_before_the_network_and_teach_it() {
    let place = reference();
    let (frame, velocity) = (frame(place), scene().1);
    let used = values(&frame.velocity(place.tensor(&velocity, [ROWS, 6])));
    for (row, (used, own)) in used.chunks(6).zip(velocity.chunks(6)).enumerate() {
        match row {
            0 | 2 => assert_eq!(used, own),
            1 | 3 => assert_eq!(used, [0.05; 6]),
            _ => assert_eq!(used, [0.0; 6]),
        }
    }
    // Of the terms of velocities alone, those of a network that says what the sweeps show and rests elsewhere are zero,
    // and each known row counts by its weight.
    let views = [view(place, 0.5, 1)];
    let (raw, photometric) =
        (place.tensor(&scene().0, [ROWS, 14]), LossConfig { velocity: 0.0, shown: 0.0, ..LossConfig::default() });
    let loss = |velocity: &[f64], config: &LossConfig| {
        values(&frame.loss(raw.clone(), place.tensor(velocity, [ROWS, 6]), &views, config))[0]
    };
    let with = LossConfig { velocity: 1.0, shown: 1.0, ..photometric };
    let mut said = used.clone();
    [0, 2].into_iter().for_each(|row| said[6 * row..6 * (row + 1)].fill(0.0));
    let terms = |velocity: &[f64]| loss(velocity, &with) - loss(velocity, &photometric);
    assert!(terms(&said).abs() < 1e-12, "{}", terms(&said));
    let mut one = said.clone();
    one[6 * 3] += 2.0;
    // Four of the weights' sum of nine, less the millimetre that makes the norm smooth.
    assert!((terms(&one) - 2.0 * 4.0 / 9.0).abs() < 1e-3, "{}", terms(&one));
    let mut free = said.clone();
    free[0] = 3.0;
    assert!((terms(&free) - 3.0 / 5.0).abs() < 1e-3, "the mean over five near rows: {}", terms(&free));
    // Around velocities that were found, all rows may change.
    let around = frame.around(place.tensor(&one, [ROWS, 6]));
    assert_eq!(values(&around.velocity(place.tensor(&velocity, [ROWS, 6]))), velocity);
}

/// Raw channels of wide Gaussians in front of the camera, and slow velocities.
fn scene() -> (Vec<f64>, Vec<f64>) {
    let mut random = Random::new(6);
    let mut raw = random.values(ROWS * 14, -1.0, 1.0);
    for row in raw.chunks_mut(14) {
        row[2] += 4.0;
        row[7..10].iter_mut().for_each(|s| *s = 0.2 * *s - 1.2);
    }
    (raw, random.values(ROWS * 6, -0.3, 0.3))
}

fn view(place: &Place, time: f64, scale: usize) -> TargetView {
    let [width, height] = [16 * scale, 12 * scale];
    let intrinsics = Intrinsics { fx: 14.0, fy: 14.0, cx: 8.0, cy: 6.0 };
    let by = scale as f64;
    let intrinsics =
        Intrinsics { fx: by * intrinsics.fx, fy: by * intrinsics.fy, cx: by * intrinsics.cx, cy: by * intrinsics.cy };
    let camera = Camera::from_c2w(DMat4::IDENTITY, intrinsics, width, height, &place.device);
    let full =
        |value: f64, channels: usize| Tensor::full([height, width, channels], value, (&place.device, place.dtype));
    // Below all colours and depths, so that no difference crosses a kink.
    TargetView { camera, time, photo: full(-0.5, 3), depth: Some(full(0.5, 1)) }
}

#[test]
fn gradients_are_differences() {
    let place = reference();
    let (raw, velocity) = scene();
    let config = LossConfig { reweight_clip: 0.0, depth: 0.1, velocity: 0.1, ..LossConfig::default() };
    let (frame, views) = (frame(place), [view(place, 0.3, 1), view(place, 1.2, 1)]);
    assert_derivatives("loss", place, [("raw", &raw), ("velocity", &velocity)], 40, |[raw, velocity]| {
        frame.loss(raw.reshape([ROWS, 14]), velocity.reshape([ROWS, 6]), &views, &config)
    });
}

fn gradient(place: &Place, views: &[TargetView], config: &LossConfig) -> Vec<f64> {
    let (raw, velocity) = scene();
    let leaf = place.leaf(&raw, [ROWS, 14]);
    let loss = frame(place).loss(leaf.clone(), place.tensor(&velocity, [ROWS, 6]), views, config);
    values(&leaf.grad(&loss.backward()).expect("a gradient"))
}

fn cosine_and_ratio(a: &[f64], b: &[f64]) -> (f64, f64) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    (dot(a, b) / (dot(a, a) * dot(b, b)).sqrt(), (dot(b, b) / dot(a, a)).sqrt())
}

/// Sampling 4 x as finely in both directions leaves integrals over the image as they are. What changes: the renderer's
/// own blur of 0.3 square pixels, a tenth of the variance of these Gaussians at the small size. A sum over pixels would
/// give 16.
#[test]
fn the_gradient_does_not_depend_on_the_size_of_the_image() {
    let place = reference();
    let config = LossConfig { dssim: 0.0, reweight_clip: 0.0, ..LossConfig::default() };
    let [small, large] = [2, 8].map(|scale| gradient(place, &[view(place, 0.5, scale)], &config));
    let (cosine, ratio) = cosine_and_ratio(&small, &large);
    assert!(cosine > 0.98 && (0.85..1.15).contains(&ratio), "cosine {cosine}, ratio {ratio}");
}

#[test]
fn twice_the_same_views_are_the_same_loss() {
    let place = reference();
    let views = [view(place, 0.5, 1), view(place, 0.9, 1)];
    let doubled = [views.clone(), views.clone()].concat();
    let config = LossConfig::default();
    let (once, twice) = (gradient(place, &views, &config), gradient(place, &doubled, &config));
    assert_near("gradient", &twice, &once, 1e-12);
}

/// The derivative by the velocity with weights is the one with the weights held: none of it goes through the weights.
#[test]
fn reweighting_scales_the_loss_and_passes_no_gradient() {
    let place = reference();
    let (raw, _) = scene();
    // The same velocity for all rows along x and no depth change: the image velocity is not zero.
    let velocity: Vec<f64> = (0..ROWS).flat_map(|_| [5.0, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
    let views = [view(place, 0.5, 1)];
    let with = |clip: f64| {
        let config = LossConfig { reweight_clip: clip, velocity: 0.0, depth: 0.0, ..LossConfig::default() };
        let leaf = place.leaf(&raw, [ROWS, 14]);
        let loss = frame(place).loss(leaf.clone(), place.tensor(&velocity, [ROWS, 6]), &views, &config);
        values(&loss)[0]
    };
    let (plain, clipped, full) = (with(0.0), with(0.1), with(10.0));
    assert!(full > clipped && clipped > plain, "{plain} {clipped} {full}");
    assert!(clipped <= 1.1 * plain, "no pixel counts more than 1 + clip: {clipped} of {plain}");
}
