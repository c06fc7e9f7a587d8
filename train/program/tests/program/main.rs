//! Training, its pipelines and the program as they are used: one module a subject.
//!
//! ```text
//! cargo test --release -p gsburn --test program -- taylormode::
//! ```
#![recursion_limit = "256"]

mod budget;
mod checkpoint;
mod cli;
mod common;
mod config_docs;
mod configs;
mod correction;
mod density;
mod docs;
mod extrapolate;
mod flux4d;
mod formats;
mod fuzz;
mod golden;
mod held_out;
mod layers;
mod linear;
#[path = "../../../../tests/src/mutate.rs"]
mod mutate;
mod noise;
mod on_demand;
mod profile;
mod region;
mod resume;
mod scene_files;
mod shake;
mod sparsedyn;
mod sparsedyn_inputs;
mod starts;
mod step;
mod sweep;
mod taylormode;
mod trouble;
mod viewer;
