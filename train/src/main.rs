//! `gsburn`: choose, call, report.
#![recursion_limit = "256"]

use std::process::ExitCode;

use clap::Parser;
use gs_train::cli::{Cli, Command};
use gs_train::{commands, logging, resources};

fn main() -> ExitCode {
    resources::keep_freed_memory();
    let cli = Cli::parse();
    logging::init(cli.verbose);
    let done = match &cli.command {
        Command::Train(args) => commands::train::run(args),
        Command::Eval(args) => commands::eval::run(args),
        Command::Render(args) => commands::render::run(args),
        Command::Export(args) => commands::export::run(args),
        Command::Synth(args) => commands::synth::run(args),
        Command::Check(args) => commands::check::run(args),
        Command::Info(args) => commands::info::run(args),
        Command::Bench(args) => commands::bench::run(args),
        Command::Demo(args) => commands::demo::run(args),
        Command::Chart(args) => commands::chart::run(args),
        Command::Sweep(args) => commands::sweep::run(args),
        Command::Stability(args) => commands::stability::run(args),
    };
    done.unwrap_or_else(|error| {
        eprintln!("error: {}", logging::one_sentence(&error));
        ExitCode::FAILURE
    })
}
