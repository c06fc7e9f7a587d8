//! View-dependent colour from real spherical harmonics, forward and backward: one unit per Gaussian.
//!
//! `colour = max(0, 1/2 + sum_k Y_k(dir) sh_k)` with `dir` the unit vector from the camera to the Gaussian; signs and
//! order of the basis as in 3DGS. The degree is known when the kernel is compiled, so no coefficient above it is read. The third degree's
//! coefficients may lie in a buffer of their own ([`forward_of_bands`]).

mod backward;
mod bands;
mod basis;
mod forward;
mod table;

pub use backward::{ShGradients, backward};
pub use bands::{BandGradients, backward_of_bands, forward_of_bands};
pub use forward::forward;
