//! The kernels in CubeCL, for every GPU that CubeCL reaches: twins of [`crate::cpu`] under the same names, over device
//! [`buffer::Buffer`]s instead of slices.
//!
//! Results are reproducible to the bit on one device: sums have a fixed order and no float is added atomically. No
//! kernel binds more than seven buffers (eight is what WebGPU promises, and CubeCL takes one), uses more than 16 KiB of
//! shared memory, launches more than 65,535 cubes along an axis, or assumes the width of a plane.

pub mod adam;
pub mod bilinear;
pub(crate) mod blend;
pub mod buffer;
pub(crate) mod camera;
pub mod channels;
pub(crate) mod covariance;
pub mod error;
pub mod exposure;
pub mod intersect;
pub(crate) mod light;
pub(crate) mod math;
pub mod noise;
pub mod opacity;
pub mod products;
pub mod projection;
pub mod rasterize;
pub(crate) mod reduce;
pub(crate) mod rows;
pub mod rows_of;
pub mod scan;
pub mod segments;
pub mod sh;
pub mod sort;
pub mod sparse_conv;
pub mod ssim;
pub mod statistics;
pub mod sum;
pub(crate) mod uniform;
