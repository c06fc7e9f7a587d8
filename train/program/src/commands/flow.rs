//! `gsburn flow`.

use std::process::ExitCode;

use anyhow::Result;

use crate::cli::{FlowArgs, ScoredPoints};
use crate::commands::{device, print};
use gs_pipelines::{Protocol, SweepFlow, sweep_flow};

/// Finds the scene flow of a driving log's sweeps.
///
/// # Errors
/// One sentence saying what was wrong with the log or the folder.
pub fn run(args: &FlowArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    let request = SweepFlow {
        log: &args.log,
        out: args.out.as_deref(),
        protocol: match args.protocol {
            ScoredPoints::All => Protocol::All,
            ScoredPoints::Av2 => Protocol::Av2,
        },
        window: usize::from(args.window),
        fit: args.fit.map(|iterations| iterations as usize),
        device: &device,
    };
    for line in sweep_flow(&request)? {
        print(line);
    }
    Ok(ExitCode::SUCCESS)
}
