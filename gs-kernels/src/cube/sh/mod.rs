//! View-dependent colour from real spherical harmonics, forward and backward: one unit per Gaussian.
//!
//! `colour = max(0, 1/2 + sum_k Y_k(dir) sh_k)` with `dir` the unit vector from the camera to the Gaussian; signs and
//! order of the basis as in 3DGS. The degree is known when the kernel is compiled, so no coefficient above it is read.

mod backward;
mod basis;
mod forward;
mod table;

pub use backward::{ShGradients, backward};
pub use forward::forward;
