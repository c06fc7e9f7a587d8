//! Pinhole cameras that look at a point: the ray of an image position, and the depth along it.

use glam::{DMat4, DVec3};
use serde_json::{Value, json};

use super::shape::Ray;

/// One camera.
#[derive(Debug, Clone)]
pub(crate) struct Camera {
    /// "cam00" and on: training cameras first, in the order of the rig.
    pub id: String,
    pub is_test: bool,
    /// Camera to world, OpenGL axes (x right, y up, z back).
    pub c2w: DMat4,
    /// Horizontal angle of view, radians.
    pub angle_x: f64,
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

    /// Camera z of the point that a ray of this camera meets at `t`; 0 where it meets nothing.
    pub fn depth(&self, ray: &Ray, t: f64) -> f64 {
        if t.is_finite() { -t * ray.direction.dot(self.c2w.z_axis.truncate()) } else { 0.0 }
    }

    /// The rows of the pose, as transforms.json stores it.
    pub fn rows(&self) -> [[f64; 4]; 4] {
        [0, 1, 2, 3].map(|row| self.c2w.row(row).to_array())
    }

    /// The keys of transforms.json for the lens.
    pub fn intrinsics(&self) -> Value {
        json!({
            "camera_angle_x": self.angle_x,
            "fl_x": self.focal,
            "fl_y": self.focal,
            "cx": 0.5 * self.width as f64,
            "cy": 0.5 * self.height as f64,
            "w": self.width,
            "h": self.height,
        })
    }

    /// The image position of a world position, pixels, and its camera z, metres.
    #[cfg(test)]
    pub fn project(&self, position: DVec3) -> (f64, f64, f64) {
        let p = self.c2w.inverse().transform_point3(position);
        let scale = self.focal / -p.z;
        (0.5 * self.width as f64 + scale * p.x, 0.5 * self.height as f64 - scale * p.y, -p.z)
    }
}

/// Level cameras with one lens around a point that all look at.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rig {
    /// Metres.
    pub target: DVec3,
    /// Distance from the target, metres.
    pub distance: f64,
    /// Horizontal angle of view, radians.
    pub angle_x: f64,
    /// Size of the images, pixels.
    pub width: usize,
    pub height: usize,
}

impl Rig {
    /// Cameras at azimuths and elevations (radians, as seen from the target; azimuth 0 looks along +y). The `held_out`
    /// ones stand between training cameras, evenly spread, as long as they are at most half of the rest.
    pub fn cameras(&self, held_out: usize, directions: &[(f64, f64)]) -> Vec<Camera> {
        let held: Vec<usize> = (1..=held_out).map(|i| (i * directions.len() + held_out / 2) / (held_out + 1)).collect();
        let camera = |(index, (azimuth, elevation)): (usize, &(f64, f64))| {
            let (sin, cos) = elevation.sin_cos();
            let back = DVec3::new(cos * azimuth.sin(), -cos * azimuth.cos(), sin);
            Camera {
                id: String::new(),
                is_test: held.contains(&index),
                c2w: looking_at(self.target + self.distance * back, back),
                angle_x: self.angle_x,
                focal: 0.5 * self.width as f64 / (0.5 * self.angle_x).tan(),
                width: self.width,
                height: self.height,
            }
        };
        let mut cameras: Vec<Camera> = directions.iter().enumerate().map(camera).collect();
        // A stable sort: training cameras keep their order and come first.
        cameras.sort_by_key(|camera| camera.is_test);
        for (index, camera) in cameras.iter_mut().enumerate() {
            camera.id = format!("cam{index:02}");
        }
        cameras
    }
}

/// Camera to world (OpenGL axes) of a level camera at `eye`; `back` (length 1) points away from the target and is not
/// upright.
fn looking_at(eye: DVec3, back: DVec3) -> DMat4 {
    let right = DVec3::Z.cross(back).normalize();
    let up = back.cross(right);
    DMat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), eye.extend(1.0))
}
