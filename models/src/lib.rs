//! Scene models: everything that can say where its Gaussians are at a time `t`.
//!
//! [`Motion`] is the one trait rendering, evaluation and export are written against; [`Static`] is its simplest
//! implementation, Gaussians that stay where they are. Models of moving scenes implement the same two functions.
//!
//! ```
//! use gs_burn::Gaussians;
//! use gs_models::{Motion, Static};
//!
//! /// Where the Gaussians are halfway through the recording.
//! fn midway(model: &dyn Motion) -> Gaussians {
//!     model.at(0.5)
//! }
//! # fn check(gaussians: Gaussians) { midway(&Static::new(gaussians)); }
//! ```
#![recursion_limit = "256"]

mod dynamic;
pub mod light;
pub mod network;
pub mod sh_bands;
pub mod taylormode;

pub use dynamic::{Motion, Static};
