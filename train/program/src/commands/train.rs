//! `gsburn train`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};
use burn::tensor::Device;
use gs_burn::device;

use crate::cli::{ConfigArgs, TrainArgs};
use crate::commands::{device as chosen, missing, print};
use crate::report;
use gs_pipelines::{Pipeline, Resolved, Sources, resolve as resolve_sources, resolve_saved};
use gs_train::config::ConfigError;
use gs_train::run::folder::{EvalFile, RunFolder, full_path};
use gs_train::run::interrupt;
use gs_train::run::profile::{self, Profile};
use gs_train::run::watch::{Ending, Job};

/// Folder of all runs by default.
pub(super) const RUNS: &str = "runs";

/// Trains a new run, or resumes one.
///
/// # Errors
/// One sentence about the arguments, the data or the disk.
pub fn run(args: &TrainArgs) -> Result<ExitCode> {
    let device = chosen(&args.device)?;
    let more_devices = device::beside(&args.device.device, args.devices)?;
    if args.profile {
        profile::begin(&device);
    }
    let (pipeline, mut job) = if args.resume { resumed(args, device)? } else { begun(args, device)? };
    job.more_devices = more_devices;
    let ended = execute(pipeline, &job);
    if args.profile
        && ended.is_ok()
        && let Some(profile) = Profile::read(&job.folder)
    {
        print(format!("\n{}", profile.table()));
    }
    ended
}

/// Trains until the run ends or Ctrl-C is pressed, and prints the outcome.
pub(super) fn execute(pipeline: &dyn Pipeline, job: &Job) -> Result<ExitCode> {
    interrupt::watch();
    match train_and_report(pipeline, job)? {
        Ending::Finished(eval) => {
            print(verdict(&eval, &job.folder));
            Ok(ExitCode::SUCCESS)
        }
        Ending::Interrupted(step) => {
            let folder = job.folder.path().display();
            eprintln!("stopped and saved after step {step}; continue with: gsburn train --resume --out {folder}");
            Ok(ExitCode::from(interrupt::exit_code()))
        }
    }
}

/// Trains and draws the report.
///
/// # Errors
/// One sentence: bad data, a damaged checkpoint, a full disk.
pub fn train_and_report(pipeline: &dyn Pipeline, job: &Job) -> Result<Ending<EvalFile>> {
    match pipeline.train(job)? {
        Ending::Finished(outcome) => report::finish(&job.folder, outcome).map(Ending::Finished),
        Ending::Interrupted(step) => Ok(Ending::Interrupted(step)),
    }
}

fn begun(args: &TrainArgs, device: Device) -> Result<(&'static dyn Pipeline, Job)> {
    let dataset = args.dataset.clone().expect("clap asks for the data set unless --resume is given");
    let resolved = resolve(&args.config, &shortcuts(args))?;
    if !dataset.exists() {
        bail!("{}: expected a data set, found nothing", dataset.display());
    }
    let folder = match &args.out {
        Some(path) => RunFolder::vacant(path)?,
        None => RunFolder::vacant(next_folder(&stem(&dataset)))?,
    };
    let new = job(dataset, &resolved, folder, device);
    Ok((resolved.pipeline, Job { minutes: args.minutes, quiet: args.quiet, ..new }))
}

fn resumed(args: &TrainArgs, device: Device) -> Result<(&'static dyn Pipeline, Job)> {
    if args.config.is_typed() || !shortcuts(args).is_empty() {
        bail!(
            "--resume continues with the configuration saved in the run folder; leave out --config, --recipe, \
             --set, --steps, --cap and --seed"
        );
    }
    let folder = match (&args.out, &args.dataset) {
        (Some(path), _) => RunFolder::at(path),
        (None, Some(dataset)) => match newest_folder(&stem(dataset)) {
            Some(path) => RunFolder::at(path),
            None => bail!("{RUNS}/{}: expected a run to continue, found none", stem(dataset)),
        },
        (None, None) => {
            bail!("--resume needs to know what to continue: name the run folder with --out, or the data set")
        }
    };
    let (config, begun_on) = folder.read_config()?;
    let resolved = resolve_saved(&config, &folder.config().display().to_string())?;
    let dataset = args.dataset.clone().unwrap_or_else(|| begun_on.clone());
    if args.dataset.is_none() && !dataset.exists() {
        let (gone, folder) = (dataset.display(), folder.path().display());
        bail!(
            "{gone}: expected the data set that the run began on, found nothing; \
             if it was moved, continue with: gsburn train NEWPLACE --resume --out {folder}"
        );
    }
    // The data set may have been moved; the user sees whether it is another one.
    if full_path(&dataset) != begun_on {
        tracing::warn!("the run began on {} and goes on with {}", begun_on.display(), dataset.display());
    }
    let begun = job(dataset, &resolved, folder, device);
    Ok((resolved.pipeline, Job { resume: true, quiet: args.quiet, ..begun }))
}

