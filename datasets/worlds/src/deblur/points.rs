//! Points as structure from motion leaves them: on what training cameras see, noisy, with outliers, few on moving objects.

use std::fmt::Write;

use glam::DVec3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::super::random::gaussian;
use super::super::tracer::camera::Camera;
use super::super::tracer::stage::{Lit, Stage};
use gs_datasets::light::to_byte;

/// Standard deviation of the points' positions, metres.
const NOISE: f64 = 0.01;

/// Share of points that were matched wrongly and lie at another depth, and the spread of those depths' logarithm.
const OUTLIERS: f64 = 0.01;
const OUTLIER_SPREAD: f64 = 0.15;

/// Share of points on moving objects that are kept: features match badly on what is blurred.
const ON_MOVERS: f64 = 0.3;

/// Draws before giving up, per point. Almost every ray meets something.
const DRAWS: usize = 10;

/// An ascii PLY file of at most `count` points that training cameras see at time `t`.
pub(super) fn ply(stage: &Stage, cameras: &[Camera], count: usize, t: f64, rng: &mut ChaCha8Rng) -> String {
    let cameras: Vec<&Camera> = cameras.iter().filter(|camera| !camera.is_test).collect();
    let objects = stage.placed(t);
    let (mut lines, mut found) = (String::new(), 0);
    for _ in 0..DRAWS * count {
        if found == count {
            break;
        }
        let camera = cameras[rng.random_range(0..cameras.len())];
        let (u, v) = (rng.random_range(0.0..camera.width as f64), rng.random_range(0.0..camera.height as f64));
        let ray = camera.ray(u, v);
        let still = stage.still(&ray, Lit::ALL);
        let sample = stage.sample(&ray, &still, &objects);
        let mut distance = sample.object.map_or(still.t, |(_, t)| t);
        if !distance.is_finite() || (sample.object.is_some() && !rng.random_bool(ON_MOVERS)) {
            continue;
        }
        if rng.random_bool(OUTLIERS) {
            distance *= (OUTLIER_SPREAD * gaussian(rng)).exp();
        }
        let position = ray.at(distance) + NOISE * DVec3::new(gaussian(rng), gaussian(rng), gaussian(rng));
        let [r, g, b] = sample.color.as_vec3().to_array().map(to_byte);
        // Writing to a string cannot fail.
        let _ = writeln!(lines, "{:.5} {:.5} {:.5} {r} {g} {b}", position.x, position.y, position.z);
        found += 1;
    }
    let properties = "property float x\nproperty float y\nproperty float z\n\
                      property uchar red\nproperty uchar green\nproperty uchar blue\n";
    format!("ply\nformat ascii 1.0\nelement vertex {found}\n{properties}end_header\n{lines}")
}
