//! `gsburn demo`.

use std::path::Path;
use std::process::ExitCode;

use anyhow::Result;
use gs_datasets::synthetic::deblur::{self, DeblurOptions, World};
use gs_datasets::synthetic::{DemoOptions, demo_scene};

use crate::cli::DemoArgs;
use crate::commands::train::{execute, next_folder};
use crate::commands::{device, print};
use crate::pipelines::{DEMO_RECIPES, Sources, resolve};
use crate::run::folder::RunFolder;
use crate::run::watch::Job;

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
/// One sentence: a full disk, for one.
pub fn run(args: &DemoArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    let [moving, still] = DEMO_RECIPES;
    let recipe = if args.still { still } else { moving };
    let overrides: Vec<String> = args.steps.map(|n| format!("steps={n}")).into_iter().collect();
    let resolved = resolve(Sources { recipe: Some(recipe), overrides: &overrides, ..Sources::default() })?;
    let folder = RunFolder::vacant(args.out.clone().unwrap_or_else(|| next_folder("demo")))?;
    let dataset = folder.path().join("dataset");
    make(&dataset, args)?;
    let device_name = crate::commands::describe(&device);
    let job = Job {
        dataset,
        config: resolved.config,
        folder,
        device,
        device_name,
        resume: false,
        stop_at: None,
        quiet: args.quiet,
    };
    execute(resolved.pipeline, &job)
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
