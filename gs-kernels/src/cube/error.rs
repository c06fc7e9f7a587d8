//! What can go wrong before a kernel is launched.

use crate::cube::buffer::MAX_BYTES;

/// A request the device cannot carry.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CubeError {
    /// A buffer would exceed what every graphics API binds in one piece.
    #[error("{what} needs {bytes} bytes on the device, and one buffer holds at most {MAX_BYTES}")]
    BufferTooLarge {
        /// What the buffer holds.
        what: &'static str,
        /// Bytes asked for.
        bytes: u64,
    },
    /// More pairs of tile and Gaussian than a signed 32-bit offset counts.
    #[error("more than 2^31 pairs of tile and Gaussian: use fewer or smaller Gaussians, or a smaller image")]
    TooManyIntersections,
    /// An image side beyond what tile coordinates are computed for.
    #[error("image of {width}x{height} pixels is beyond 2^20 a side")]
    ImageTooLarge {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
    /// The device failed while a result was read back.
    #[error("the device failed: {0}")]
    Device(String),
}
