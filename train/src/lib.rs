//! Training: from a data set to a finished scene, and the `gsburn` command line around it.
//!
//! The path of the data, one arrow one function:
//!
//! ```text
//! Scene -> scene_init -> Parameters -> render -> losses -> optimiser -> density -> checkpoint, evaluate, report
//! ```
//!
//! [`run::run`] is the whole run on one screen, [`step::Trainer::step`] one optimisation step on one screen. Everything a run
//! depends on is in [`experiment::Config`], every random draw in [`random`]. Saving, measuring and showing watch from outside
//! the step and cannot change its result: on the CPU, two runs of one configuration write equal checkpoints, interrupted or not.
//!
//! ```no_run
//! use gs_train::experiment::Config;
//! use gs_train::run::{Ending, RunRequest, run};
//! use gs_train::run_folder::RunFolder;
//!
//! # fn main() -> anyhow::Result<()> {
//! let ending = run(&RunRequest {
//!     dataset: "my-photos".into(),
//!     config: Config::resolve(None, &["steps=1000".to_string()])?,
//!     folder: RunFolder::vacant("runs/my-photos")?,
//!     device: burn::tensor::Device::default(),
//!     device_name: "the default device".to_string(),
//!     resume: false,
//!     stop_at: None,
//!     quiet: false,
//! })?;
//! if let Ending::Finished(figures) = ending {
//!     println!("{:.2} dB", figures.last.mean.psnr);
//! }
//! # Ok(())
//! # }
//! ```
#![recursion_limit = "256"]

pub mod checkpoint;
pub mod cli;
pub mod commands;
pub mod comparison;
pub mod data;
pub mod density;
pub mod evaluate;
pub mod experiment;
pub mod export;
pub mod interrupt;
pub mod logging;
pub mod losses;
pub mod memory;
pub mod metrics;
pub mod optimiser;
pub mod parameters;
pub mod profile;
pub mod progress;
pub mod random;
pub mod report;
pub mod resources;
pub mod run;
pub mod run_folder;
pub mod scene_init;
pub mod schedule;
pub mod stability;
pub mod step;
pub mod taylormode;
