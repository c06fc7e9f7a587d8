//! The walk over tiles around [`crate::cpu::blend`].
//!
//! A tile is 16 x 16 pixels and one task. Per Gaussian of the tile's list a closed form finds the blocks of 4 x 4
//! pixels it can reach; each such block is one vector. A block whose pixels have all ended is never visited again, and
//! the tile stops when no block is left.

mod backward;
mod forward;
mod gather;
mod tile;

pub use backward::backward;
pub use forward::{forward, forward_saving};
pub use gather::RasterizeGradients;
