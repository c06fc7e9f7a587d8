//! Static cameras on an arc in front of the stage or all around it, all looking at one point.

use std::f64::consts::TAU;

use glam::DVec3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::super::tracer::camera::{Camera, held_out_places, looking_at, name};

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

/// Cameras at even steps; the held-out ones stand between training cameras, evenly spread.
pub(super) fn cameras(rig: &Rig, rng: &mut ChaCha8Rng) -> Vec<Camera> {
    let Rig { cameras: count, held_out, ring, width, height } = *rig;
    let held = held_out_places(count, held_out);
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
        let eye = TARGET + DISTANCE * back;
        cameras.push(Camera {
            id: String::new(),
            is_test: held.contains(&index),
            c2w: looking_at(eye, back),
            focal,
            width,
            height,
        });
    }
    name(&mut cameras);
    cameras
}
