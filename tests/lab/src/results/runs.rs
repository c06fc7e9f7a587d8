//! The runs of a data file: trained where they are missing, read where they are finished.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use burn::tensor::Device;
use gs_base::guarded;
use gs_base::write_atomic;
use gs_burn::device::select;
use gs_pipelines::{Sources, resolve, resolve_saved};
use gs_train::run::folder::RunFolder;
use gs_train::run::watch::{Ending, Job};
use gs_train::run::{interrupt, outputs};
use gsburn::commands::describe;
use gsburn::commands::train::train_and_report;
use gsburn::report::comparison::gather;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Data, FILE_MAX};
use crate::comparison::{Comparison, Spread, stacked};

/// Trainings of one configuration, one for each seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    name: String,
    recipe: Option<String>,
    #[serde(default)]
    set: Vec<String>,
    data: PathBuf,
    /// The seeds; empty: those of the data file.
    #[serde(default)]
    seeds: Vec<u64>,
}

/// A figure of eval.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figure {
    /// Its place: `psnr`, `regions.moving.psnr`, `cpu_seconds`, `figures.exposure`.
    key: String,
    /// Digits behind the point.
    digits: usize,
}

/// Trains the missing runs of a data file into `out`, fills its rows and its commit, and draws its chart; `false` when
/// it was interrupted.
///
/// # Errors
/// One sentence: a configuration that is not valid, a folder that holds another run, bad data, a full disk.
pub fn fill(data: &mut Data, (root, name): (&Path, &str), out: &Path, device: &str) -> Result<bool> {
    let device = select(device)?;
    interrupt::watch();
    let (mut rows, mut folders) = (Vec::new(), Vec::new());
    for run in &data.runs {
        let seeds = if run.seeds.is_empty() { &data.seeds } else { &run.seeds };
        let mut evals = Vec::new();
        for seed in seeds {
            let folder = RunFolder::at(out.join(format!("{}_seed-{seed}", run.name)));
            if !finished(run, *seed, &folder, &device)? {
                return Ok(false);
            }
            let text = guarded::read_to_string(&folder.eval(), FILE_MAX)?;
            evals.push(serde_json::from_str(&text).with_context(|| folder.eval().display().to_string())?);
            folders.push(folder.path().to_path_buf());
        }
        let cells = data.figures.iter().map(|figure| cell(figure, &evals));
        rows.push(std::iter::once(run.name.clone()).chain(cells).collect());
    }
    data.rows = rows;
    data.commit = commit(root)?;
    data.command = format!("cargo run --release -p gs-lab -- results {name} --out {}", out.display());
    data.superseded = None;
    if let Some(chart) = &data.chart {
        let path = root.join(chart);
        outputs::check(std::slice::from_ref(&path), &[])?;
        let compared = Comparison::new(&gather(&folders)?, &[]);
        write_atomic(&path, stacked(&compared.charts, &data.command).as_bytes())?;
    }
    Ok(true)
}

/// Trains a run to its end, from where an earlier call left it; `false` when it was interrupted.
fn finished(run: &Run, seed: u64, folder: &RunFolder, device: &Device) -> Result<bool> {
    let overrides: Vec<String> = run.set.iter().cloned().chain([format!("seed={seed}")]).collect();
    let resolved = resolve(Sources { file: None, recipe: run.recipe.as_deref(), overrides: &overrides })?;
    let begun = folder.config().exists();
    if begun {
        let (saved, _) = folder.read_config()?;
        let same = resolve_saved(&saved, "config.toml").is_ok_and(|saved| saved.text == resolved.text);
        ensure!(same, "{}: holds a run with another configuration", folder.path().display());
        if folder.read_eval().is_ok_and(|eval| eval.last.step >= eval.steps) {
            return Ok(true);
        }
    } else {
        RunFolder::vacant(folder.path())?;
    }
    let job = Job {
        dataset: run.data.clone(),
        config: resolved.config.clone(),
        folder: folder.clone(),
        device: device.clone(),
        more_devices: Vec::new(),
        device_name: describe(device),
        resume: begun,
        stop_at: None,
        quiet: false,
        minutes: None,
        schedule_svg: Some(gsburn::report::schedule_svg),
    };
    Ok(!interrupt::asked() && matches!(train_and_report(resolved.pipeline, &job)?, Ending::Finished(_)))
}

/// The mean of a figure over the seeds, with its range; a dash where a run does not have it.
pub fn cell(Figure { key, digits }: &Figure, evals: &[Value]) -> String {
    let found: Vec<f64> = evals.iter().map_while(|eval| number(eval, key)).collect();
    let Some(spread) = Spread::of(&found).filter(|_| found.len() == evals.len()) else { return "–".into() };
    spread.shown(found.len() > 1, *digits)
}

/// The number at a place; in a list, the value of the figure with that key.
fn number(eval: &Value, key: &str) -> Option<f64> {
    let enter = |value: &Value, part: &str| match value {
        Value::Array(list) => list.iter().find(|one| one["key"] == part).map(|one| one["value"].clone()),
        value => value.get(part).cloned(),
    };
    key.split('.').try_fold(eval.clone(), |value, part| enter(&value, part))?.as_f64()
}

/// The commit of the working tree, short.
fn commit(root: &Path) -> Result<String> {
    let output = Command::new("git").args(["rev-parse", "--short", "HEAD"]).current_dir(root).output();
    let output = output.context("git: cannot be started")?;
    let text = String::from_utf8_lossy(&output.stdout).trim().to_string();
    if !output.status.success() || text.is_empty() {
        bail!("{}: expected a git repository, whose commit stands below the table", root.display());
    }
    Ok(text)
}
