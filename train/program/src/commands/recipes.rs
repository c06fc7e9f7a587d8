//! `gsburn recipes`.

use std::process::ExitCode;

use anyhow::Result;

use crate::commands::print;
use gs_pipelines::names;

/// Lists the compiled-in recipes, a line each.
///
/// # Errors
/// None.
pub fn run() -> Result<ExitCode> {
    let width = gs_recipes::RECIPES.iter().map(|recipe| recipe.name.len()).max().unwrap_or(0);
    for recipe in &gs_recipes::RECIPES {
        print(format!("{:width$}  {}", recipe.name, recipe.about()));
    }
    let alone = "--set pipeline=NAME alone is the pipeline's recommended recipe";
    print(format!("\nUse: gsburn train DATA --recipe NAME. Pipelines: {}; {alone}.", names()));
    Ok(ExitCode::SUCCESS)
}
