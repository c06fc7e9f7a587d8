//! The sparse 3D UNet (Fig. A1), after TorchSparse's SparseResUNet42, with leaky ReLU.
//!
//! | file | content |
//! |---|---|
//! | `pyramid.rs` | points into voxels of several sizes, and the kernel maps between them |
//! | `conv.rs` | a sparse convolution with its weights, and with batch norm after it |
//! | `block.rs` | the residual block |
//! | `network.rs` | stem, encoder, decoder with skips, and the head for each point |
//!
//! The widths of the paper are not published; the defaults are those of SparseResUNet42, times a width multiplier.

mod block;
mod conv;
mod network;
mod pyramid;

pub use block::ResidualBlock;
pub use conv::{ConvNorm, SparseConv, SparseConvConfig};
pub use network::{BYTES_PER_VOXEL, Decoder, Encoder, SparseUnet, SparseUnetConfig};
pub use pyramid::VoxelPyramid;
