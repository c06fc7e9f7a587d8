//! 3D Gaussians to 2D ellipses (EWA), forward and backward: one unit per Gaussian.

mod backward;
mod forward;
mod path;

pub use backward::{ProjectionGradients, backward};
pub use forward::forward;
