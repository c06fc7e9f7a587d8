//! Small worlds with known ground truth, made by an analytic ray caster, and blurry sets made from real frames.
//!
//! Nothing here is shared with the rasterizer that learns from these images, so a mistake in one cannot hide in the
//! other. [`demo_scene`] writes a static data set in the Blender layout; [`deblur::write`] writes moving worlds with
//! motion blur, their truth and the priors a deblurring pipeline starts from; [`extrapolation::write`] writes moving worlds whose
//! future is to be predicted; [`blur_from_frames`] averages the frames of real multi-view video.

pub mod deblur;
mod demo;
pub mod extrapolation;
mod frames;
mod movers;
mod random;
mod shapes;
mod tracer;
mod world;

pub use demo::{DemoOptions, demo_scene};
pub use frames::{BlurFromFrames, BlurSummary, blur_from_frames};
pub use movers::{Mover, movers};
pub use tracer::texture::noise;
