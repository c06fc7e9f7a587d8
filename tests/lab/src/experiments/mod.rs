//! Experiments at the limits of a method: where does it fail, and does it fail as little as it should?
//!
//! Each experiment asks one question, measures on small synthetic worlds or by arithmetic alone, draws a figure and
//! compares its findings with a bound that was set before. A missed bound is marked in the figure's title and in the
//! report. Runs go through the same [`Session`](gs_train::fit::session::Session) as `gsburn train`, step by step, so
//! that an experiment can change the state between steps (reverse the velocities, say).

pub mod command;
pub mod findings;
pub mod flux4d;
pub mod lab;
mod page;
pub mod sparsedyn;
pub mod taylormode;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Result, bail};
use burn::tensor::Device;
use gs_base::write_atomic;
use gs_train::run::lock::Lock;
use gs_train::run::outputs::{self, MARK, marked_svg};
use gs_train::run::{interrupt, results};
use serde::Serialize;

pub use findings::{Findings, Outcome, largest, smallest};
pub use gsburn::report::charts::Series;
pub use lab::{Interrupted, Lab};

/// The pipelines with their experiments.
pub const PIPELINES: [(&str, &[Experiment]); 3] = [
    ("taylormode", &taylormode::EXPERIMENTS),
    ("sparsedyn", &sparsedyn::EXPERIMENTS),
    ("flux4d", &flux4d::EXPERIMENTS),
];

/// One experiment.
pub struct Experiment {
    /// Its name on the command line and in file names.
    pub name: &'static str,
    pub question: &'static str,
    /// Trainings, full and quick; used for the time left.
    pub runs: [usize; 2],
    /// Steps of each, full and quick.
    pub steps: [usize; 2],
    /// Whether it runs only if it is named, because it takes long.
    pub on_request: bool,
    pub run: fn(&Lab, &mut Findings) -> Result<()>,
}

impl Experiment {
    /// An experiment that trains nothing.
    const fn new(name: &'static str, question: &'static str, run: fn(&Lab, &mut Findings) -> Result<()>) -> Self {
        Self { name, question, runs: [0; 2], steps: [0; 2], on_request: false, run }
    }

    /// The experiment trains as often, each time so many steps, full and quick.
    const fn trains(self, runs: [usize; 2], steps: [usize; 2]) -> Self {
        Self { runs, steps, ..self }
    }

    /// The experiment runs only if it is named.
    const fn on_request(self) -> Self {
        Self { on_request: true, ..self }
    }
}

/// A list of experiments. Each has its question as a comment; then come its name, the function that runs it and, where
/// it trains, its trainings and the steps of each, full and quick.
macro_rules! experiments {
    ($($(#[doc = $question:literal])+ $name:literal: $run:path
        $(, $runs:tt of $steps:tt)? $(, $on_request:ident)?;)+) => {
        [$($crate::experiments::Experiment::new($name, concat!($($question),+).trim_ascii(), $run)
            $(.trains($runs, $steps))? $(.$on_request())?),+]
    };
}
use experiments;

/// The experiments to run.
#[derive(Debug, Clone)]
pub struct Request {
    /// Folder for worlds, figures, results.json and stability.html.
    pub out: PathBuf,
    /// Names of the experiments; empty: all.
    pub only: Vec<String>,
    /// The user's data set, on which experiments that can use one run too.
    pub data: Option<PathBuf>,
    /// Fewer variants and steps: a first impression, not a measurement.
    pub quick: bool,
    /// The compute device (without autodiff).
    pub device: Device,
    /// Show nothing on the terminal.
    pub quiet: bool,
}

/// The content of results.json.
#[derive(Debug, Serialize)]
struct Results<'a> {
    /// [`MARK`], so that later experiments may write over the file.
    program: &'static str,
    experiments: &'a [Outcome],
}

/// Name of the file with all findings.
const RESULTS: &str = "results.json";
/// Name of the report.
const REPORT: &str = "stability.html";

