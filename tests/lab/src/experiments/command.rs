//! `gs-lab experiments`.

use std::process::ExitCode;

use anyhow::{Result, bail};
use gs_burn::device::select;
use gs_train::run::interrupt;

use crate::cli::ExperimentsArgs;
use crate::experiments::{Interrupted, Outcome, PIPELINES, Request, run as run_experiments};
use crate::print;

/// Runs the experiments of a pipeline.
///
/// # Errors
/// One sentence: an unknown name, a full disk.
pub fn run(args: &ExperimentsArgs) -> Result<ExitCode> {
    let Some((name, experiments)) = PIPELINES.iter().find(|(name, _)| *name == args.pipeline) else {
        let names = PIPELINES.map(|(name, _)| name).join(", ");
        bail!("expected a pipeline with experiments ({names}), found {:?}", args.pipeline);
    };
    interrupt::watch();
    let request = Request {
        out: args.out.clone(),
        only: args.only.clone(),
        data: args.data.clone(),
        quick: args.quick,
        device: select(&args.device)?,
        quiet: false,
    };
    let outcomes = match run_experiments(name, experiments, &request) {
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
