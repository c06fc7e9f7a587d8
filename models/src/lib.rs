//! Scene models: Burn modules that give Gaussians for any time `t`.
//!
//! [`DynamicScene`] is the one trait rendering, evaluation and export are written against; [`Static`] is its simplest
//! implementation, Gaussians that stay where they are. Models of moving scenes implement the same functions.
//!
//! ```
//! use gs_burn::Gaussians;
//! use gs_models::{DynamicScene, Static};
//!
//! /// The Gaussians halfway through the recording.
//! fn midway(model: &dyn DynamicScene) -> Gaussians {
//!     let [first, last] = model.span().unwrap_or_default();
//!     model.at(0.5 * (first + last))
//! }
//! # fn check(gaussians: Gaussians) { midway(&Static::new(gaussians)); }
//! ```
//!
//! Everything that is learned is a Burn [`Module`](burn::module::Module): its `Param`s are learned, its other fields
//! are not. A configuration's `init` gives it before training. Burn's own optimisers and records work on it, and so do
//! [`gs_burn::Adam`] and [`gs_burn::named_parameters()`], which know parameters by path.
#![recursion_limit = "256"]

/// The README's example compiles and runs.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub mod basis;
pub mod bits;
pub mod camera_path;
pub mod depth_prior;
pub mod flux4d;
pub mod light;
pub mod mlp;
pub mod pixels;
mod random;
pub mod rotation;
pub mod scene;
pub mod sh_bands;
pub mod sparsedyn;
pub mod taylormode;

pub use mlp::{Activation, Mlp, MlpConfig};
pub use pixels::Pixels;
pub use scene::{DynamicScene, Shutter, Static};
