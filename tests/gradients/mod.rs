//! Derivatives: central differences in `f64`, twin against twin, and a fit that only right gradients can make.

mod bilinear;
mod channels;
mod exposure;
mod projection;
mod rasterize;
mod render;
mod sh;
mod sparse_conv;
mod ssim;
mod toy_fit;
