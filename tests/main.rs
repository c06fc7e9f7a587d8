//! All tests across crates, one module a subject.
#![recursion_limit = "256"]

mod gradients;
mod kernels;
mod memory;
mod modules;
