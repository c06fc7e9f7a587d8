//! `gsburn check`.

use std::path::Path;
use std::process::ExitCode;

use anyhow::Result;
use gs_datasets::CheckReport;

use crate::cli::CheckArgs;
use crate::commands::print;
use crate::commands::train::resolve;
use crate::data::{check_times, near_warning, no_pixels};
use crate::experiment::{Config, Pipeline};
use crate::taylormode::hints::left_out_warning;

/// Prints what is in a data set; fails when it cannot be trained on.
///
/// # Errors
/// When the configuration is not valid. A bad data set is no error but a finding, and exit code 1.
pub fn run(args: &CheckArgs) -> Result<ExitCode> {
    let report = examine(&args.dataset, &resolve(&args.config, &[])?);
    print(&report);
    Ok(if report.is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The report on a data set, with what training by `config` would say of it or refuse it for.
pub fn examine(dataset: &Path, config: &Config) -> CheckReport {
    let mut report = gs_datasets::check(dataset, &config.data.options());
    // Without a training view the report says why, and there is nothing to compare with the configuration.
    if report.train == 0 {
        return report;
    }
    if config.pipeline == Pipeline::Taylormode {
        report.warnings.extend(left_out_warning(report.without_time));
    }
    report.warnings.extend(near_warning(config, report.subject_distance));
    report.errors.extend((report.blank == report.train + report.test).then(|| no_pixels(dataset)));
    report.errors.extend(check_times(dataset, config, report.timed).err());
    report
}
