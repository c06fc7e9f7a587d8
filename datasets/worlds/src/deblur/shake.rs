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

/// The way of a camera through a frame.
pub(super) struct Shake<'a> {
    camera: &'a Camera,
    /// Rotation vectors of the terms, radians, camera axes.
    turns: [DVec3; 3],
    /// Metres.
    shifts: [DVec3; 3],
}

impl<'a> Shake<'a> {
    /// A way on which the image of what is `distance` metres away moves by about `pixels`.
    pub(super) fn draw(camera: &'a Camera, (pixels, distance): (f64, f64), rng: &mut ChaCha8Rng) -> Self {
        let mut draw =
            |sizes: DVec3| TERMS.map(|term| term * sizes * DVec3::from_array([(); 3].map(|()| gaussian(rng))));
        let angle = pixels / camera.focal;
        Self { camera, turns: draw(TURNS * angle), shifts: draw(SHIFTS * angle * distance) }
    }

    /// The camera at `u` from -1, where the frame begins, to 1; halfway it is the given one.
    pub(super) fn at(&self, u: f64) -> Camera {
        let sum = |terms: &[DVec3; 3]| terms[0] * u + terms[1] * u * u + terms[2] * (0.25 * TAU * u).sin() * u * u;
        let turn = DQuat::from_scaled_axis(sum(&self.turns));
        let c2w = self.camera.c2w * DMat4::from_rotation_translation(turn, sum(&self.shifts));
        Camera { c2w, ..self.camera.clone() }
    }
}
