//! A view's camera as a map between places and pixels, in f64.

use glam::{DMat3, DVec2, DVec3};

use crate::frame::{Intrinsics, View};

/// Least depth that is projected, scene units. It only keeps a division finite: what is nearer has no image.
const NEAR: f64 = 1e-9;

/// A pinhole camera (OpenCV axes) with its inverse pose at hand.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pinhole {
    /// World to camera rotation.
    rotation: DMat3,
    /// The camera's place in the world.
    pub centre: DVec3,
    pub intrinsics: Intrinsics,
    pub width: usize,
    pub height: usize,
}

impl Pinhole {
    pub fn new(view: &View) -> Self {
        Self {
            rotation: DMat3::from_mat4(view.c2w).transpose(),
            centre: view.c2w.w_axis.truncate(),
            intrinsics: view.intrinsics,
            width: view.width,
            height: view.height,
        }
    }

    /// Pixel coordinates and depth (camera z) of a place; `None` behind the camera or when not finite.
    pub fn project(&self, place: DVec3) -> Option<(DVec2, f64)> {
        let p = self.rotation * (place - self.centre);
        let k = &self.intrinsics;
        let pixel = DVec2::new(k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy);
        (p.z > NEAR && pixel.is_finite()).then_some((pixel, p.z))
    }

    /// The unit direction, in the world, of what is seen at a pixel coordinate.
    pub fn direction(&self, pixel: DVec2) -> DVec3 {
        (self.rotation.transpose() * self.intrinsics.ray(pixel.x, pixel.y)).normalize_or_zero()
    }

    /// Rows of the derivative of the pixel by the place, `[du/dX, dv/dX]`; `None` behind the camera.
    pub fn jacobian(&self, place: DVec3) -> Option<[DVec3; 2]> {
        let p = self.rotation * (place - self.centre);
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
}
