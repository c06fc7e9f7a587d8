//! Training as a library: fitting Gaussians to one scene, and the run that observes any training. It writes no page.
//!
//! Modules; each depends only on those above it in this list:
//!
//! | folder | idea |
//! |---|---|
//! | [`config`] | sections with defaults and ranges; files, recipes and arguments merged |
//! | [`fit`] | fitting Gaussians to the photos of one scene, in terms of a [`Method`](fit::method::Method) |
//! | [`run`] | observers of any training: folder, clock, checkpoints, measurements, the outcome |
//!
//! `gs-pipelines` has the papers and the loops above this crate, `gsburn` the program.
//!
//! The path of the data; each arrow is one function:
//!
//! ```text
//! Scene -> facts, cues -> initial Gaussians -> Method::forward -> losses -> Adam -> density
//!       -> checkpoint, evaluation, outcome
//! ```
//!
//! [`Trainer::step`](fit::trainer::Trainer::step) is one optimisation step. The configuration holds everything that a
//! run depends on, and every random draw is in [`fit::random`]. Saving, measuring and showing observe from outside the
//! step and cannot change its result: on the CPU, two runs of one configuration write equal checkpoints, interrupted or
//! not.
#![recursion_limit = "256"]

pub mod config;
pub mod fit;
pub mod run;
pub mod sentence;
