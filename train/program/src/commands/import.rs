//! `gsburn import`.

use std::process::ExitCode;

use anyhow::Result;
use gs_datasets::import::{ImportOptions, import};

use crate::cli::ImportArgs;
use crate::commands::print;
use gs_train::run::folder::utf8;

/// Writes the priors and prints the report.
///
/// # Errors
/// One sentence: an archive or a data set that cannot be read, views that cannot be told, cameras without a common scale, a full disk.
pub fn run(args: &ImportArgs) -> Result<ExitCode> {
    // What training would refuse.
    utf8(&args.into)?;
    let options = ImportOptions {
        views: args.views.clone(),
        images: args.images.clone(),
        out: args.out.clone(),
        fit: args.fit,
        keep: args.keep,
        max_points: args.max_points,
        use_points: args.use_points,
    };
    print(import(&args.reconstruction, &args.into, &options)?);
    Ok(ExitCode::SUCCESS)
}
