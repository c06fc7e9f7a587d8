//! `gsburn demo`.

use std::path::Path;
use std::process::ExitCode;

use anyhow::Result;
use gs_datasets::synthetic::deblur::{self, DeblurOptions, World};
use gs_datasets::synthetic::{DemoOptions, demo_scene};

use crate::cli::DemoArgs;
use crate::commands::train::{execute, next_folder};
use crate::commands::{device, print};
use crate::experiment::Config;
use crate::run::RunRequest;
use crate::run_folder::RunFolder;

/// The recipe of the demo, the same as configs/taylormode/demo.toml (a test compares them): set and training must be done
/// within two minutes on two old cores.
pub const RECIPE: [&str; 13] = [
    "pipeline=taylormode",
    "steps=1800",
    "model.sh_degree=1",
    "density.cap=12000",
    "density.start=100",
    "density.growth=0.1",
    "density.trim=0.005",
    "motion.points=3000",
    "blur.samples=5",
    "blur.decouple=false",
    "prior.sharp=0.2",
    "prior.until=0.3",
    "eval.at=[300]",
];

/// The recipe of the demo that stands still, the same as configs/static/demo.toml.
pub const STILL_RECIPE: [&str; 6] = [
    "steps=1500",
    "density.cap=15000",
    "density.start=200",
    "density.growth=0.2",
    "data.background=[1.0, 1.0, 1.0]",
    "eval.at=[300]",
];

/// The demo's blurry video: a sliding, turning box seen by nine cameras, one of them held out.
fn video() -> DeblurOptions {
    DeblurOptions {
        world: World::Cube,
        width: 256,
        height: 192,
        cameras: 9,
        held_out: 1,
        frames: 12,
        ..DeblurOptions::default()
    }
}

/// Makes the scene, trains it, reports.
///
/// # Errors
/// One sentence, when the disk does not take the files.
pub fn run(args: &DemoArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    let recipe = if args.still { STILL_RECIPE.to_vec() } else { RECIPE.to_vec() };
    let overrides = recipe.into_iter().map(String::from).chain(args.steps.map(|n| format!("steps={n}")));
    let config = Config::resolve(None, &overrides.collect::<Vec<_>>())?;
    let folder = RunFolder::vacant(args.out.clone().unwrap_or_else(|| next_folder("demo")))?;
    let dataset = folder.path().join("dataset");
    make(&dataset, args)?;
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

fn make(dataset: &Path, args: &DemoArgs) -> Result<()> {
    if args.still {
        demo_scene(dataset, &DemoOptions::default())?;
        print(format!("a synthetic scene is in {}; training on it takes a minute or two", dataset.display()));
        return Ok(());
    }
    if !args.quiet {
        print("tracing a small world with motion blur ...");
    }
    let bar = crate::commands::synth::bar();
    deblur::write(dataset, &video(), |done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    print(format!("blurry video of it is in {}; training on it takes a minute or two", dataset.display()));
    Ok(())
}
