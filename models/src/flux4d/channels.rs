//! The 14 raw channels of a Gaussian (A.2), as the network reads and corrects them: before any activation.

use std::ops::Range;

/// Channels of a Gaussian.
pub const CHANNELS: usize = 14;
/// Position, world, metres.
pub const POSITION: Range<usize> = 0..3;
/// Quaternion, w x y z, any norm.
pub const QUATERNION: Range<usize> = 3..7;
/// Scales before softplus and clamp.
pub const SCALE: Range<usize> = 7..10;
/// Opacity before the sigmoid.
pub const OPACITY: Range<usize> = 10..11;
/// Colour before the sigmoid.
pub const COLOR: Range<usize> = 11..14;
/// The paper's clamp of scales, metres.
pub const SCALE_MAX: f64 = 1.0;
/// Smallest scale, metres. Coincident points have none, and the logarithm needs one; a LiDAR is twenty times less
/// exact.
pub const SCALE_MIN: f64 = 1e-3;
