//! The walk over tiles around one blending step.
//!
//! A tile is 16 x 16 pixels and one cube. The tile's Gaussians go through shared memory in batches, as packed attribute
//! rows, and every pixel walks over the batch.

mod attributes;
mod backward;
mod blocks;
mod forward;
mod gather;
mod pair_sum;
mod slots;

pub use backward::{backward, backward_within};
pub use forward::{Inputs, Rendered, Saved, forward};
pub use gather::{PAIR_BYTES, RasterizeGradients};
pub use pair_sum::{CHUNK, added_by_a_unit};
