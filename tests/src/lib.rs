//! Shared code of the tests of the whole workspace.
//!
//! Each test compares, for every device of this build ([`devices`]), the accelerated op with its reference body in
//! `f64`, within the bounds of [`tolerance`], on the seeded scenes of [`scenes`]; gradients also with
//! [`finite_differences`]. Test files carry the name of the file they check: `kernels/` for values, `gradients/` for
//! derivatives.
#![recursion_limit = "256"]

pub mod cutoff;
pub mod devices;
pub mod exposure;
pub mod finite_differences;
pub mod fit;
pub mod mutate;
pub mod scenes;
pub mod sparse;
pub mod tolerance;
