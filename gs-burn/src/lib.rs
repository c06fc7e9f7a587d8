//! Gaussian splatting for [Burn](https://burn.dev): a differentiable rasterizer of 3D Gaussians on its CPU and GPU
//! backends.
//!
//! [`Gaussians`] is a Burn module; [`render()`] turns it and a [`Camera`] into an image through which gradients flow to
//! every parameter and to the camera's pose. The steps between are [`ops`] of their own, each with an accelerated
//! forward and backward and with a reference in plain tensor operations. [`device`] finds a device by name. The
//! arithmetic itself lives in `gs-kernels`, which knows nothing of Burn.
//!
//! ```
//! use burn::tensor::Tensor;
//! use gs_base::Intrinsics;
//! use gs_burn::{Camera, Gaussians, RenderOptions, device, glam::DMat4, render};
//!
//! let device = device::select("auto")?.autodiff();
//! let gaussians = Gaussians::from_tensors(
//!     Tensor::from_floats([[-0.5, 0.0, 3.0], [0.0, 0.2, 4.0], [0.5, 0.0, 5.0]], &device),
//!     Tensor::from_floats([[1.0, 0.0, 0.0, 0.0]; 3], &device),
//!     Tensor::from_floats([[-1.5; 3]; 3], &device),
//!     Tensor::from_floats([2.0; 3], &device),
//!     Tensor::from_floats([[[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]], [[0.0, 0.0, 1.0]]], &device),
//! );
//! // A camera at the origin that looks along z.
//! let intrinsics = Intrinsics { fx: 60.0, fy: 60.0, cx: 32.0, cy: 24.0 };
//! let camera = Camera::from_c2w(DMat4::IDENTITY, intrinsics, 64, 48, &device);
//!
//! let rendering = render(&gaussians, &camera, &RenderOptions::default());
//! assert_eq!(rendering.color.dims(), [48, 64, 3]);
//!
//! let gradients = rendering.color.mean().backward();
//! assert_eq!(gaussians.means.grad(&gradients).unwrap().dims(), [3, 3]);
//! # Ok::<(), gs_burn::device::DeviceError>(())
//! ```
#![recursion_limit = "256"]
// Burn 0.22 deprecates NdArray in favour of Flex. It is supported here until the release that removes it, and the
// dispatch macros name it in every op, so the warnings cannot be allowed in a smaller scope.
#![cfg_attr(feature = "ndarray", allow(deprecated))]

/// The README's example compiles and runs.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;

/// So does that of this crate's README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct OwnReadme;

pub mod adam;
pub mod camera;
#[cfg(feature = "cube")]
mod cube;
pub mod device;
mod exact;
pub mod exposure;
pub mod gaussians;
#[cfg(feature = "cube")]
pub mod launches;
pub mod limits;
pub mod named_parameters;
pub mod ops;
pub mod profile;
pub mod render;
pub mod row_map;

mod slices;

pub use adam::{Adam, AdamRate};
pub use camera::Camera;
pub use exact::exact_matmul;
pub use exposure::{ExposureOptions, ExposureRendering, MovingSample, MovingSamples, render_exposure};
pub use gaussians::Gaussians;
pub use glam;
pub use gs_kernels::constants;
pub use named_parameters::{
    NamedGradients, NamedParameter, map_parameters, named_parameters, parameter_bytes, try_map_parameters,
};
pub use render::{Extras, RenderOptions, Rendering, render, render_with};
pub use row_map::RowMap;