/// A new training on one device, which shows its progress.
pub(super) fn job(dataset: PathBuf, resolved: &Resolved, folder: RunFolder, device: Device) -> Job {
    Job {
        dataset,
        config: resolved.config.clone(),
        folder,
        device_name: crate::commands::describe(&device),
        device,
        more_devices: Vec::new(),
        resume: false,
        stop_at: None,
        quiet: false,
        minutes: None,
        schedule_svg: Some(report::schedule_svg),
    }
}

/// The configuration of `args` with `more` overrides on top.
pub(super) fn resolve(args: &ConfigArgs, more: &[String]) -> Result<Resolved, ConfigError> {
    let overrides: Vec<String> = args.set.iter().chain(more).cloned().collect();
    resolve_sources(Sources { file: args.config.as_deref(), recipe: args.recipe.as_deref(), overrides: &overrides })
}

/// The short options as `--set` overrides.
fn shortcuts(args: &TrainArgs) -> Vec<String> {
    let steps = args.steps.map(|n| format!("steps={n}"));
    let cap = args.cap.map(|n| format!("density.cap={n}"));
    let seed = args.seed.map(|n| format!("seed={n}"));
    [steps, cap, seed].into_iter().flatten().collect()
}

/// The data set's name: its folder, or the folder of its file.
fn stem(dataset: &Path) -> String {
    let path = full_path(dataset);
    let folder = if path.is_file() { path.parent().unwrap_or(&path) } else { &path };
    folder.file_name().map_or_else(|| "scene".into(), |name| name.to_string_lossy().into_owned())
}

/// runs/NAME, or runs/NAME-2, -3, ... when there is one already.
pub(super) fn next_folder(name: &str) -> PathBuf {
    let numbered = (2..).map(|n| format!("{name}-{n}"));
    let names = std::iter::once(name.to_string()).chain(numbered);
    names.map(|name| Path::new(RUNS).join(name)).find(|path| !path.exists()).expect("one of endless names is free")
}

/// The newest of runs/NAME, runs/NAME-2, -3, ..., by the time its configuration was written.
fn newest_folder(name: &str) -> Option<PathBuf> {
    let is_run_of = |folder: &PathBuf| {
        let found = folder.file_name().and_then(|found| found.to_str()).and_then(|found| found.strip_prefix(name));
        found.is_some_and(|rest| rest.is_empty() || rest.strip_prefix('-').is_some_and(|n| n.parse::<usize>().is_ok()))
    };
    let begun = |folder: &PathBuf| fs::metadata(RunFolder::at(folder).config()).and_then(|file| file.modified()).ok();
    let folders = fs::read_dir(RUNS).into_iter().flatten().flatten().map(|entry| entry.path()).filter(is_run_of);
    folders.max_by(|a, b| begun(a).cmp(&begun(b)).then_with(|| a.cmp(b)))
}

/// Figures and paths printed after a finished run.
fn verdict(eval: &EvalFile, folder: &RunFolder) -> String {
    let quality = &eval.last.measured.quality;
    let missing: String = missing(quality).iter().map(|reason| format!("\n{reason}")).collect();
    let report = full_path(&folder.report());
    format!("{}{missing}\nscene  {}\nreport {}", eval.last.line(), folder.ply().display(), report.display())
}
