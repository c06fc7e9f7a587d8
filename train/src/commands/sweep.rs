//! `gsburn sweep`: on each data set a run for every combination of some values, and their comparison.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use burn::tensor::Device;
use gs_base::{printable, write_atomic};

use crate::cli::SweepArgs;
use crate::commands::planned::{Planned, State, Sweep, say, sweeps};
use crate::commands::train::train_and_report;
use crate::commands::{choose, command_line, describe, device, in_markdown, marked, print};
use crate::report;
use crate::report::comparison::{Comparison, Gathered, enough, gather, page, stacked};
use crate::run::folder::RunFolder;
use crate::run::lock::Lock;
use crate::run::resources::forget_peak_memory;
use crate::run::watch::{Ending, Job};
use crate::run::{interrupt, outputs, results};

/// The files of a comparison.
const FILES: [&str; 4] = ["chart.svg", "chart.md", "chart.csv", "index.html"];

/// Trains the combinations that are not finished yet, data set by data set, and compares those of each.
///
/// # Errors
/// One sentence: a value that is not valid, a folder that holds another run, bad data, a full disk.
pub fn run(args: &SweepArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    // Every argument is checked here, before the first of many hours of training.
    let sweeps = sweeps(args)?;
    let choice = args.choose.map(|_| choose::FILE);
    let several = sweeps.len() > 1;
    for sweep in &sweeps {
        let files = FILES.into_iter().chain(choice);
        outputs::check(&files.map(|name| sweep.out.join(name)).collect::<Vec<_>>(), &[])?;
        if let (Some(_), Some(first)) = (args.choose, sweep.runs.first()) {
            choose::check_split(sweep, &first.config)?;
        }
    }
    if several {
        outputs::check(&["chart.svg", "index.html"].map(|name| args.out.join(name)), &[])?;
    }
    results::check_own(&args.out, |path| is_own(path) || several && results::check_own(path, is_own).is_ok())?;
    let _lock = Lock::of_results(&args.out)?;
    interrupt::watch();
    let mut compared = Vec::new();
    for sweep in &sweeps {
        if several {
            say(args, &format!("data set {}", sweep.dataset.display()));
        }
        if !train(sweep, &device)? {
            eprintln!("stopped; the same command continues");
            return Ok(ExitCode::from(interrupt::exit_code()));
        }
        let (found, comparison) = compare(sweep)?;
        if args.choose.is_some() {
            choose::choose(sweep, &found.runs, &device)?;
        }
        compared.push(comparison);
    }
    if several {
        let command = command_line();
        let chart = args.out.join("chart.svg");
        let index = args.out.join("index.html");
        write_atomic(&chart, stacked(compared.iter().flat_map(|one| &one.panels.charts), &command).as_bytes())?;
        write_atomic(&index, page(&RunFolder::at(&args.out).name(), &compared, &command).as_bytes())?;
        print(format!("all: chart  {}\n     page   {}", chart.display(), index.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether something in the folder of a sweep is its own: a run, begun or not, or a file of a comparison.
fn is_own(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let is_file = FILES.contains(&name) || name == choose::FILE;
    match path.is_dir() {
        true => RunFolder::at(path).config().is_file() || RunFolder::vacant(path).is_ok(),
        false => is_file && outputs::check_one(path).is_ok(),
    }
}

/// Trains what is not finished; `false` when it was interrupted.
fn train(sweep: &Sweep<'_>, device: &Device) -> Result<bool> {
    let count = sweep.runs.len();
    for (i, run) in sweep.runs.iter().enumerate() {
        let place = format!("run {} of {count}: {}", i + 1, run.folder.name());
        if run.state == State::Finished {
            say(sweep.args, &format!("{place}: finished already"));
            continue;
        }
        say(sweep.args, &place);
        if interrupt::asked() || !finishes(sweep, run, device)? {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Trains one run; `false` when it was interrupted.
fn finishes(sweep: &Sweep<'_>, run: &Planned, device: &Device) -> Result<bool> {
    if !forget_peak_memory() {
        tracing::warn!("the system does not reset the peak of memory: each run shows the largest so far");
    }
    let job = Job {
        dataset: sweep.dataset.to_path_buf(),
        config: run.config.config.clone(),
        folder: run.folder.clone(),
        device: device.clone(),
        more_devices: Vec::new(),
        device_name: describe(device),
        resume: run.state == State::Begun,
        stop_at: None,
        quiet: sweep.args.quiet,
        schedule_svg: Some(report::schedule_svg),
    };
    match train_and_report(run.config.pipeline, &job)? {
        Ending::Finished(eval) => {
            say(sweep.args, &eval.last.line());
            Ok(true)
        }
        Ending::Interrupted(_) => Ok(false),
    }
}

/// Writes chart, tables and page of a data set, and returns its runs and their comparison.
fn compare(sweep: &Sweep<'_>) -> Result<(Gathered, Comparison)> {
    let paths: Vec<PathBuf> = sweep.runs.iter().map(|run| run.folder.path().to_path_buf()).collect();
    let found = gather(&paths)?;
    found.warnings.iter().for_each(|warning| eprintln!("warning: {}", printable(warning)));
    let compared = Comparison::new(&found, &[]).linked(&found.runs, &sweep.out);
    compared.tables.iter().for_each(|table| print(format!("{}\n", table.text())));
    if let Some(verdict) = enough(&found.runs) {
        print(verdict);
    }
    let (command, out) = (command_line(), &sweep.out);
    write_atomic(&out.join("chart.svg"), stacked(&compared.panels.charts, &command).as_bytes())?;
    write_atomic(&out.join("chart.md"), marked(&in_markdown(&compared.tables)).as_bytes())?;
    write_atomic(&out.join("chart.csv"), compared.tables[0].csv().as_bytes())?;
    let index = out.join("index.html");
    let name = RunFolder::at(out).name();
    write_atomic(&index, page(&name, std::slice::from_ref(&compared), &command).as_bytes())?;
    print(format!("chart  {}\npage   {}", out.join("chart.svg").display(), index.display()));
    let compared = compared.linked(&found.runs, &sweep.args.out).of(&name);
    Ok((found, compared))
}
