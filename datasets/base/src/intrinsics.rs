//! Focal lengths and principal point of a pinhole camera.

use glam::{DVec2, DVec3};

/// Pinhole intrinsics in pixels; the centre of the top left pixel is at (0.5, 0.5).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point x, pixels from the left edge; half the width when centred.
    pub cx: f64,
    /// Principal point y, pixels from the top edge; half the height when centred.
    pub cy: f64,
}

impl Intrinsics {
    /// The intrinsics of the same photo resized by `x` horizontally and `y` vertically (new size over old size).
    /// Exact, because pixel coordinates are measured from the image's corner and not from the first pixel's centre.
    pub fn scaled(&self, x: f64, y: f64) -> Self {
        Self { fx: self.fx * x, fy: self.fy * y, cx: self.cx * x, cy: self.cy * y }
    }

    /// Pixel coordinates of a point in camera axes. They have a meaning only for points before the camera.
    pub fn project(&self, point: DVec3) -> DVec2 {
        DVec2::new(self.fx * point.x / point.z + self.cx, self.fy * point.y / point.z + self.cy)
    }

    /// The point at depth 1 that a pixel coordinate shows, camera axes. The first pixel's centre is at (0.5, 0.5).
    pub fn ray(&self, x: f64, y: f64) -> DVec3 {
        DVec3::new((x - self.cx) / self.fx, (y - self.cy) / self.fy, 1.0)
    }
}
