//! Range images to points.
//!
//! Row v and column u of an image with W columns look along
//!
//! ```text
//! azimuth = (2 (W - u - 0.5) / W - 1) pi - atan2(E[1][0], E[0][0])      E: laser to vehicle
//! p       = E range (cos azimuth cos inclination, sin azimuth cos inclination, sin inclination)
//! ```
//!
//! p is in the vehicle's axes: at the pose of the pixel for the TOP laser, which turns while the vehicle drives, and at
//! the pose of the frame for the others, whose points the data set has moved there.

use std::f64::consts::PI;

use glam::{DMat4, DVec3};

use super::calibration::LaserCalibration;
use super::parts::{FramePart, RangeImage, Scan, TOP};
use crate::sweep::{RANGE_MAX, Sweep};

/// One turn of the TOP laser, seconds. Its first column is of the time stamp of the frame, the others follow evenly.
/// The data set has no times of points: this is its description of the time stamp, and that the lasers turn ten times a
/// second.
const TURN: f64 = 0.1;

/// Seconds of a time stamp.
pub(crate) fn seconds(microseconds: i64) -> f64 {
    microseconds as f64 * 1e-6
}

/// Fewest channels of a range image, and channels of an image of poses.
const CHANNELS: usize = 4;
const POSE_CHANNELS: usize = 6;

/// Points of a sweep, and which of them lie in a zone without labels.
#[derive(Default)]
pub(crate) struct Points {
    pub sweep: Sweep,
    pub unlabelled: Vec<bool>,
}

impl Points {
    /// Appends the points of one return of a laser, in the world with `origin` subtracted.
    ///
    /// # Errors
    /// A piece of a sentence: what is found where a range image of the laser is expected.
    pub fn add(
        &mut self,
        scan: &Scan,
        laser: &LaserCalibration,
        frame: &FramePart,
        origin: DVec3,
    ) -> Result<(), String> {
        let image = &scan.image;
        if image.channels < CHANNELS {
            return Err(format!("{} channels", image.channels));
        }
        let poses = scan.poses()?;
        let angles = laser.rows(image.rows)?;
        let turned = laser.extrinsic.x_axis.y.atan2(laser.extrinsic.x_axis.x);
        let width = image.columns as f64;
        let columns: Vec<(f64, f64)> = (0..image.columns)
            .map(|u| ((2.0 * (width - u as f64 - 0.5) / width - 1.0) * PI - turned).sin_cos())
            .collect();
        let start = seconds(frame.stamp);
        for (row, angle) in angles.iter().enumerate() {
            let (rise, level) = angle.sin_cos();
            for (column, (sin, cos)) in columns.iter().enumerate() {
                let pixel = image.pixel(row, column);
                let range = f64::from(pixel[0]);
                // Pixels without a return have a range of -1 or 0.
                if range <= 0.0 {
                    continue;
                }
                let local = laser.extrinsic.transform_point3(range * DVec3::new(cos * level, sin * level, rise));
                let pose = poses.map_or(frame.pose, |poses| pose(poses.pixel(row, column)));
                let world = pose.transform_point3(local);
                let away = world.distance(frame.pose.w_axis.truncate());
                if away.is_nan() || away > RANGE_MAX {
                    self.sweep.left_out += 1;
                    continue;
                }
                let part = if poses.is_some() { (column as f64 + 0.5) / width } else { 0.5 };
                self.sweep.points.push((world - origin).as_vec3().to_array());
                self.sweep.times.push(start + part * TURN);
                self.sweep.intensity.push(pixel[1]);
                self.sweep.sensor.push((scan.laser - TOP) as u8);
                self.unlabelled.push(pixel[3] > 0.0);
            }
        }
        Ok(())
    }
}

impl Scan {
    /// The poses of the pixels of the TOP laser; none of another.
    fn poses(&self) -> Result<Option<&RangeImage>, String> {
        if self.laser != TOP {
            return Ok(None);
        }
        let size = |image: &RangeImage| (image.rows, image.columns);
        match &self.pose {
            Some(poses) if poses.channels == POSE_CHANNELS && size(poses) == size(&self.image) => Ok(Some(poses)),
            Some(poses) => Err(format!("poses of {} x {} pixels", poses.rows, poses.columns)),
            None => Err("no poses of the pixels, without which points are off by the motion in a turn".to_string()),
        }
    }
}

/// The pose of a pixel: Rz(yaw) Ry(pitch) Rx(roll) and a position.
fn pose(pixel: &[f32]) -> DMat4 {
    let at = |channel: usize| f64::from(pixel[channel]);
    let turn = DMat4::from_rotation_z(at(2)) * DMat4::from_rotation_y(at(1)) * DMat4::from_rotation_x(at(0));
    DMat4::from_translation(DVec3::new(at(3), at(4), at(5))) * turn
}
