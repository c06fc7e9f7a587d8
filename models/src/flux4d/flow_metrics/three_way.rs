//! Three-way EPE: resting background (BS), resting foreground (FS), moving foreground (FD), and their mean.
//!
//! Flux4D's printed EPE-3way is not the mean of its printed columns; a mean of frames that leave a missing group out is
//! not either. Both are given: over all points, and frame by frame.

use serde::Serialize;

use super::points::{FlowClass, FlowFrame, end_point_error, norm};
use crate::flux4d::error::FluxError;

/// A point moves from this true flow on, metres per frame (0.5 m/s; AV2).
pub const DYNAMIC: f64 = 0.05;

/// Groups of points, in the order of the columns.
const GROUPS: usize = 3;

/// Sums by group.
#[derive(Debug, Clone, Default)]
pub struct ThreeWay {
    sums: [f64; GROUPS],
    counts: [usize; GROUPS],
    /// Sum of each group's frame means, and the frames that have the group.
    frame_sums: [f64; GROUPS],
    frame_counts: [usize; GROUPS],
    frame_means: f64,
    frames: usize,
    left_out: usize,
}

/// EPE by group, metres per frame; `None` for a group without points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Columns {
    /// Resting background.
    pub bs: Option<f64>,
    /// Resting foreground.
    pub fs: Option<f64>,
    /// Moving foreground.
    pub fd: Option<f64>,
    /// Mean of the groups that have points.
    pub mean: Option<f64>,
}

/// The result in both ways of averaging.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ThreeWayReport {
    /// Over all points; `mean` is the mean of the columns.
    pub points: Columns,
    /// Means of frames; `mean` is the mean over frames of the mean of the groups that a frame has.
    pub frames: Columns,
    /// Points of resting background, resting foreground and moving foreground.
    pub counts: [usize; GROUPS],
    /// Moving background, in no group.
    pub left_out: usize,
}

impl ThreeWay {
    /// Adds a frame.
    ///
    /// # Errors
    /// When lengths differ or a flow is not finite; nothing is added then.
    pub fn add(&mut self, frame: &FlowFrame) -> Result<(), FluxError> {
        let (mut sums, mut counts) = ([0.0; GROUPS], [0; GROUPS]);
        for (predicted, truth, class) in frame.points()? {
            let moves = norm(truth) >= DYNAMIC;
            let group = match (class, moves) {
                (FlowClass::Background, false) => 0,
                (FlowClass::Background, true) => {
                    self.left_out += 1;
                    continue;
                }
                (_, false) => 1,
                (_, true) => 2,
            };
            sums[group] += end_point_error(predicted, truth);
            counts[group] += 1;
        }
        let means = columns(sums, counts);
        for group in 0..GROUPS {
            self.sums[group] += sums[group];
            self.counts[group] += counts[group];
            if let Some(mean) = means[group] {
                self.frame_sums[group] += mean;
                self.frame_counts[group] += 1;
            }
        }
        if let Some(mean) = mean(means) {
            self.frame_means += mean;
            self.frames += 1;
        }
        Ok(())
    }

    /// The means.
    pub fn finish(&self) -> ThreeWayReport {
        let points = columns(self.sums, self.counts);
        let frames = columns(self.frame_sums, self.frame_counts);
        let over_frames = (self.frames > 0).then(|| self.frame_means / self.frames as f64);
        let named = |[bs, fs, fd]: [Option<f64>; GROUPS], mean| Columns { bs, fs, fd, mean };
        ThreeWayReport {
            points: named(points, mean(points)),
            frames: named(frames, over_frames),
            counts: self.counts,
            left_out: self.left_out,
        }
    }
}

fn columns(sums: [f64; GROUPS], counts: [usize; GROUPS]) -> [Option<f64>; GROUPS] {
    [0, 1, 2].map(|group| (counts[group] > 0).then(|| sums[group] / counts[group] as f64))
}

/// The mean of the groups that there are.
fn mean(columns: [Option<f64>; GROUPS]) -> Option<f64> {
    let known: Vec<f64> = columns.into_iter().flatten().collect();
    (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
}
