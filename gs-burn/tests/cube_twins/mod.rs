//! The CubeCL kernels against their CPU twins, on the default device of the CubeCL runtime that the features choose
//! (Mesa's software Vulkan where there is no GPU). The CPU twins in `f64` are the judge; scenes are small, because a
//! software device is slow.

mod support;

mod adam;
mod bilinear;
mod channels;
#[cfg(feature = "flex")]
mod exposure;
mod instants;
mod intersect;
mod projection;
mod rasterize;
#[cfg(feature = "flex")]
mod render;
mod scan;
mod sh;
mod sort;
mod sparse_conv;
mod ssim;
