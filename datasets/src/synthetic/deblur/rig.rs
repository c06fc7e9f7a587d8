//! Static cameras on an arc in front of the stage or all around it, all looking at one point.

use std::f64::consts::TAU;

use glam::{DMat4, DVec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::super::shapes::Ray;

/// Horizontal angle of view, radians.
pub(super) const ANGLE_X: f64 = 0.85;

/// The point that the cameras look at, and their distance from it, metres.
const TARGET: DVec3 = DVec3::new(0.0, 0.0, 0.62);
const DISTANCE: f64 = 3.7;

/// The arc around the target, radians; the outermost cameras stand at half of it on either side.
const ARC: f64 = 1.4;

/// How cameras stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rig {
    pub cameras: usize,
    pub held_out: usize,
    /// All around instead of on the arc.
    pub ring: bool,
    /// Size of each image, pixels.
    pub width: usize,
    pub height: usize,
}

/// Height above the floor's plane as seen from the target, radians: every second camera stands higher by the step.
const ELEVATION: f64 = 0.30;
const ELEVATION_STEP: f64 = 0.12;

/// Cameras are out of line by up to this much, radians: nobody hangs them exactly.
const JITTER: f64 = 0.02;

/// One camera.
#[derive(Debug, Clone)]
pub(super) struct Camera {
    /// "cam00" and on: those that train first, in the arc's order.
    pub id: String,
    pub is_test: bool,
    /// Camera to world, OpenGL axes (x right, y up, z back).
    pub c2w: DMat4,
    /// Pixels.
    pub focal: f64,
    pub width: usize,
    pub height: usize,
}

impl Camera {
    /// The ray through a position in the image, pixels from the top left corner.
    pub fn ray(&self, u: f64, v: f64) -> Ray {
        let local = DVec3::new(u - 0.5 * self.width as f64, 0.5 * self.height as f64 - v, -self.focal);
        Ray { origin: self.c2w.w_axis.truncate(), direction: self.c2w.transform_vector3(local).normalize() }
    }

    /// Camera z of what a ray of this camera meets at `t`; 0 where it meets nothing.
    pub fn depth(&self, ray: &Ray, t: f64) -> f64 {
        if t.is_finite() { -t * ray.direction.dot(self.c2w.z_axis.truncate()) } else { 0.0 }
    }

    /// The image position of a world position, pixels, and its camera z, metres.
    #[cfg(test)]
    pub fn project(&self, position: DVec3) -> (f64, f64, f64) {
        let p = self.c2w.inverse().transform_point3(position);
        let scale = self.focal / -p.z;
        (0.5 * self.width as f64 + scale * p.x, 0.5 * self.height as f64 - scale * p.y, -p.z)
    }
}

/// Cameras at even steps; the held-out ones stand between training cameras, evenly spread.
pub(super) fn cameras(rig: &Rig, rng: &mut ChaCha8Rng) -> Vec<Camera> {
    let Rig { cameras: count, held_out, ring, width, height } = *rig;
    let held: Vec<usize> = (1..=held_out).map(|i| (i * count + held_out / 2) / (held_out + 1)).collect();
    let focal = 0.5 * width as f64 / (0.5 * ANGLE_X).tan();
    let mut cameras = Vec::with_capacity(count);
    for index in 0..count {
        let around = match count {
            _ if ring => TAU * index as f64 / count as f64,
            1 => 0.0,
            _ => ARC * (index as f64 / (count - 1) as f64 - 0.5),
        };
        let azimuth = around + rng.random_range(-JITTER..JITTER);
        let elevation = ELEVATION + ELEVATION_STEP * (index % 2) as f64 + rng.random_range(-JITTER..JITTER);
        let (sin, cos) = elevation.sin_cos();
        let back = DVec3::new(cos * azimuth.sin(), -cos * azimuth.cos(), sin);
        let right = DVec3::Z.cross(back).normalize();
        let up = back.cross(right);
        let eye = TARGET + DISTANCE * back;
        cameras.push(Camera {
            id: String::new(),
            is_test: held.contains(&index),
            c2w: DMat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), eye.extend(1.0)),
            focal,
            width,
            height,
        });
    }
    // A stable sort: training cameras keep the arc's order and come first.
    cameras.sort_by_key(|camera| camera.is_test);
    for (index, camera) in cameras.iter_mut().enumerate() {
        camera.id = format!("cam{index:02}");
    }
    cameras
}
