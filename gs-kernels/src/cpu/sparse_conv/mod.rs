//! Sparse convolution of rows of features on an integer grid.
//!
//! `Y[o] = sum over k of X[i(o, k)] W_k`, where `i(o, k)` is the row at the coordinates of `o` plus offset `k`, if
//! there is one. `dX[i] = sum over k of dY[o(i, k)] W_k^T` is the same sum over the reverse lists, and `dW_k = sum
//! over pairs of X[i]^T dY[o]`.
//!
//! | file | content |
//! |---|---|
//! | `keys.rs` | coordinates packed into sorted 64-bit keys, with checks |
//! | `voxels.rs` | points into voxels |
//! | `table.rs` | the neighbour of each output row at each offset, by merging sorted keys |
//! | `pairs.rs` | the same neighbours as lists of pairs by block and offset |
//! | `rows.rs` | forward, and backward by the input |
//! | `direct.rs` | the product of a block of rows, read through the lists |
//! | `weights.rs` | backward by the weights |

mod direct;
mod keys;
mod pairs;
mod rows;
mod table;
mod voxels;
mod weights;

pub use direct::Channels;
pub use keys::{BATCHES, COORDINATE_LIMIT, LARGEST_KERNEL, SparseError};
pub use pairs::PairLists;
pub use rows::{forward, transposed_weights};
pub use table::{Neighbours, strided, submanifold};
pub use voxels::{Voxels, voxels};
pub use weights::backward_weights;
