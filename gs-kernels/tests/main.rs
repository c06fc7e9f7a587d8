//! The tests of the crate from outside, one module a subject.
//!
//! Values and gradients of each kernel against references and central differences stand in `gs-tests`, which runs the
//! same kernels in both float types through Burn.

mod exposure;
mod fast_math;
mod hostile;
mod saved;
mod scenes;
