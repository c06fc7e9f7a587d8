//! The plan of a sweep: for each data set its runs, their folders and their progress.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

use crate::cli::SweepArgs;
use crate::commands::combinations::{Combination, combinations};
use gs_pipelines::{Resolved, Sources, resolve, resolve_saved};
use gs_train::run::folder::{RunFolder, full_path};

/// Progress of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum State {
    New,
    Begun,
    Finished,
}

/// A run of a sweep.
pub(super) struct Planned {
    /// Its folder.
    pub folder: RunFolder,
    /// Its configuration.
    pub config: Resolved,
    /// Its progress.
    pub state: State,
}

/// The runs on one data set.
pub(super) struct Sweep<'a> {
    /// The arguments.
    pub args: &'a SweepArgs,
    /// The data set.
    pub dataset: &'a Path,
    /// Folder of the runs and of their comparison.
    pub out: PathBuf,
    /// The runs.
    pub runs: Vec<Planned>,
}

/// The sweep of each data set; of several, each has a folder of its own.
///
/// # Errors
/// One sentence: a value that is not valid, a folder that holds another run, no data set.
pub(super) fn sweeps(args: &SweepArgs) -> Result<Vec<Sweep<'_>>> {
    let (sets, recipes) = (args.datasets.len(), args.recipe.len());
    if recipes > 1 && recipes != sets {
        bail!("--recipe: expected one name, or one for each of {sets} data sets, found {recipes}");
    }
    let mut sweeps: Vec<Sweep<'_>> = Vec::new();
    for (i, dataset) in args.datasets.iter().enumerate() {
        if !dataset.exists() {
            bail!("{}: expected a data set, found nothing", dataset.display());
        }
        let out = match sets {
            1 => args.out.clone(),
            _ => args.out.join(RunFolder::at(full_path(dataset)).name()),
        };
        if let Some(other) = sweeps.iter().find(|other| other.out == out) {
            let [one, two] = [other.dataset, dataset].map(Path::display);
            bail!("{one} and {two} would have the folder {}; sweep them one by one", out.display());
        }
        let recipe = args.recipe.get(i).or(args.recipe.first()).map(String::as_str);
        let runs = planned(args, dataset, recipe, &out)?;
        sweeps.push(Sweep { args, dataset, out, runs });
    }
    Ok(sweeps)
}

/// The runs on a data set. A change that changes nothing (the recipe's own value) is left out.
fn planned(args: &SweepArgs, dataset: &Path, recipe: Option<&str>, out: &Path) -> Result<Vec<Planned>> {
    let mut runs: Vec<Planned> = Vec::new();
    for combination in combinations(args, recipe)? {
        let Combination { name, file, recipe, overrides } = combination;
        let sources = Sources { file: file.as_deref(), recipe: recipe.as_deref(), overrides: &overrides };
        let config = resolve(sources)?;
        let folder = RunFolder::at(out.join(&name));
        let same = runs.iter().find(|other| other.config.text == config.text);
        if let Some(other) = same.filter(|_| args.one_at_a_time) {
            say(args, &format!("{name}: has the configuration of {}; left out", other.folder.name()));
            continue;
        }
        let state = state(&folder, &config, dataset)?;
        runs.push(Planned { folder, config, state });
    }
    Ok(runs)
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

/// A line of progress, unless the sweep is to be quiet.
pub(super) fn say(args: &SweepArgs, line: &str) {
    if !args.quiet {
        eprintln!("{line}");
    }
}
