//! The tests of the crate from outside, one module a subject.

mod exposure;
mod gradients;
mod hostile;
mod scenes;
