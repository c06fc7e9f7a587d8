//! View-dependent colour from real spherical harmonics, forward and backward.
//!
//! `colour = max(0, 1/2 + sum_k Y_k(dir) sh_k)` with `dir` the unit vector from the camera to the Gaussian; signs and
//! order of the basis as in 3DGS, so that its PLY files mean the same here.

mod backward;
mod basis;
mod chunk;
mod forward;

pub use backward::{ShGradients, backward};
pub use basis::{MAX_COEFFICIENTS, SH_C0, SH_C1, SH_C2, SH_C3};
pub use forward::forward;
