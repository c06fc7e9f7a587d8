//! `gsburn check`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};
use gs_driving::{LogFormat, LogOptions, logs_in};

use crate::cli::CheckArgs;
use crate::commands::print;
use crate::commands::train::resolve;
use gs_train::run::folder::utf8;

/// Prints the contents and mistakes of a data set or a driving log; exits with 1 if it cannot be trained on.
///
/// # Errors
/// When the configuration is not valid or the path is not UTF-8. A bad data set is no error but a finding, and exit
/// code 1.
pub fn run(args: &CheckArgs) -> Result<ExitCode> {
    if LogFormat::of(&args.dataset).is_some() {
        return Ok(of_logs(std::slice::from_ref(&args.dataset), args.pictures.as_deref()));
    }
    // A folder of logs is what a network trains on; with a configuration it is checked as that training reads it.
    let logs = if args.config.is_typed() { Vec::new() } else { logs_in(&args.dataset).unwrap_or_default() };
    if !logs.is_empty() {
        return Ok(of_logs(&logs, args.pictures.as_deref()));
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

/// Prints the contents and mistakes of each log; the pictures of several are in folders of their own.
fn of_logs(logs: &[PathBuf], pictures: Option<&Path>) -> ExitCode {
    let mut is_ok = true;
    for log in logs {
        let own = pictures.map(|folder| match logs {
            [_] => folder.to_path_buf(),
            _ => folder.join(log.file_name().unwrap_or_default()),
        });
        let report = gs_driving::check(log, &LogOptions::default(), own.as_deref());
        print(&report);
        is_ok &= report.is_ok();
    }
    if is_ok { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
