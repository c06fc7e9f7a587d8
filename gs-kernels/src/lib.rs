//! Gaussian splatting arithmetic on plain buffers.
//!
//! The crate knows nothing of Burn: [`cpu`] holds fast Rust kernels over slices (threads, SIMD lanes, generic over
//! `f32` and `f64`, the same bits for any number of threads); `cube` (feature `cube`) holds their CubeCL twins under
//! the same file names. Both share the thresholds of [`constants`], the packed rows of [`rows`] and the launch
//! descriptions of [`config`].
//!
//! The data path, in order: [`cpu::projection`] (3D Gaussian to 2D ellipse) and [`cpu::sh`] (colour seen from the
//! camera), [`cpu::intersect`] (which ellipse touches which tile, in depth order), [`cpu::rasterize`] (blending),
//! [`cpu::ssim`] (photometric loss), [`cpu::adam`] (parameter update).
//!
//! ```
//! use gs_kernels::config::ProjectionConfig;
//! use gs_kernels::cpu::projection;
//! use gs_kernels::rows::{PROJECTED, ProjectedRow};
//!
//! let lens = ProjectionConfig { fx: 50.0, fy: 50.0, cx: 32.0, cy: 24.0, ..Default::default() };
//! let camera = ProjectionConfig { width: 64, height: 48, ..lens };
//! let identity: [f32; 16] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
//! let rows = projection::forward(&[0.0, 0.0, 2.0], &[1.0, 0.0, 0.0, 0.0], &[-2.0; 3], &identity, &camera);
//! assert_eq!(rows.len(), PROJECTED);
//! assert_eq!(ProjectedRow::read(&rows, 0).mean, [32.0, 24.0]);
//! ```
#![recursion_limit = "256"]

pub mod config;
pub mod constants;
pub mod cpu;
pub mod limits;
pub mod random;
pub mod rows;

#[cfg(feature = "cube")]
pub mod cube;
