//! Training: from a data set to a finished scene, and the `gsburn` command line around it.
//!
//! Layers; each depends only on the layers above it in this list:
//!
//! | folder | idea |
//! |---|---|
//! | [`config`] | sections with defaults and ranges; files, recipes and arguments merged |
//! | [`fit`] | fitting Gaussians to the photos of one scene, in terms of a [`Method`](fit::method::Method) |
//! | [`run`] | observers of any training: folder, clock, checkpoints, measurements |
//! | [`report`] | pages and charts of one run and of several |
//! | [`pipelines`] | the papers: one folder and one line each |
//! | [`cli`], [`commands`] | arguments as typed, one file per command |
//!
//! The path of the data; each arrow is one function:
//!
//! ```text
//! Scene -> facts, cues -> initial Gaussians -> Method::forward -> losses -> Adam -> density -> checkpoint, evaluate, report
//! ```
//!
//! [`pipelines::fit`] is the whole run on one screen, [`Trainer::step`](fit::trainer::Trainer::step) one optimisation step. The
//! configuration holds everything that a run depends on, and every random draw is in [`fit::random`]. Saving, measuring and showing
//! observe from outside the step and cannot change its result: on the CPU, two runs of one configuration write equal checkpoints,
//! interrupted or not.
//!
//! ```no_run
//! use gs_train::pipelines::resolve_overrides;
//! use gs_train::run::folder::RunFolder;
//! use gs_train::run::watch::{Ending, Job};
//!
//! # fn main() -> anyhow::Result<()> {
//! let resolved = resolve_overrides(&["steps=1000".to_string()])?;
//! let ending = resolved.pipeline.train(&Job {
//!     dataset: "my-photos".into(),
//!     config: resolved.config.clone(),
//!     folder: RunFolder::vacant("runs/my-photos")?,
//!     device: burn::tensor::Device::default(),
//!     more_devices: Vec::new(),
//!     device_name: "the default device".to_string(),
//!     resume: false,
//!     stop_at: None,
//!     quiet: false,
//!     schedule_svg: None,
//! })?;
//! if let Ending::Finished(outcome) = ending {
//!     println!("{:.2} dB", outcome.eval.last.mean().psnr);
//! }
//! # Ok(())
//! # }
//! ```
#![recursion_limit = "256"]

pub mod cli;
pub mod commands;
pub mod config;
pub mod fit;
pub mod logging;
pub mod pipelines;
pub mod report;
pub mod run;
pub mod sentence;
