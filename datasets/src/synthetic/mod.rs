//! Small worlds with known ground truth, made by an analytic ray caster.
//!
//! Nothing here is shared with the rasterizer that learns from these images, so a mistake in one cannot hide in the
//! other. [`demo_scene`] writes a data set to disk in the Blender layout.

mod demo;
mod shapes;
mod world;

pub use demo::{DemoOptions, demo_scene};
