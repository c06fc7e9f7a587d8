//! Errors before a kernel is launched.

use crate::limits;

/// A request beyond the device's limits.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CubeError {
    /// A buffer would exceed the size that the device can bind.
    #[error("{}", limits::buffer_too_large(what, *bytes, *most))]
    BufferTooLarge {
        /// Content of the buffer.
        what: &'static str,
        /// Bytes requested.
        bytes: u64,
        /// Most bytes of a buffer.
        most: u64,
    },
    /// More pairs of tile and Gaussian than a signed 32-bit offset counts.
    #[error("{}", limits::too_many_pairs(None))]
    TooManyIntersections,
    /// An image side beyond the range of tile coordinates.
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
