//! Hand shake: the path of a camera while its shutter is open.

use std::f64::consts::TAU;

use glam::{DMat4, DQuat, DVec3};
use rand_chacha::ChaCha8Rng;

use crate::random::gaussian;
use crate::tracer::camera::Camera;

/// Share of the shake that each axis turns by: about x and y the image shifts, about z (the view's axis) it turns.
const TURNS: DVec3 = DVec3::new(0.35, 0.35, 0.3);

/// Share of the shake that each axis of the camera is shifted by, at the distance that it looks at.
const SHIFTS: DVec3 = DVec3::new(0.15, 0.15, 0.1);

/// Size of the terms of degrees 1 to 3: hands move smoothly, and turn back.
const TERMS: [f64; 3] = [1.0, 0.4, 0.2];

/// A camera at `count` even instants of an exposure; halfway it is `camera`. The image of what is `distance` metres
/// away moves by about `pixels` meanwhile.
pub(super) fn path(camera: &Camera, (pixels, distance): (f64, f64), count: usize, rng: &mut ChaCha8Rng) -> Vec<Camera> {
    let mut draw = |sizes: DVec3| TERMS.map(|term| term * sizes * DVec3::from_array([(); 3].map(|()| gaussian(rng))));
    let angle = pixels / camera.focal;
    let (turns, shifts) = (draw(TURNS * angle), draw(SHIFTS * angle * distance));
    let at = |u: f64| {
        let sum = |terms: &[DVec3; 3]| terms[0] * u + terms[1] * u * u + terms[2] * (0.25 * TAU * u).sin() * u * u;
        DMat4::from_rotation_translation(DQuat::from_scaled_axis(sum(&turns)), sum(&shifts))
    };
    let instant = |k: usize| (2 * k + 1) as f64 / count as f64 - 1.0;
    (0..count).map(|k| Camera { c2w: camera.c2w * at(instant(k)), ..camera.clone() }).collect()
}
