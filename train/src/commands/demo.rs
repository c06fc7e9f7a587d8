//! `gsburn demo`.

use std::process::ExitCode;

use anyhow::Result;
use gs_datasets::synthetic::{DemoOptions, demo_scene};

use crate::cli::DemoArgs;
use crate::commands::train::{execute, next_folder};
use crate::commands::{device, print};
use crate::experiment::Config;
use crate::run::RunRequest;
use crate::run_folder::RunFolder;

/// The recipe of the demo, the same as configs/static/demo.toml (a test compares them): it must end within two minutes on
/// two old cores.
pub const RECIPE: [&str; 6] = [
    "steps=1500",
    "density.cap=15000",
    "density.start=200",
    "density.growth=0.2",
    "data.background=[1.0, 1.0, 1.0]",
    "eval.at=[300]",
];

/// Makes the scene, trains it, reports.
///
/// # Errors
/// One sentence, when the disk does not take the files.
pub fn run(args: &DemoArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    let overrides = RECIPE.map(String::from).into_iter().chain(args.steps.map(|n| format!("steps={n}")));
    let config = Config::resolve(None, &overrides.collect::<Vec<_>>())?;
    let folder = RunFolder::vacant(args.out.clone().unwrap_or_else(|| next_folder("demo")))?;
    let dataset = folder.path().join("dataset");
    demo_scene(&dataset, &DemoOptions::default())?;
    print(format!("a synthetic scene is in {}; training on it takes a minute or two", dataset.display()));
    let device_name = crate::commands::describe(&device);
    execute(&RunRequest {
        dataset,
        config,
        folder,
        device,
        device_name,
        resume: false,
        stop_at: None,
        quiet: args.quiet,
    })
}
