//! `gs-lab`: experiments at the limits of the methods, comparisons of many runs, and the tables of the docs.
//!
//! | module | idea |
//! |---|---|
//! | [`experiments`] | where a method fails: small worlds, faults, bounds that were set before measuring |
//! | [`comparison`] | charts and tables of many runs, beside other programs |
//! | [`results`] | the tables of the docs, written from data files that say how they were measured |
#![recursion_limit = "256"]

mod cli;
mod comparison;
mod experiments;
mod results;
#[cfg(test)]
mod tests;

use std::io::Write;
use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;
use gs_base::printable;
use gs_train::run::resources;
use gs_train::sentence::one_sentence;
use gsburn::logging;

use cli::{Cli, Command};

fn main() -> ExitCode {
    resources::keep_freed_memory();
    let cli = Cli::parse();
    logging::init(cli.verbose);
    call(&cli.command).unwrap_or_else(|error| {
        eprintln!("error: {}", printable(&one_sentence(&error)));
        ExitCode::FAILURE
    })
}

fn call(command: &Command) -> Result<ExitCode> {
    match command {
        Command::Experiments(args) => experiments::command::run(args),
        Command::Chart(args) => comparison::command::run(args),
        Command::Results(args) => results::run(args),
    }
}

/// Prints to standard output. A reader that left is no error.
fn print(text: impl std::fmt::Display) {
    let text = text.to_string();
    let lines: Vec<_> = text.split('\n').map(printable).collect();
    let _ = writeln!(std::io::stdout(), "{}", lines.join("\n"));
}
