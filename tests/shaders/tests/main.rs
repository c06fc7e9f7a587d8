//! Every kernel on every target of shaders, and step by step.
#![cfg(feature = "wgpu")]

mod faults;
