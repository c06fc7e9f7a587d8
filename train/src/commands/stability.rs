//! `gsburn stability`.

use std::process::ExitCode;

use anyhow::{Result, bail};

use crate::cli::StabilityArgs;
use crate::commands::{device, print};
use crate::pipelines::{PIPELINES, find};
use crate::run::interrupt;
use crate::stability::{Interrupted, Outcome, Request, run as run_experiments};

/// Runs the experiments of a pipeline.
///
/// # Errors
/// One sentence: an unknown name, a full disk.
pub fn run(args: &StabilityArgs) -> Result<ExitCode> {
    let with_experiments = PIPELINES.iter().filter(|pipeline| !pipeline.experiments().is_empty());
    let names: Vec<&str> = with_experiments.map(|pipeline| pipeline.name()).collect();
    let Some(pipeline) = find(&args.pipeline).filter(|pipeline| !pipeline.experiments().is_empty()) else {
        bail!("expected a pipeline with experiments ({}), found {:?}", names.join(", "), args.pipeline);
    };
    interrupt::watch();
    let request = Request {
        out: args.out.clone(),
        only: args.only.clone(),
        data: args.data.clone(),
        quick: args.quick,
        device: device(&args.device)?,
        quiet: false,
    };
    let outcomes = match run_experiments(pipeline.name(), pipeline.experiments(), &request) {
        Err(error) if error.is::<Interrupted>() => {
            eprintln!("{error}");
            return Ok(ExitCode::from(interrupt::exit_code()));
        }
        outcomes => outcomes?,
    };
    print(table(&outcomes).trim_end());
    print(format!("report {}", args.out.join("stability.html").display()));
    // A missed bound is a result, not a failure of the program.
    Ok(ExitCode::SUCCESS)
}

/// A Markdown table with one row per bound.
fn table(outcomes: &[Outcome]) -> String {
    let mut text = String::from("| experiment | what | bound | measured | verdict |\n|---|---|---|---|---|\n");
    for outcome in outcomes {
        for criterion in &outcome.criteria {
            let (what, bound) = (&criterion.what, &criterion.bound);
            text +=
                &format!("| {} | {what} | {bound} | {} | {} |\n", outcome.name, criterion.shown(), criterion.verdict());
        }
    }
    text
}
