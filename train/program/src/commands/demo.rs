//! `gsburn demo`.

use std::path::Path;
use std::process::ExitCode;

use anyhow::Result;
use burn::tensor::Device;
use gs_worlds::deblur::{self, DeblurOptions, World};
use gs_worlds::still::{self, StillOptions};

use gs_worlds::driving::{StreetOptions, write as street_log};

use crate::cli::DemoArgs;
use crate::commands::synth::with_bar;
use crate::commands::train::{execute, job, next_folder};
use crate::commands::{device, print};
use crate::report::viewer;
use gs_pipelines::{DEMO_RECIPES, Reconstruction, Sources, networks_of, resolve, shipped};
use gs_train::run::folder::RunFolder;
use gs_train::run::watch::Job;

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
    if args.driving {
        return driving(args, &device);
    }
    let [moving, still] = DEMO_RECIPES;
    let recipe = if args.still { still } else { moving };
    let overrides: Vec<String> = args.steps.map(|n| format!("steps={n}")).into_iter().collect();
    let resolved = resolve(Sources { recipe: Some(recipe), overrides: &overrides, ..Sources::default() })?;
    let folder = RunFolder::vacant(args.out.clone().unwrap_or_else(|| next_folder("demo")))?;
    let dataset = folder.path().join("dataset");
    make(&dataset, args)?;
    execute(resolved.pipeline, &Job { quiet: args.quiet, ..job(dataset, &resolved, folder, device) })
}

/// A street that the shipped network has not seen, as logs are: two seconds of a front camera and a LiDAR.
fn street() -> StreetOptions {
    StreetOptions { frames: 22, cameras: 1, seed: UNSEEN, ..StreetOptions::default() }
}

/// The seed of a street that is none of those that the network was trained on.
const UNSEEN: u64 = 1000;

/// Makes a street and reconstructs it.
fn driving(args: &DemoArgs, device: &Device) -> Result<ExitCode> {
    let folder = RunFolder::vacant(args.out.clone().unwrap_or_else(|| next_folder("demo")))?;
    let (log, out) = (folder.path().join("street"), folder.path().join("reconstruction"));
    if !args.quiet {
        print("tracing a street with moving traffic ...");
    }
    with_bar(|progress| street_log(&log, &street(), progress))?;
    print(format!("a driving log is in {}; its reconstruction takes seconds", log.display()));
    let request = Reconstruction {
        log: &log,
        set: &[],
        out: &out,
        start: 0,
        full: false,
        future: 5,
        times: &[],
        polish: 0,
        shift: [0.0; 3],
        rest_speed: None,
        edit: None,
        page: viewer::page_of,
        device,
    };
    let network = shipped()?;
    for line in networks_of(&network)?.reconstruct(&network, &request)? {
        print(line);
    }
    print(format!("the log's own images are in {}", log.join("camera").display()));
    Ok(ExitCode::SUCCESS)
}

fn make(dataset: &Path, args: &DemoArgs) -> Result<()> {
    if args.still {
        still::write(dataset, &StillOptions::default(), |_, _| ())?;
        print(format!("a synthetic scene is in {}; training on it takes a minute or two", dataset.display()));
        return Ok(());
    }
    if !args.quiet {
        print("tracing a small world with motion blur ...");
    }
    with_bar(|progress| deblur::write(dataset, &video(), progress))?;
    print(format!("blurry video of it is in {}; training on it takes a minute or two", dataset.display()));
    Ok(())
}
