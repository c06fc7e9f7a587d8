//! Cameras and lasers as they are calibrated.

use glam::DMat4;
use gs_base::Intrinsics;
use gs_datasets::{Distortion, Undistortion, downscaled_size};

use crate::description::Camera;

/// Longest side of an image, pixels.
const SIDE_MAX: i64 = 65_535;

/// Columns are x, y and z of OpenCV's camera axes (right, down, forward) in those of Waymo (forward, left, up).
pub(crate) const OPENCV: DMat4 = DMat4::from_cols_array(&[
    0.0, -1.0, 0.0, 0.0, //
    0.0, 0.0, -1.0, 0.0, //
    1.0, 0.0, 0.0, 0.0, //
    0.0, 0.0, 0.0, 1.0,
]);

/// A camera.
#[derive(Debug)]
pub(crate) struct CameraCalibration {
    /// `[fu, fv, cu, cv, k1, k2, p1, p2, k3]`.
    pub intrinsic: [f64; 9],
    /// Camera (x forward, y left, z up) to vehicle.
    pub extrinsic: DMat4,
    /// Width and height, pixels.
    pub size: (i64, i64),
}

/// A laser.
#[derive(Debug)]
pub(crate) struct LaserCalibration {
    /// Laser to vehicle.
    pub extrinsic: DMat4,
    /// Angles of the rows above the horizon, radians, ascending; empty where they are spaced evenly.
    pub inclinations: Vec<f64>,
    /// The lowest and the highest angle where they are spaced evenly.
    pub bounds: Option<(f64, f64)>,
}

impl CameraCalibration {
    /// The camera as images are decoded, and how their distortion is removed; no undistortion where there is none.
    ///
    /// # Errors
    /// A piece of a sentence: what is found.
    pub fn camera(&self, name: &str, max_width: Option<usize>) -> Result<(Camera, Option<Undistortion>), String> {
        let [fx, fy, cx, cy, k1, k2, p1, p2, k3] = self.intrinsic;
        let size = (1..=SIDE_MAX).contains(&self.size.0) && (1..=SIDE_MAX).contains(&self.size.1);
        let is_focal = |focal: f64| focal > 0.0 && focal.is_finite();
        if !(size && is_focal(fx) && is_focal(fy) && cx.is_finite() && cy.is_finite()) {
            return Err(format!("focal lengths {fx} and {fy} and the size {} x {}", self.size.0, self.size.1));
        }
        let full = (self.size.0 as usize, self.size.1 as usize);
        let mut intrinsics = Intrinsics { fx, fy, cx, cy };
        let distortion = Distortion { k: [k1, k2, k3, 0.0], p: [p1, p2], ..Distortion::default() };
        let mut undistortion = None;
        if distortion != Distortion::default() {
            let (undo, ideal) = Undistortion::filling(distortion, intrinsics, full)
                .ok_or_else(|| format!("the lens distortion {:?}", &self.intrinsic[4..]))?;
            (undistortion, intrinsics) = (Some(undo), ideal);
        }
        let (width, height) = downscaled_size(full, max_width);
        let intrinsics = intrinsics.scaled(width as f64 / full.0 as f64, height as f64 / full.1 as f64);
        Ok((Camera { name: name.to_string(), width, height, intrinsics, ego_rows: 0 }, undistortion))
    }
}

impl LaserCalibration {
    /// The angle of each row of a range image, radians, the top row first.
    ///
    /// # Errors
    /// A piece of a sentence: what is found.
    pub fn rows(&self, rows: usize) -> Result<Vec<f64>, String> {
        let angles: Vec<f64> = match (self.bounds, self.inclinations.is_empty()) {
            (_, false) => self.inclinations.iter().rev().copied().collect(),
            (Some((low, high)), true) => {
                (0..rows).rev().map(|k| low + (k as f64 + 0.5) / rows as f64 * (high - low)).collect()
            }
            (None, true) => Vec::new(),
        };
        if angles.len() != rows || !angles.iter().all(|angle| angle.is_finite()) {
            return Err(format!("{} angles of beams for {rows} rows", angles.len()));
        }
        Ok(angles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_top_row_has_the_largest_angle() {
        let even = LaserCalibration { extrinsic: DMat4::IDENTITY, inclinations: vec![], bounds: Some((-1.0, 1.0)) };
        assert_eq!(even.rows(4), Ok(vec![0.75, 0.25, -0.25, -0.75]));
        let given = LaserCalibration { inclinations: vec![-0.3, -0.1, 0.2], bounds: None, ..even };
        assert_eq!(given.rows(3), Ok(vec![0.2, -0.1, -0.3]));
        assert!(given.rows(4).is_err());
    }

    #[test]
    fn camera_axes() {
        let forward = OPENCV.transform_vector3(glam::DVec3::Z);
        let (right, down) = (OPENCV.transform_vector3(glam::DVec3::X), OPENCV.transform_vector3(glam::DVec3::Y));
        assert_eq!(
            [forward.to_array(), right.to_array(), down.to_array()],
            [[1., 0., 0.], [0., -1., 0.], [0., 0., -1.]]
        );
    }
}
