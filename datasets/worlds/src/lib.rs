//! Small synthetic worlds with known ground truth, made by an analytic ray tracer.
//!
//! Nothing here is shared with the rasterizer that learns from these images, so a mistake in one cannot hide in the
//! other. [`still::write`] writes a static data set in the Blender layout; [`deblur::write`] writes moving worlds with
//! motion blur, their truth and the priors a deblurring pipeline starts from; [`extrapolation::write`] writes moving
//! worlds whose future is to be predicted; [`driving::write`] writes logs of streets in the layout of PandaSet.

pub mod deblur;
pub mod driving;
pub mod extrapolation;
mod film;
mod named;
mod points;
mod random;
mod ranges;
mod set;
pub mod still;
mod tracer;
