//! The program `gsburn`: arguments as typed, one file a command, pages and charts.
//!
//! | folder | idea |
//! |---|---|
//! | [`report`] | pages and charts of one run and of several |
//! | [`cli`], [`commands`] | arguments as typed, one file per command |
//! | [`logging`] | logs on stderr |
#![recursion_limit = "256"]

pub mod cli;
pub mod commands;
pub mod logging;
pub mod report;
