//! Static cameras all around: on a dome outside of objects, or under the ceiling of a room.

use std::f64::consts::TAU;

use glam::DVec3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::super::tracer::camera::{Camera, held_out_places, looking_at, name};
use super::ExtrapolationOptions;

/// Positions of the cameras of one kind of world.
struct Dome {
    /// The point that the cameras look at, metres.
    target: DVec3,
    /// Distance from the target, metres.
    distance: f64,
    /// Lowest and highest elevation as seen from the target, radians.
    elevations: (f64, f64),
    /// Horizontal angle of view, radians.
    angle_x: f64,
}

/// Elevations of 10 to 50 degrees. Half the image is 1.46 m wide at the target, which holds the objects.
const OBJECTS: Dome = Dome { target: DVec3::ZERO, distance: 4.0, elevations: (0.175, 0.87), angle_x: 0.7 };

/// Inside the walls, which are 3 m from the middle, and under the ceiling at 3 m.
const ROOM: Dome = Dome { target: DVec3::new(0.0, 0.0, 0.8), distance: 2.7, elevations: (0.17, 0.70), angle_x: 1.15 };

/// Share of the range of elevations from one camera to the next, modulo the range: the golden section spreads any number evenly.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// Cameras are out of line by up to this much, radians.
const JITTER: f64 = 0.02;

/// Horizontal angle of view, radians.
pub(super) fn angle_x(is_room: bool) -> f64 {
    if is_room { ROOM.angle_x } else { OBJECTS.angle_x }
}

/// Cameras at even steps of the azimuth; the held-out ones stand between training cameras, evenly spread.
pub(super) fn cameras(options: &ExtrapolationOptions, rng: &mut ChaCha8Rng) -> Vec<Camera> {
    let dome = if options.world.is_room() { ROOM } else { OBJECTS };
    let ExtrapolationOptions { width, height, cameras: count, held_out, .. } = *options;
    let held = held_out_places(count, held_out);
    let focal = 0.5 * width as f64 / (0.5 * dome.angle_x).tan();
    let (low, high) = dome.elevations;
    let mut cameras = Vec::with_capacity(count);
    for index in 0..count {
        let azimuth = TAU * index as f64 / count as f64 + rng.random_range(-JITTER..JITTER);
        let share = (0.5 + GOLDEN * index as f64).fract();
        let elevation = low + (high - low) * share + rng.random_range(-JITTER..JITTER);
        let (sin, cos) = elevation.sin_cos();
        let back = DVec3::new(cos * azimuth.sin(), -cos * azimuth.cos(), sin);
        cameras.push(Camera {
            id: String::new(),
            is_test: held.contains(&index),
            c2w: looking_at(dome.target + dome.distance * back, back),
            focal,
            width,
            height,
        });
    }
    name(&mut cameras);
    cameras
}
