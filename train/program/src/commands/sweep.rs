//! `gsburn sweep`: on each data set a run for every combination of some values, and their comparison.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use burn::tensor::Device;
use gs_base::{printable, write_atomic};

use crate::cli::SweepArgs;
use crate::commands::planned::{Planned, State, Sweep, say, sweeps};
use crate::commands::train::{job, train_and_report};
use crate::commands::{choose, device, print};
use crate::report::comparison::{Gathered, Table, chart, enough, gather};
use gs_train::run::folder::RunFolder;
use gs_train::run::lock::Lock;
use gs_train::run::resources::forget_peak_memory;
use gs_train::run::watch::{Ending, Job};
use gs_train::run::{interrupt, outputs, results};

/// The files beside the runs.
const FILES: [&str; 3] = ["chart.svg", "chart.md", "chart.csv"];

/// A page that earlier versions wrote beside them.
const EARLIER: &str = "index.html";

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
    results::check_own(&args.out, |path| is_own(path) || several && results::check_own(path, is_own).is_ok())?;
    let _lock = Lock::of_results(&args.out)?;
    interrupt::watch();
    for sweep in &sweeps {
        if several {
            say(args, &format!("data set {}", sweep.dataset.display()));
        }
        if !train(sweep, &device)? {
            eprintln!("stopped; the same command continues");
            return Ok(ExitCode::from(interrupt::exit_code()));
        }
        let found = compare(sweep)?;
        if args.choose.is_some() {
            choose::choose(sweep, &found.runs, &device)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether something in the folder of a sweep is its own: a run, begun or not, or a file of a comparison.
fn is_own(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let is_file = FILES.contains(&name) || [choose::FILE, EARLIER].contains(&name);
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
        resume: run.state == State::Begun,
        quiet: sweep.args.quiet,
        ..job(sweep.dataset.to_path_buf(), &run.config, run.folder.clone(), device.clone())
    };
    match train_and_report(run.config.pipeline, &job)? {
        Ending::Finished(eval) => {
            say(sweep.args, &eval.last.line());
            Ok(true)
        }
        Ending::Interrupted(_) => Ok(false),
    }
}

/// Writes chart and table of a data set, and returns its runs.
fn compare(sweep: &Sweep<'_>) -> Result<Gathered> {
    let paths: Vec<PathBuf> = sweep.runs.iter().map(|run| run.folder.path().to_path_buf()).collect();
    let found = gather(&paths)?;
    found.warnings.iter().for_each(|warning| eprintln!("warning: {}", printable(warning)));
    let table = Table::new(&found.runs);
    print(format!("{}\n", table.text()));
    if let Some(verdict) = enough(&found.runs) {
        print(verdict);
    }
    let [svg, markdown, csv] = FILES.map(|name| sweep.out.join(name));
    write_atomic(&svg, outputs::marked_svg(&chart(&found.runs).svg()).as_bytes())?;
    write_atomic(&markdown, outputs::marked_markdown(&table.markdown()).as_bytes())?;
    write_atomic(&csv, table.csv().as_bytes())?;
    print(format!("chart  {}\ntable  {}", svg.display(), markdown.display()));
    Ok(found)
}
