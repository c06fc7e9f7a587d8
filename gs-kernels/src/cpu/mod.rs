//! Fast Rust kernels over slices: rayon threads, sixteen SIMD lanes, generic over `f32` and `f64`.
//!
//! Every sum has a fixed order, so results are the same to the bit for any number of threads; the vector units
//! (AVX-512, AVX2 with FMA, NEON) run one sequence of roundings, so `f32` results do not depend on the machine either.

pub mod adam;
pub mod bilinear;
pub mod blend;
pub mod camera;
pub mod covariance;
pub mod exposure;
pub mod intersect;
pub mod lanes;
pub mod light;
pub mod math;
pub mod noise;
pub mod opacity;
pub mod parallel;
pub mod projection;
pub mod rasterize;
pub mod real;
pub mod rows;
pub mod segments;
pub mod sh;
pub mod silu;
pub mod sort;
pub mod sparse_conv;
pub mod ssim;
pub mod statistics;
pub mod sum;
pub mod wide;

pub use real::Real;
