//! Pinhole cameras: the ray of an image position, and the depth along it.

use glam::{DMat4, DVec3};

use super::super::shapes::Ray;

/// One camera.
#[derive(Debug, Clone)]
pub(crate) struct Camera {
    /// "cam00" and on: training cameras first, in the order of the rig.
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

/// Camera to world (OpenGL axes) of a level camera at `eye`; `back` (length 1) points away from the subject and is not upright.
pub(crate) fn looking_at(eye: DVec3, back: DVec3) -> DMat4 {
    let right = DVec3::Z.cross(back).normalize();
    let up = back.cross(right);
    DMat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), eye.extend(1.0))
}

/// The places of the `held_out` cameras in a row of `count`: evenly spread, each between two training cameras as long as
/// `held_out` is at most `(count - 1) / 2`.
pub(crate) fn held_out_places(count: usize, held_out: usize) -> Vec<usize> {
    (1..=held_out).map(|i| (i * count + held_out / 2) / (held_out + 1)).collect()
}

/// Sorts training cameras before held-out ones and names all of them.
pub(crate) fn name(cameras: &mut [Camera]) {
    // A stable sort: training cameras keep their order and come first.
    cameras.sort_by_key(|camera| camera.is_test);
    for (index, camera) in cameras.iter_mut().enumerate() {
        camera.id = format!("cam{index:02}");
    }
}
