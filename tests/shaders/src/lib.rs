//! The GPU kernels without a GPU.
//!
//! [`device`] is a device of CubeCL that turns each kernel into WGSL, as wgpu gets it, and hands it to an
//! [`interpreter`], which finds races, reads of memory that nobody has written, barriers that not all units reach, and
//! indices beyond their arrays. Kernels are launched on it by their own host code.
#![cfg(feature = "wgpu")]

pub mod device;
pub mod interpreter;
