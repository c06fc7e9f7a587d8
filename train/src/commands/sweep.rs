//! `gsburn sweep`: a run for every combination of some values, and their comparison.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};
use burn::tensor::Device;
use gs_datasets::image_io::write_atomic;
use gs_datasets::printable;

use crate::cli::SweepArgs;
use crate::commands::combinations::{Combination, combinations};
use crate::commands::{choose, command_line, describe, device, in_markdown, marked, print};
use crate::pipelines::{Resolved, Sources, resolve, resolve_saved};
use crate::report::comparison::{Gathered, Panels, Table, enough, gather, page, soonest, stacked};
use crate::run::folder::{RunFolder, full_path};
use crate::run::interrupt;
use crate::run::outputs;
use crate::run::resources::forget_peak_memory;
use crate::run::watch::{Ending, Job};

/// Progress of a combination.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    New,
    Begun,
    Finished,
}

/// A planned run: its folder, configuration and progress.
type Planned = (RunFolder, Resolved, State);

/// Trains the combinations that are not finished yet, then compares all.
///
/// # Errors
/// One sentence: a value that is not valid, a folder that holds another run, bad data, a full disk.
pub fn run(args: &SweepArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    if !args.dataset.exists() {
        bail!("{}: expected a data set, found nothing", args.dataset.display());
    }
    // Every argument is checked here, before the first of many hours of training.
    let plan = planned(args)?;
    let choice = args.choose.map(|_| choose::FILE);
    let files = ["chart.svg", "chart.md", "chart.csv", "index.html"].into_iter().chain(choice);
    outputs::check(&files.map(|name| args.out.join(name)).collect::<Vec<_>>(), &[])?;
    if let (Some(_), Some((_, config, _))) = (args.choose, plan.first()) {
        choose::check_split(args, config)?;
    }
    interrupt::watch();
    for (i, (folder, config, state)) in plan.iter().enumerate() {
        let place = format!("run {} of {}: {}", i + 1, plan.len(), folder.name());
        if *state == State::Finished {
            say(args, &format!("{place}: finished already"));
            continue;
        }
        say(args, &place);
        if interrupt::asked() || !finishes(args, folder, config, *state, &device)? {
            eprintln!("stopped; the same command continues");
            return Ok(ExitCode::from(interrupt::exit_code()));
        }
    }
    let found = compare(&args.out, &plan)?;
    if args.choose.is_some() {
        let plan: Vec<(&RunFolder, &Resolved)> = plan.iter().map(|(folder, config, _)| (folder, config)).collect();
        choose::choose(args, &found.runs, &plan, &device)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The runs of a sweep. A change that changes nothing (the recipe's own value) is left out.
fn planned(args: &SweepArgs) -> Result<Vec<Planned>> {
    let mut plan: Vec<Planned> = Vec::new();
    for combination in combinations(args)? {
        let Combination { name, file, recipe, overrides } = combination;
        let sources = Sources { file: file.as_deref(), recipe: recipe.as_deref(), overrides: &overrides };
        let config = resolve(sources)?;
        let folder = RunFolder::at(args.out.join(&name));
        let same = plan.iter().find(|(_, other, _)| other.text == config.text);
        if let Some((other, ..)) = same.filter(|_| args.one_at_a_time) {
            say(args, &format!("{name}: has the configuration of {}; left out", other.name()));
            continue;
        }
        let state = state(&folder, &config, &args.dataset)?;
        plan.push((folder, config, state));
    }
    Ok(plan)
}

/// Trains one combination; `false` when it was interrupted.
fn finishes(args: &SweepArgs, folder: &RunFolder, config: &Resolved, state: State, device: &Device) -> Result<bool> {
    if !forget_peak_memory() {
        tracing::warn!("the system does not reset the peak of memory: each run shows the largest so far");
    }
    let job = Job {
        dataset: args.dataset.clone(),
        config: config.config.clone(),
        folder: folder.clone(),
        device: device.clone(),
        more_devices: Vec::new(),
        device_name: describe(device),
        resume: state == State::Begun,
        stop_at: None,
        quiet: args.quiet,
    };
    Ok(matches!(config.pipeline.train(&job)?, Ending::Finished(_)))
}

/// Writes chart, tables and page, and returns the runs.
fn compare(out: &Path, plan: &[Planned]) -> Result<Gathered> {
    let paths: Vec<PathBuf> = plan.iter().map(|(folder, ..)| folder.path().to_path_buf()).collect();
    let found = gather(&paths)?;
    found.warnings.iter().for_each(|warning| eprintln!("warning: {}", printable(warning)));
    let (panels, table, command) = (Panels::new(&found.runs), Table::new(&found.runs), command_line());
    let times = soonest(&found.runs, &[]);
    print(table.text());
    times.iter().for_each(|table| print(format!("\n{}", table.text())));
    if let Some(verdict) = enough(&found.runs) {
        print(verdict);
    }
    write_atomic(&out.join("chart.svg"), stacked(&panels, &command).as_bytes())?;
    write_atomic(&out.join("chart.md"), marked(&in_markdown(std::iter::once(&table).chain(&times))).as_bytes())?;
    write_atomic(&out.join("chart.csv"), table.csv().as_bytes())?;
    let index = out.join("index.html");
    let tables: Vec<Table> = std::iter::once(table.linked(&found.runs)).chain(times).collect();
    write_atomic(&index, page(&RunFolder::at(out).name(), &panels, &tables, &found.warnings, &command).as_bytes())?;
    print(format!("chart  {}\npage   {}", out.join("chart.svg").display(), index.display()));
    Ok(found)
}

fn say(args: &SweepArgs, line: &str) {
    if !args.quiet {
        eprintln!("{line}");
    }
}

/// Progress of the run in `folder`.
fn state(folder: &RunFolder, config: &Resolved, dataset: &Path) -> Result<State> {
    if !folder.config().exists() {
        RunFolder::vacant(folder.path())?;
        return Ok(State::New);
    }
    let (found, trained_on) = folder.read_config()?;
    let same = resolve_saved(&found, "config.toml").is_ok_and(|found| found.text == config.text);
    let wanted = full_path(dataset);
    if !same || trained_on != wanted {
        bail!(
            "{}: holds a run with another {}; choose another folder with --out",
            folder.path().display(),
            if same { "data set" } else { "configuration" }
        );
    }
    let finished = folder.read_eval().is_ok_and(|eval| eval.last.step >= eval.steps);
    Ok(if finished { State::Finished } else { State::Begun })
}
