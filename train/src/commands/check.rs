//! `gsburn check`.

use std::process::ExitCode;

use anyhow::{Result, bail};
use gs_driving::{LogFormat, LogOptions};

use crate::cli::CheckArgs;
use crate::commands::print;
use crate::commands::train::resolve;
use crate::run::folder::utf8;

/// Prints the contents and mistakes of a data set or a driving log; exits with 1 if it cannot be trained on.
///
/// # Errors
/// When the configuration is not valid or the path is not UTF-8. A bad data set is no error but a finding, and exit code 1.
pub fn run(args: &CheckArgs) -> Result<ExitCode> {
    if LogFormat::of(&args.dataset).is_some() {
        let report = gs_driving::check(&args.dataset, &LogOptions::default(), args.pictures.as_deref());
        print(&report);
        return Ok(if report.is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE });
    }
    if args.pictures.is_some() {
        bail!("--pictures: expected a driving log, found none in {}", args.dataset.display());
    }
    let resolved = resolve(&args.config, &[])?;
    // What training would refuse.
    utf8(&args.dataset)?;
    let report = resolved.pipeline.check(&args.dataset, &resolved.config)?;
    print(&report);
    Ok(if report.is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
