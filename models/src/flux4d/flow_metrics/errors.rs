//! Means over all points: EPE3D, accuracies, angles.
//!
//! | name | definition | used by |
//! |---|---|---|
//! | `acc5`, `acc10` | error below 5 cm, 10 cm, or below 5 %, 10 % of the true flow | all public code |
//! | `acc5_absolute`, `acc10_absolute` | error below 5 cm, 10 cm | the text of Flux4D |
//! | `angle_space_time` | angle of (flow, 0.1) and (truth, 0.1) | AV2 |
//! | `angle_plain` | angle of flow and truth; a right angle where one is zero | NSFP, FastNSF |
//! | `angle_moving` | the same over points whose true flow is above 0.1 m | STORM, and Flux4D, which follows it |

use serde::Serialize;

use super::points::{FlowFrame, end_point_error, norm};
use crate::flux4d::error::FluxError;

/// Bounds of Acc5 and Acc10, metres per frame, and shares of the true flow.
const ACCURACIES: [f64; 2] = [0.05, 0.10];
/// Added to the true flow before dividing by it, metres per frame (AV2).
const RELATIVE_FLOOR: f64 = 1e-10;
/// The time that AV2 joins to both flows, seconds.
const FRAME: f64 = 0.1;
/// Flow above which STORM takes the angle, metres per frame.
const MOVING: f64 = 0.1;

/// Sums over points.
#[derive(Debug, Clone, Default)]
pub struct PointErrors {
    count: usize,
    moving: usize,
    error: f64,
    relative: [usize; 2],
    absolute: [usize; 2],
    space_time: f64,
    plain: f64,
    angle_moving: f64,
}

/// Means over points; `None` without any.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Errors {
    /// Points.
    pub points: usize,
    /// Mean end-point error, metres per frame.
    pub epe3d: Option<f64>,
    /// Share of points, 0 to 1.
    pub acc5: Option<f64>,
    /// Share of points, 0 to 1.
    pub acc10: Option<f64>,
    /// Share of points, 0 to 1.
    pub acc5_absolute: Option<f64>,
    /// Share of points, 0 to 1.
    pub acc10_absolute: Option<f64>,
    /// Radians.
    pub angle_space_time: Option<f64>,
    /// Radians.
    pub angle_plain: Option<f64>,
    /// Radians.
    pub angle_moving: Option<f64>,
    /// Points of `angle_moving`.
    pub moving_points: usize,
}

impl PointErrors {
    /// Adds a frame.
    ///
    /// # Errors
    /// When lengths differ or a flow is not finite; nothing is added then.
    pub fn add(&mut self, frame: &FlowFrame) -> Result<(), FluxError> {
        for (predicted, truth, _) in frame.points()? {
            let error = end_point_error(predicted, truth);
            let speed = norm(truth);
            self.count += 1;
            self.error += error;
            for (i, bound) in ACCURACIES.into_iter().enumerate() {
                self.absolute[i] += usize::from(error < bound);
                self.relative[i] += usize::from(error < bound || error / (speed + RELATIVE_FLOOR) < bound);
            }
            let plain = angle(&predicted, &truth);
            let with_time = |[x, y, z]: [f64; 3]| [x, y, z, FRAME];
            self.plain += plain;
            self.space_time += angle(&with_time(predicted), &with_time(truth));
            if speed > MOVING {
                self.moving += 1;
                self.angle_moving += plain;
            }
        }
        Ok(())
    }

    /// The means.
    pub fn finish(&self) -> Errors {
        let mean = |sum: f64, count: usize| (count > 0).then(|| sum / count as f64);
        let share = |count: usize| mean(count as f64, self.count);
        Errors {
            points: self.count,
            epe3d: mean(self.error, self.count),
            acc5: share(self.relative[0]),
            acc10: share(self.relative[1]),
            acc5_absolute: share(self.absolute[0]),
            acc10_absolute: share(self.absolute[1]),
            angle_space_time: mean(self.space_time, self.count),
            angle_plain: mean(self.plain, self.count),
            angle_moving: mean(self.angle_moving, self.moving),
            moving_points: self.moving,
        }
    }
}

/// Radians; a right angle where one has no length.
fn angle(a: &[f64], b: &[f64]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let lengths = (dot(a, a) * dot(b, b)).sqrt();
    if lengths > 0.0 { (dot(a, b) / lengths).clamp(-1.0, 1.0).acos() } else { std::f64::consts::FRAC_PI_2 }
}
