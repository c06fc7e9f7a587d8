//! The tests of the crate from outside, one module a subject.
#![recursion_limit = "256"]

#[cfg(feature = "cube")]
mod cube_twins;
