//! `gsburn stability`.

use std::process::ExitCode;

use anyhow::Result;

use crate::cli::{Stability, StabilityArgs, StabilityTaylormodeArgs};
use crate::commands::{device, print};
use crate::interrupt;
use crate::stability::{Outcome, Request, run as run_experiments};

/// Runs the experiments.
///
/// # Errors
/// One sentence: a name that is none, a full disk, Ctrl-C.
pub fn run(args: &StabilityArgs) -> Result<ExitCode> {
    match &args.what {
        Stability::Taylormode(args) => taylormode(args),
    }
}

fn taylormode(args: &StabilityTaylormodeArgs) -> Result<ExitCode> {
    interrupt::watch();
    let request = Request {
        out: args.out.clone(),
        only: args.only.clone(),
        quick: args.quick,
        device: device(&args.device)?,
        quiet: false,
    };
    let outcomes = run_experiments(&request)?;
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
