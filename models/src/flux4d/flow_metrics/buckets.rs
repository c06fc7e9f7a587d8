//! Bucketed normalised EPE (Khatri et al. 2024, "I Can't Believe It's Not Scene Flow!").
//!
//! Points are sorted by class and true speed over all frames. The first bucket, below 0.04 m a frame, is static; its
//! error is the EPE in metres. A dynamic bucket's error is its EPE over its mean speed: 1 is the error of predicting no
//! motion. A class's dynamic error is the mean of its buckets that have points; the last line is the plain mean over
//! classes.

use serde::Serialize;

use super::points::{FlowClass, FlowFrame, end_point_error, norm};
use crate::flux4d::error::FluxError;

/// Width of a bucket, metres per frame.
const STEP: f64 = 0.04;
/// Buckets up to 2.0 m a frame, and one for all above.
const BUCKETS: usize = 51;
/// Classes.
const CLASSES: usize = FlowClass::ALL.len();

#[derive(Debug, Clone, Copy, Default)]
struct Bucket {
    count: usize,
    error: f64,
    speed: f64,
}

/// Sums by class and speed.
#[derive(Debug, Clone)]
pub struct Buckets(Vec<Bucket>);

/// The errors of a class.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClassError {
    /// The class.
    pub class: FlowClass,
    /// EPE of static points, metres per frame.
    pub static_epe: Option<f64>,
    /// Mean normalised EPE of the dynamic buckets.
    pub dynamic: Option<f64>,
    /// Static points.
    pub static_points: usize,
    /// Dynamic points.
    pub dynamic_points: usize,
}

/// The table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bucketed {
    /// One line a class, background first.
    pub classes: Vec<ClassError>,
    /// Mean over the classes that have static points, metres per frame.
    pub mean_static: Option<f64>,
    /// Mean over the classes that have dynamic points, background left out: what moves in it has no class.
    pub mean_dynamic: Option<f64>,
}

impl Default for Buckets {
    fn default() -> Self {
        Self(vec![Bucket::default(); CLASSES * BUCKETS])
    }
}

impl Buckets {
    /// Adds a frame.
    ///
    /// # Errors
    /// When lengths differ or a flow is not finite; nothing is added then.
    pub fn add(&mut self, frame: &FlowFrame) -> Result<(), FluxError> {
        for (predicted, truth, class) in frame.points()? {
            let speed = norm(truth);
            let place = FlowClass::ALL.iter().position(|known| *known == class).unwrap_or(0);
            let bucket = &mut self.0[place * BUCKETS + ((speed / STEP) as usize).min(BUCKETS - 1)];
            bucket.count += 1;
            bucket.error += end_point_error(predicted, truth);
            bucket.speed += speed;
        }
        Ok(())
    }

    /// The table.
    pub fn finish(&self) -> Bucketed {
        let class = |(class, buckets): (&FlowClass, &[Bucket])| {
            let (resting, moving) = (buckets[0], &buckets[1..]);
            let full = moving.iter().filter(|bucket| bucket.count > 0);
            ClassError {
                class: *class,
                static_epe: (resting.count > 0).then(|| resting.error / resting.count as f64),
                dynamic: mean(full.map(|bucket| bucket.error / bucket.speed)),
                static_points: resting.count,
                dynamic_points: moving.iter().map(|bucket| bucket.count).sum(),
            }
        };
        let classes: Vec<ClassError> = FlowClass::ALL.iter().zip(self.0.chunks_exact(BUCKETS)).map(class).collect();
        Bucketed {
            mean_static: mean(classes.iter().filter_map(|class| class.static_epe)),
            mean_dynamic: mean(classes.iter().skip(1).filter_map(|class| class.dynamic)),
            classes,
        }
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}
