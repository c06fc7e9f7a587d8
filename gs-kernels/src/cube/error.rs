//! What can go wrong before a kernel is launched.

use crate::cube::buffer::MAX_BYTES;
use crate::limits;

/// A request the device cannot carry.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CubeError {
    /// A buffer would exceed what every graphics API binds in one piece.
    #[error("{}", limits::buffer_too_large(what, *bytes, MAX_BYTES))]
    BufferTooLarge {
        /// What the buffer holds.
        what: &'static str,
        /// Bytes asked for.
        bytes: u64,
    },
    /// More pairs of tile and Gaussian than a signed 32-bit offset counts.
    #[error("{}", limits::too_many_pairs(None))]
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
