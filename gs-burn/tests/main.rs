//! The tests of the crate from outside, one module a subject.
#![recursion_limit = "256"]

#[cfg(any(feature = "flex", feature = "ndarray"))]
#[path = "../../datasets/tests/fuzz/bounded.rs"]
mod bounded;
#[cfg(feature = "cube")]
mod cube_twins;
#[cfg(any(feature = "flex", feature = "ndarray"))]
mod fuzz_ply;
#[cfg(any(feature = "flex", feature = "ndarray"))]
#[path = "../../tests/src/mutate.rs"]
mod mutate;
mod ply_formats;
