//! Points to start from, in a PLY file.

use std::fmt::Write;

use glam::DVec3;
use gs_datasets::light::to_byte;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::random::gaussian;
use crate::tracer::camera::Camera;
use crate::tracer::scene::{Lit, Scene};

/// Standard deviation of the positions of matched points, metres.
const NOISE: f64 = 0.01;

/// Share of points that were matched wrongly and lie at another depth, and the spread of those depths' logarithm.
const OUTLIERS: f64 = 0.01;
const OUTLIER_SPREAD: f64 = 0.15;

/// Share of points on moving bodies that are kept: features match badly where the image is blurred.
const ON_MOVERS: f64 = 0.3;

/// Draws before giving up, per point. Almost every ray meets something.
const DRAWS: usize = 10;

/// Points with encoded colours.
#[derive(Debug, Default)]
pub(crate) struct Points(Vec<(DVec3, [u8; 3])>);

impl Points {
    /// Points as structure from motion leaves them: at most `count` on what training cameras see at time `t`, noisy,
    /// with outliers, few on moving bodies.
    pub fn matched(scene: &Scene, cameras: &[Camera], count: usize, t: f64, rng: &mut ChaCha8Rng) -> Self {
        let cameras: Vec<&Camera> = cameras.iter().filter(|camera| !camera.is_test).collect();
        let bodies = scene.placed(t);
        let mut points = Vec::new();
        for _ in 0..DRAWS * count {
            if points.len() == count {
                break;
            }
            let camera = cameras[rng.random_range(0..cameras.len())];
            let (u, v) = (rng.random_range(0.0..camera.width as f64), rng.random_range(0.0..camera.height as f64));
            let ray = camera.ray(u, v);
            let still = scene.still(&ray, Lit::ALL);
            let sample = scene.sample(&ray, &still, &bodies);
            let mut distance = sample.body.map_or(still.t, |(_, t)| t);
            if !distance.is_finite() || (sample.body.is_some() && !rng.random_bool(ON_MOVERS)) {
                continue;
            }
            if rng.random_bool(OUTLIERS) {
                distance *= (OUTLIER_SPREAD * gaussian(rng)).exp();
            }
            let position = ray.at(distance) + NOISE * DVec3::new(gaussian(rng), gaussian(rng), gaussian(rng));
            points.push((position, sample.color.as_vec3().to_array().map(to_byte)));
        }
        Self(points)
    }

    /// The pixels of one view whose depth is known. `depth` is `[height, width]` camera z, 0 where unknown; `colors`
    /// are `[height, width, 3]`, encoded. A depth prior has a scale and a shift of its own in each view, so a surface
    /// that several views see lies there several times, as in the unions that feed-forward reconstructors write.
    pub fn of_view(camera: &Camera, depth: &[f32], colors: &[u8]) -> Self {
        let known = depth.iter().zip(colors.chunks_exact(3)).enumerate().filter(|(_, (z, _))| **z > 0.0);
        let point = |(index, (z, color)): (usize, (&f32, &[u8]))| {
            let ray = camera.ray((index % camera.width) as f64 + 0.5, (index / camera.width) as f64 + 0.5);
            (ray.at(f64::from(*z) / camera.depth(&ray, 1.0)), [color[0], color[1], color[2]])
        };
        Self(known.map(point).collect())
    }

    /// All points of several lists.
    pub fn union(lists: impl IntoIterator<Item = Self>) -> Self {
        Self(lists.into_iter().flat_map(|list| list.0).collect())
    }

    fn header(&self, format: &str) -> String {
        format!(
            "ply\nformat {format} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
             property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
            self.0.len()
        )
    }

    /// The bytes of a file of text, to a hundredth of a millimetre.
    pub fn ascii(&self) -> Vec<u8> {
        let mut text = self.header("ascii");
        for (p, [r, g, b]) in &self.0 {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{:.5} {:.5} {:.5} {r} {g} {b}", p.x, p.y, p.z);
        }
        text.into_bytes()
    }

    /// The bytes of a binary file.
    pub fn binary(&self) -> Vec<u8> {
        let mut bytes = self.header("binary_little_endian").into_bytes();
        for (position, color) in &self.0 {
            bytes.extend(position.as_vec3().to_array().into_iter().flat_map(f32::to_le_bytes));
            bytes.extend(color);
        }
        bytes
    }
}
