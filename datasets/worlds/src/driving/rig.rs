//! The sensors on the ego vehicle. Vehicle axes are those of PandaSet's `lidar/poses.json`: x to the right, y ahead, z
//! up.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DMat4, DVec3};
use gs_base::Intrinsics;

use super::options::StreetOptions;
use super::street::Street;

/// One turn of the LiDAR, seconds; also the time between frames.
pub(super) const TURN: f64 = 0.1;

/// The LiDARs in vehicle axes, metres: above and ahead of the pose, as measured on PandaSet.
const LIDARS: [DVec3; 2] = [DVec3::new(0.0, 0.8, 1.85), DVec3::new(0.0, 1.41, 1.55)];

/// Angle of view of a camera from left to right, radians.
const ANGLE_X: f64 = 1.25;

/// Cameras stand on a circle of this radius around the first LiDAR, seen from above, and this far below it, metres.
const CAMERA_RADIUS: f64 = 0.6;
const CAMERA_BELOW: f64 = 0.2;

/// Directions of the cameras in PandaSet's order, degrees to the left of ahead.
const CAMERA_YAWS: [f64; 6] = [0.0, 55.0, -55.0, 110.0, -110.0, 180.0];

/// Lowest and highest beam, radians.
const BEAMS: (f64, f64) = (-0.42, 0.2);

/// Seconds of the first sweep's end on the log's clock. Clocks of real logs count from 1970, which is beyond what f32
/// can tell apart.
const CLOCK: f64 = 1_700_000_000.0;

/// The rig on a street.
pub(super) struct Rig<'s> {
    pub street: &'s Street,
    pub options: StreetOptions,
}

impl Rig<'_> {
    /// Street seconds of the end of the sweep of a frame.
    pub fn sweep_end(&self, frame: usize) -> f64 {
        TURN * frame as f64
    }

    /// Seconds on the clock of the log.
    pub fn clock(&self, time: f64) -> f64 {
        CLOCK + time
    }

    /// Street axes to world: the ego vehicle is at the origin of the world when the first sweep ends.
    pub fn world(&self) -> DMat4 {
        let start = self.street.ego.at(self.sweep_end(0)).position.extend(0.0);
        DMat4::from_rotation_z(self.street.heading) * DMat4::from_translation(-start)
    }

    /// Vehicle axes to street.
    pub fn ego(&self, time: f64) -> DMat4 {
        let stand = self.street.ego.at(time);
        DMat4::from_translation(stand.position.extend(0.0)) * DMat4::from_rotation_z(stand.yaw - FRAC_PI_2)
    }

    /// Street seconds of the image of a camera: cameras fire when the LiDAR looks their way. It turns clockwise and
    /// begins behind.
    pub fn image_time(&self, frame: usize, camera: usize) -> f64 {
        let turned = (PI - CAMERA_YAWS[camera].to_radians()).rem_euclid(TAU);
        // The back camera fires at the end of the turn.
        let share = if turned == 0.0 { 1.0 } else { turned / TAU };
        self.sweep_end(frame) - TURN * (1.0 - share)
    }

    /// Camera to street, OpenCV axes.
    pub fn camera(&self, time: f64, camera: usize) -> DMat4 {
        let yaw = CAMERA_YAWS[camera].to_radians();
        let forward = DVec3::new(-yaw.sin(), yaw.cos(), 0.0);
        let right = DVec3::new(forward.y, -forward.x, 0.0);
        let place = LIDARS[0] + CAMERA_RADIUS * forward - CAMERA_BELOW * DVec3::Z;
        let columns = [right, -DVec3::Z, forward].map(|axis| axis.extend(0.0));
        self.ego(time) * DMat4::from_cols(columns[0], columns[1], columns[2], place.extend(1.0))
    }

    /// Intrinsics of all cameras.
    pub fn intrinsics(&self) -> Intrinsics {
        let (width, height) = (self.options.width as f64, self.options.height as f64);
        let focal = 0.5 * width / (0.5 * ANGLE_X).tan();
        Intrinsics { fx: focal, fy: focal, cx: 0.5 * width, cy: 0.5 * height }
    }

    /// Street seconds, position and azimuth of a LiDAR when it looks into a column of a turn. The second one is half a
    /// turn ahead of the first.
    pub fn beam_column(&self, (frame, lidar): (usize, usize), column: usize) -> (f64, DVec3, f64) {
        let share = (column as f64 + 0.5) / self.options.columns as f64;
        let time = self.sweep_end(frame) - TURN * (1.0 - share);
        let ego = self.ego(time);
        let azimuth = self.street.ego.at(time).yaw + PI - TAU * (share + 0.5 * lidar as f64);
        (time, ego.transform_point3(LIDARS[lidar]), azimuth)
    }

    /// Angles of the beams above the horizon, radians, the highest first.
    pub fn beam_angles(&self) -> Vec<f64> {
        let count = self.options.beams;
        let step = (BEAMS.1 - BEAMS.0) / (count.max(2) - 1) as f64;
        (0..count).map(|i| if count == 1 { -0.05 } else { BEAMS.1 - step * i as f64 }).collect()
    }
}