/// Runs experiments of a pipeline; after each, its figures, results.json and stability.html are written with everything
/// so far.
///
/// # Errors
/// One sentence: an unknown name, a file of somebody else in the way, a full disk, a request to end.
pub fn run(pipeline: &str, experiments: &'static [Experiment], request: &Request) -> Result<Vec<Outcome>> {
    let chosen = chosen(experiments, &request.only)?;
    outputs::check(&files(&request.out, &chosen), &[])?;
    let _lock = begun(pipeline, request)?;
    let part = usize::from(request.quick);
    let total = chosen.iter().map(|experiment| experiment.runs[part] * experiment.steps[part]).sum();
    let lab = Lab::new(request, total);
    let mut outcomes = Vec::new();
    for experiment in chosen {
        lab.enter(experiment);
        let begun = Instant::now();
        let mut found = Findings::default();
        (experiment.run)(&lab, &mut found)?;
        let outcome = Outcome::new(experiment, found, begun.elapsed().as_secs_f64());
        for figure in &outcome.figures {
            write_atomic(&request.out.join(&figure.file), marked_svg(&figure.svg).as_bytes())?;
        }
        lab.say(&outcome.line());
        outcomes.push(outcome);
        write(pipeline, request, &outcomes)?;
        // An experiment of arithmetic alone has no steps between which it could end.
        if interrupt::asked() {
            lab.leave();
            return Err(Interrupted.into());
        }
    }
    lab.leave();
    Ok(outcomes)
}

/// The lock of the folder, which holds an earlier result of experiments or nothing. By a list without findings it is
/// known from here on, as the worlds in it are made long before the first finding.
fn begun(pipeline: &str, request: &Request) -> Result<Lock> {
    let known = request.out.join(RESULTS);
    results::check_own(&request.out, |_| known.is_file())?;
    let lock = Lock::of_results(&request.out)?;
    if !known.is_file() {
        write(pipeline, request, &[])?;
    }
    Ok(lock)
}

/// The named experiments, or all that need not be named.
fn chosen(experiments: &'static [Experiment], only: &[String]) -> Result<Vec<&'static Experiment>> {
    let names: Vec<&str> = experiments.iter().map(|experiment| experiment.name).collect();
    if let Some(unknown) = only.iter().find(|name| !names.contains(&name.as_str())) {
        bail!("--only: expected names from {}, found {unknown:?}", names.join(", "));
    }
    let wanted = |experiment: &&Experiment| match only {
        [] => !experiment.on_request,
        only => only.iter().any(|name| name == experiment.name),
    };
    Ok(experiments.iter().filter(wanted).collect())
}

/// The files in `out` that these experiments may write over. The name of a figure begins with that of its experiment.
fn files(out: &Path, chosen: &[&Experiment]) -> Vec<PathBuf> {
    let is_figure = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str()).and_then(|name| name.strip_suffix(".svg"));
        let rests =
            |name: &str| chosen.iter().filter_map(|experiment| name.strip_prefix(experiment.name)).any(is_suffix);
        name.is_some_and(rests)
    };
    let present = fs::read_dir(out).into_iter().flatten().flatten().map(|entry| entry.path());
    [RESULTS, REPORT].map(|name| out.join(name)).into_iter().chain(present.filter(is_figure)).collect()
}

/// Whether a figure's name may go on in this way behind that of its experiment.
fn is_suffix(rest: &str) -> bool {
    rest.is_empty() || rest.starts_with('-')
}

fn write(pipeline: &str, request: &Request, outcomes: &[Outcome]) -> Result<()> {
    let results = Results { program: MARK, experiments: outcomes };
    let json = serde_json::to_string_pretty(&results).expect("figures are JSON") + "\n";
    write_atomic(&request.out.join(RESULTS), json.as_bytes())?;
    Ok(write_atomic(&request.out.join(REPORT), page::html(pipeline, outcomes, request.quick).as_bytes())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    static ALL: [Experiment; 2] = [
        Experiment::new("depth", "", |_, _| bail!("not run")),
        Experiment::new("long", "", |_, _| bail!("not run")).on_request(),
    ];

    #[test]
    fn files_of_others_are_named_before_anything_runs() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        for name in ["depth.svg", "depth-a.svg", "deeper.svg", "long.svg", "depth.png"] {
            fs::write(at(name), "<svg/>").expect("written");
        }
        let mut found = files(folder.path(), &[&ALL[0]]);
        found.sort();
        assert_eq!(found, ["depth-a.svg", "depth.svg", RESULTS, REPORT].map(at));
    }

    #[test]
    fn names_are_checked() {
        let names = |only: &[&str]| -> Result<Vec<&str>> {
            let only: Vec<String> = only.iter().map(|name| name.to_string()).collect();
            Ok(chosen(&ALL, &only)?.into_iter().map(|experiment| experiment.name).collect())
        };
        assert_eq!(names(&[]).expect("all"), ["depth"]);
        assert_eq!(names(&["long"]).expect("one"), ["long"]);
        let message = names(&["deepth"]).expect_err("unknown").to_string();
        assert!(message.contains("deepth") && message.contains("depth, long"), "{message}");
    }
}
