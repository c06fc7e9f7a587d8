//! `gsburn`: choose, call, report.
#![recursion_limit = "256"]

use std::any::Any;
use std::panic::{self, AssertUnwindSafe};
use std::process::ExitCode;

use anyhow::{Result, anyhow};
use clap::Parser;
use gs_base::printable;
use gs_burn::limits::is_limit;
use gs_train::run::resources;
use gs_train::sentence::one_sentence;
use gsburn::cli::{Cli, Command};
use gsburn::{commands, logging};

fn main() -> ExitCode {
    resources::keep_freed_memory();
    let cli = Cli::parse();
    logging::init(cli.verbose);
    let done = within_limits(|| call(&cli.command));
    let done = done.and_then(|code| commands::all_printed().map(|()| code));
    done.unwrap_or_else(|error| {
        eprintln!("error: {}", printable(&one_sentence(&error)));
        ExitCode::FAILURE
    })
}

fn call(command: &Command) -> Result<ExitCode> {
    match command {
        Command::Train(args) => commands::train::run(args),
        Command::Eval(args) => commands::eval::run(args),
        Command::Reconstruct(args) => commands::reconstruct::run(args),
        Command::Flow(args) => commands::flow::run(args),
        Command::Render(args) => commands::render::run(args),
        Command::View(args) => commands::view::run(args),
        Command::Watch(args) => commands::watch::run(args),
        Command::Export(args) => commands::export::run(args),
        Command::Convert(args) => commands::convert::run(args),
        Command::Extrapolate(args) => commands::extrapolate::run(args),
        Command::Synth(args) => commands::synth::run(args),
        Command::Import(args) => commands::import::run(args),
        Command::Check(args) => commands::check::run(args),
        Command::Info(args) => commands::info::run(args),
        Command::Bench(args) => commands::bench::run(args),
        Command::Demo(args) => commands::demo::run(args),
        Command::Sweep(args) => commands::sweep::run(args),
        Command::Recipes => commands::recipes::run(),
    }
}

/// A scene that no kernel can process (a billion pairs, say) is an error of the input: one sentence replaces the
/// panic's message.
fn within_limits(call: impl FnOnce() -> Result<ExitCode>) -> Result<ExitCode> {
    let usual = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        if limit(info.payload()).is_none() {
            usual(info);
        }
    }));
    panic::catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|payload| match limit(&*payload) {
        Some(sentence) => Err(anyhow!(sentence)),
        None => panic::resume_unwind(payload),
    })
}

fn limit(payload: &(dyn Any + Send)) -> Option<String> {
    payload.downcast_ref::<String>().filter(|message| is_limit(message)).cloned()
}
