//! `[correction]`: exposure and white balance of the photos.

use super::ranges::{NOT_NEGATIVE, POSITIVE};
use crate::{choice, section};

choice! {
    /// The model of a photo's exposure and white balance.
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
    /// The sources of photos that have a correction each.
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
    /// photos take the mean of their camera's nearest photos; a second PSNR fits colours to each.
    pub struct CorrectionConfig {
        /// The model that is learned.
        mode: CorrectionMode = CorrectionMode::Auto;
        /// The sources that have a correction each.
        per: CorrectionPer = CorrectionPer::Auto;
        /// Learning rate at the first step, falling to a tenth; natural logarithms of gains, shares of white. Larger:
        /// corrections follow single photos' errors.
        gain_lr: f64 = 5e-3, in POSITIVE;
        /// Weight of the mean square of all corrections.
        weight: f64 = 0.01, in NOT_NEGATIVE;
    }
}
