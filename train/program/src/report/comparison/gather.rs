//! Reads the named runs, and gives the reason for each that cannot be compared.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

use super::ComparedRun;
use gs_train::config::tables::flat;
use gs_train::run::folder::RunFolder;
use gs_train::sentence::one_sentence;

/// The runs that could be read.
#[derive(Debug)]
pub struct Gathered {
    /// At least one run, all on one data set.
    pub runs: Vec<ComparedRun>,
    /// One sentence for each run that is left out.
    pub warnings: Vec<String>,
}

/// Reads the runs at `paths`. Left out, with a warning, are folders without figures, unfinished runs, and runs on
/// another data set than most (on a tie, than the first). Files that are not folders are skipped, so that `runs/*` may
/// match what a chart wrote there.
///
/// # Errors
/// When nothing is left; the sentence gives the reason for the first.
pub fn gather(paths: &[PathBuf]) -> Result<Gathered> {
    let mut warnings = Vec::new();
    let mut found: Vec<(ComparedRun, PathBuf)> = Vec::new();
    for path in paths.iter().filter(|path| !path.is_file()) {
        match read(path) {
            Ok(run) => found.push(run),
            Err(reason) => warnings.push(format!("{}: {reason}; left out", path.display())),
        }
    }
    let count = |dataset: &Path| found.iter().filter(|(_, other)| other == dataset).count();
    // `max_by_key` returns the last of equal maxima, hence the reversal.
    let usual = found.iter().rev().max_by_key(|(_, dataset)| count(dataset)).map(|(_, dataset)| dataset.clone());
    let Some(usual) = usual else {
        match warnings.first() {
            Some(first) => bail!("no run can be charted: {first}"),
            None => bail!("no run can be charted: expected run folders, found only files"),
        }
    };
    let (same, other): (Vec<_>, Vec<_>) = found.into_iter().partition(|(_, dataset)| *dataset == usual);
    warnings.extend(other.iter().map(|(run, dataset)| {
        let path = run.folder.path().display();
        format!("{path}: trained on {}, the others on {}; left out", dataset.display(), usual.display())
    }));
    let mut runs: Vec<ComparedRun> = same.into_iter().map(|(run, _)| run).collect();
    tell_apart(&mut runs);
    Ok(Gathered { runs, warnings })
}

/// The run and its data set, or the reason why it cannot be compared.
fn read(path: &Path) -> Result<(ComparedRun, PathBuf), String> {
    let folder = RunFolder::at(path);
    let eval = folder.read_eval().map_err(|error| {
        // A file that exists and cannot be parsed has an error of its own.
        match (path.exists(), folder.eval().exists()) {
            (false, _) => "expected a run folder, found nothing".into(),
            (true, false) => "cannot read its eval.json, no figures yet".into(),
            (true, true) => one_sentence(&error),
        }
    })?;
    if eval.last.step < eval.steps {
        return Err(format!("unfinished, stopped after step {} of {}", eval.last.step, eval.steps));
    }
    let (values, dataset) = match folder.read_config() {
        Ok((config, dataset)) => (flat(&config).into_iter().collect::<BTreeMap<_, _>>(), dataset),
        Err(error) => return Err(one_sentence(&error)),
    };
    Ok((ComparedRun { name: eval.name.clone(), folder, values, eval }, dataset))
}

/// Replaces equal names by paths.
fn tell_apart(runs: &mut [ComparedRun]) {
    let names: Vec<String> = runs.iter().map(|run| run.name.clone()).collect();
    for run in runs {
        if names.iter().filter(|name| **name == run.name).count() > 1 {
            run.name = run.folder.path().display().to_string();
        }
    }
}
