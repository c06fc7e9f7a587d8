//! 3D Gaussians to 2D ellipses (EWA), forward and backward; sixteen Gaussians at once, in fixed chunks over threads.

mod backward;
mod batch;
mod forward;
mod path;

#[cfg(test)]
mod tests;

pub use backward::{ProjectionGradients, backward};
pub use forward::forward;
