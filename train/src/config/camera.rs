//! `[camera]`: the path of each photo's camera while its shutter is open, and corrections of its pose.

use gs_models::camera_path::DEGREES;

use super::ranges::POSITIVE;
use super::{ConfigError, check};
use crate::section;

section! {
    /// Options of the learned poses. Held-out photos keep their given pose.
    pub struct CameraConfig {
        /// Degree of the path of a photo's camera during its exposure: 0 stands still, 1 is a straight line, 2 bends.
        motion: usize = 0, in 0..=DEGREES;
        /// Whether the mean pose of each photo is corrected; with a path it always is.
        refine: bool = false;
        /// Time from the first row's exposure to the last row's, in exposures (rolling shutter); 0: all rows at once.
        readout: f64 = 0.0, in 0.0..=READOUT_MAX;
        /// Whether that time is learned, one for all photos; it needs a path.
        learn_readout: bool = false;
        /// Learning rate at the first step, falling to a tenth: pixels by which a visit of a photo may move its image.
        lr: f64 = 0.4, in POSITIVE;
    }
    also check_readout;
}

/// Longest time from the first row's exposure to the last row's, in exposures: each row is in one part of the frame
/// long before.
pub const READOUT_MAX: f64 = 49.0;

fn check_readout(config: &CameraConfig) -> Result<(), ConfigError> {
    let (moves, readout, learn) = (config.motion > 0, config.readout, config.learn_readout);
    check("camera.readout", readout, moves || readout == 0.0, "0 without camera.motion")?;
    check("camera.learn_readout", learn, moves || !learn, "false without camera.motion")
}
