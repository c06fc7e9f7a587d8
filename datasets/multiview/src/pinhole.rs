//! Camera of a view: projection of positions to pixels and back, in f64.

use glam::{DMat3, DMat4, DVec2, DVec3};
use gs_base::Intrinsics;

use gs_datasets::View;

/// Smallest depth that is projected, scene units. It keeps the division finite.
const NEAR: f64 = 1e-9;

/// A pinhole camera (OpenCV axes).
#[derive(Debug, Clone, Copy)]
pub struct Pinhole {
    /// World to camera rotation.
    rotation: DMat3,
    /// The camera's position in the world.
    pub centre: DVec3,
    /// Focal lengths and centre, pixels.
    pub intrinsics: Intrinsics,
    /// Image width, pixels.
    pub width: usize,
    /// Image height, pixels.
    pub height: usize,
}

impl Pinhole {
    /// The camera of a view.
    pub fn new(view: &View) -> Self {
        Self::posed(view.c2w, view.intrinsics, view.width, view.height)
    }

    /// A camera by its pose (camera to world), intrinsics and image size.
    pub fn posed(c2w: DMat4, intrinsics: Intrinsics, width: usize, height: usize) -> Self {
        let rotation = DMat3::from_mat4(c2w).transpose();
        Self { rotation, centre: c2w.w_axis.truncate(), intrinsics, width, height }
    }

    /// Pixel coordinates and depth (camera z) of a position; `None` behind the camera or when not finite.
    pub fn project(&self, position: DVec3) -> Option<(DVec2, f64)> {
        let p = self.rotation * (position - self.centre);
        let pixel = self.intrinsics.project(p);
        (p.z > NEAR && pixel.is_finite()).then_some((pixel, p.z))
    }

    /// Unit direction, in the world, of the ray through a pixel coordinate.
    pub fn direction(&self, pixel: DVec2) -> DVec3 {
        (self.rotation.transpose() * self.intrinsics.ray(pixel.x, pixel.y)).normalize_or_zero()
    }

    /// Rows of the derivative of the pixel by the position, `[du/dX, dv/dX]`; `None` behind the camera.
    pub fn jacobian(&self, position: DVec3) -> Option<[DVec3; 2]> {
        let p = self.rotation * (position - self.centre);
        if p.z.is_nan() || p.z <= NEAR {
            return None;
        }
        let k = &self.intrinsics;
        let inverse = self.rotation.transpose();
        let du = inverse * DVec3::new(k.fx / p.z, 0.0, -k.fx * p.x / (p.z * p.z));
        let dv = inverse * DVec3::new(0.0, k.fy / p.z, -k.fy * p.y / (p.z * p.z));
        Some([du, dv])
    }

    /// The larger focal length, pixels.
    pub fn focal(&self) -> f64 {
        self.intrinsics.fx.max(self.intrinsics.fy)
    }

    /// The pixel (column, row) that holds a coordinate; `None` outside the image.
    pub fn pixel(&self, at: DVec2) -> Option<(usize, usize)> {
        let inside = at.x >= 0.0 && at.y >= 0.0 && at.x < self.width as f64 && at.y < self.height as f64;
        inside.then_some((at.x as usize, at.y as usize))
    }

    /// Index of the pixel that shows a position, row by row from the top left, and the depth of the position; `None`
    /// outside the image.
    pub fn sees(&self, position: DVec3) -> Option<(usize, f64)> {
        let (at, depth) = self.project(position)?;
        let (x, y) = self.pixel(at)?;
        Some((y * self.width + x, depth))
    }
}
