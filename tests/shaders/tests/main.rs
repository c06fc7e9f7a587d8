//! Every kernel on every target of shaders, and step by step.
#![cfg(feature = "wgpu")]

mod cases;
mod dump;
mod faults;
mod kernels;
#[path = "../../../gs-kernels/tests/scenes/mod.rs"]
mod scenes;
mod translation;
