//! The GPU kernels without a GPU.
//!
//! An [`interpreter`] of shaders finds races, reads of memory that nobody has written, barriers that not all units reach,
//! and indices beyond their arrays.
#![cfg(feature = "wgpu")]

pub mod interpreter;
pub mod random;
