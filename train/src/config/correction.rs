//! `[correction]`: exposure and white balance of the photos.

use super::ranges::{NOT_NEGATIVE, POSITIVE};
use crate::{choice, section};

choice! {
    /// What is learned of the exposure and white balance of photos.
    pub enum CorrectionMode {
        /// `gain` where photos disagree about the colours of points that they share, else `none`.
        Auto,
        /// Nothing: all photos show a surface in the same colours.
        None,
        /// A gain of each channel.
        Gain,
        /// A gain of each channel, a mix of the channels and an offset.
        Affine,
    }
}

choice! {
    /// What has a correction of its own.
    pub enum CorrectionPer {
        /// A camera where its photos agree with each other, else a photo.
        Auto,
        /// Each photo.
        Photo,
        /// Each camera of a set with named or static cameras.
        Camera,
    }
}

section! {
    /// Options of the learned exposure and white balance, by which a rendering is compared with a photo. Held-out
    /// photos are compared with the mean of their camera's photos, or of all; a second PSNR fits colours to each.
    pub struct CorrectionConfig {
        /// What is learned.
        mode: CorrectionMode = CorrectionMode::Auto;
        /// What has a correction of its own.
        per: CorrectionPer = CorrectionPer::Auto;
        /// Learning rate at the first step, falling to a tenth; natural logarithms of gains, shares of white. Larger:
        /// corrections follow single photos' errors.
        gain_lr: f64 = 5e-3, in POSITIVE;
        /// Weight of the mean square of all corrections.
        weight: f64 = 0.01, in NOT_NEGATIVE;
    }
}
