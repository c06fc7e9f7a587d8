//! A run is a folder: configuration, metrics, checkpoints, figures, pictures, report. This module alone knows its
//! layout.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use gs_base::{guarded, write_atomic};
use serde::{Deserialize, Serialize};

use toml::Table;

use super::lock;
use super::measured::Evaluation;
use super::outputs::write_json;
use crate::config::tables;

/// Largest metrics.jsonl, bytes: a line of 200 bytes every ten steps makes 20 MB in a million steps.
const METRICS_MAX: u64 = 1 << 30;

/// Largest eval.json, bytes: a view takes some 300 bytes, and a measurement has at most some hundred thousand.
const EVAL_MAX: u64 = 256 << 20;

/// The folder of the saved states.
const CHECKPOINTS: &str = "checkpoints";

/// Where the parts of a run are.
#[derive(Debug, Clone)]
pub struct RunFolder {
    path: PathBuf,
}

/// One line of metrics.jsonl.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum MetricsLine {
    /// A training step.
    Train(TrainLine),
    /// A measurement of the held-out views.
    Eval(Box<Evaluation>),
}

/// A training step in metrics.jsonl.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrainLine {
    /// Steps taken.
    pub step: usize,
    /// The loss of this step's photo; `None` when it was not finite.
    pub loss: Option<f32>,
    /// PSNR of this step's photo, dB.
    pub psnr: Option<f64>,
    /// Steps skipped so far.
    pub skipped: usize,
    /// Training time so far, from reading the photos on, seconds.
    pub seconds: f64,
    /// Processor time of training so far, seconds.
    pub cpu_seconds: Option<f64>,
    /// Counts of this step, by name: "Gaussians", "SH degree", "tile intersections".
    #[serde(default)]
    pub counts: BTreeMap<String, f64>,
}

impl MetricsLine {
    /// The step the line is about.
    pub fn step(&self) -> usize {
        match self {
            Self::Train(line) => line.step,
            Self::Eval(evaluation) => evaluation.step,
        }
    }
}

/// The content of eval.json: the last measurement, then all of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EvalFile {
    /// Name of the run.
    pub name: String,
    /// The data set's path.
    pub dataset: String,
    /// The device of the run.
    pub device: String,
    /// Steps of the whole run.
    pub steps: usize,
    /// Name of the pipeline.
    pub pipeline: String,
    /// Values fixed by the data set: name, value, and the key that sets it.
    #[serde(default)]
    pub facts: Vec<(String, String, String)>,
    /// The settings by which charts distinguish runs: name, key and value.
    #[serde(default)]
    pub settings: Vec<Setting>,
    /// The most Gaussians that the scene had in training; `None` where the method has no count.
    #[serde(default)]
    pub most_gaussians: Option<usize>,
    /// Steps whose loss or gradients were not finite; they changed nothing.
    pub skipped_steps: usize,
    /// Memory predicted before the run, bytes.
    pub predicted_memory_bytes: u64,
    /// Wall-clock time of the whole program so far, measuring and saving included, seconds.
    pub total_seconds: f64,
    /// The last measurement.
    #[serde(flatten)]
    pub last: Evaluation,
    /// Every measurement of the run, without its single views.
    pub evaluations: Vec<Evaluation>,
}

/// A setting by which charts distinguish runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Setting {
    /// Name in charts.
    pub name: String,
    /// Key of the configuration.
    pub key: String,
    /// Its value.
    pub value: String,
    /// Chart label of key and value: "cap 20k".
    pub label: String,
}

/// The absolute path; unchanged if there is no such file.
pub fn full_path(path: &Path) -> PathBuf {
    fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf())
}

/// Checks that a path can stand in configurations, checkpoints and reports, which are text.
///
/// # Errors
/// A sentence, where it is not UTF-8.
pub fn utf8(path: &Path) -> Result<()> {
    if full_path(path).to_str().is_none() {
        bail!("{}: expected a path in UTF-8, because run folders name it; rename the folder", path.display());
    }
    Ok(())
}

impl RunFolder {
    /// The folder at `path`; nothing is created yet.
    pub fn at(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// A folder for a new run; nothing is created yet, so that a run that cannot start leaves nothing behind.
    ///
    /// # Errors
    /// When it already holds a run or other files, is a file, or has a path that a checkpoint cannot name.
    pub fn vacant(path: impl Into<PathBuf>) -> Result<Self> {
        let folder = Self::at(path);
        let shown = folder.path.display();
        utf8(&folder.path)?;
        if folder.config().exists() {
            bail!("{shown}: already holds a run; continue it with --resume or choose another folder with --out");
        }
        if folder.path.exists() && !folder.path.is_dir() {
            bail!("{shown}: expected a folder or nothing, found a file; choose another folder with --out");
        }
        if let Some(name) = folder.foreign() {
            bail!("{shown}: expected an empty folder or none, found {name:?} in it; choose another folder with --out");
        }
        Ok(folder)
    }

    /// The name of something in the folder that a run that has not begun does not leave there.
    fn foreign(&self) -> Option<OsString> {
        let names = fs::read_dir(&self.path).into_iter().flatten().flatten().map(|entry| entry.file_name());
        let is_left = |name: &OsString| {
            name == lock::FILE
                || (name == CHECKPOINTS && fs::read_dir(self.checkpoints()).is_ok_and(|mut e| e.next().is_none()))
        };
        names.filter(|name| !is_left(name)).min()
    }

    /// Makes the folder.
    ///
    /// # Errors
    /// When it cannot be created.
    pub fn make(&self) -> Result<()> {
        fs::create_dir_all(self.checkpoints())
            .with_context(|| format!("{}: cannot make the run folder", self.path.display()))
    }

    /// The folder itself.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The run's name, which is its folder's.
    pub fn name(&self) -> String {
        let absolute = full_path(&self.path);
        absolute.file_name().map_or_else(|| "run".into(), |name| name.to_string_lossy().into_owned())
    }

    /// The resolved configuration.
    pub fn config(&self) -> PathBuf {
        self.path.join("config.toml")
    }

    /// The path of the data set, in a file beside the configuration because it is not part of it.
    pub fn dataset(&self) -> PathBuf {
        self.path.join("dataset.txt")
    }

    /// The metrics: one JSON object per line.
    pub fn metrics(&self) -> PathBuf {
        self.path.join("metrics.jsonl")
    }

    /// The figures.
    pub fn eval(&self) -> PathBuf {
        self.path.join("eval.json")
    }

    /// The finished scene.
    pub fn ply(&self) -> PathBuf {
        self.path.join("scene.ply")
    }

    /// Side-by-side pictures.
    pub fn renders(&self) -> PathBuf {
        self.path.join("renders")
    }

    /// Curves.
    pub fn plots(&self) -> PathBuf {
        self.path.join("plots")
    }

    /// The time of each stage of a step, if it was measured.
    pub fn profile(&self) -> PathBuf {
        self.path.join("profile.json")
    }

    /// The section that `gsburn chart --report` put into the report.
    pub fn comparison(&self) -> PathBuf {
        self.path.join("comparison.html")
    }

    /// The section about the future in the report.
    pub fn future(&self) -> PathBuf {
        self.path.join("future.html")
    }

    /// The report.
    pub fn report(&self) -> PathBuf {
        self.path.join("report.html")
    }

    /// The files that lie in the folder itself.
    pub fn single_files(&self) -> [PathBuf; 8] {
        let [config, dataset, metrics, eval] = [self.config(), self.dataset(), self.metrics(), self.eval()];
        [config, dataset, metrics, eval, self.ply(), self.comparison(), self.future(), self.report()]
    }

    /// The folder of saved states.
    pub fn checkpoints(&self) -> PathBuf {
        self.path.join(CHECKPOINTS)
    }

    /// The saved state after `step` steps.
    pub fn checkpoint(&self, step: usize) -> PathBuf {
        self.checkpoints().join(format!("step-{step:07}.safetensors"))
    }

    /// All saved states by step, oldest first.
    pub fn saved(&self) -> Vec<(usize, PathBuf)> {
        let entries = fs::read_dir(self.checkpoints()).into_iter().flatten().flatten();
        let mut saved: Vec<(usize, PathBuf)> = entries
            .filter_map(|entry| {
                let name = entry.file_name();
                let step = name.to_str()?.strip_prefix("step-")?.strip_suffix(".safetensors")?.parse().ok()?;
                Some((step, entry.path()))
            })
            .collect();
        saved.sort();
        saved
    }

    /// Removes all saved states but the newest `keep`, and partial files of a killed process.
    pub fn prune_checkpoints(&self, keep: usize) {
        let saved = self.saved();
        let old = saved.iter().rev().skip(keep).map(|(_, path)| path.clone());
        let entries = fs::read_dir(self.checkpoints()).into_iter().flatten().flatten();
        let halves = entries.map(|entry| entry.path()).filter(|path| {
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            // As `write_atomic`, safetensors and the checkpoints call them.
            (name.starts_with('.') && name.ends_with(".tmp"))
                || name.starts_with(".tmp")
                || path.extension().is_some_and(|extension| extension == "part")
        });
        for path in old.chain(halves) {
            if let Err(error) = fs::remove_file(&path) {
                tracing::warn!("{}: cannot remove: {error}", path.display());
            }
        }
    }

    /// Saves the configuration and the path of the data set.
    ///
    /// # Errors
    /// When they cannot be written.
    pub fn write_config(&self, config: &str, dataset: &Path) -> Result<()> {
        write_atomic(&self.dataset(), format!("{}\n", full_path(dataset).display()).as_bytes())?;
        Ok(write_atomic(&self.config(), config.as_bytes())?)
    }

    /// The configuration and the path of the data set.
    ///
    /// # Errors
    /// When this is not a run folder or the configuration is not valid.
    pub fn read_config(&self) -> Result<(Table, PathBuf)> {
        if !self.config().exists() {
            bail!("{}: expected a run folder (with config.toml), found none", self.path.display());
        }
        let dataset = guarded::read_to_string(&self.dataset(), tables::FILE_MAX)?;
        let path = self.config();
        let text = guarded::read_to_string(&path, tables::FILE_MAX)?;
        Ok((tables::parse(&text, &path.display().to_string())?, PathBuf::from(dataset.trim())))
    }

    /// The lines of metrics.jsonl up to `last_step`. A last line cut short by a killed process is dropped.
    ///
    /// # Errors
    /// When the file exists and cannot be read.
    pub fn read_metrics(&self, last_step: usize) -> Result<Vec<MetricsLine>> {
        let path = self.metrics();
        if !path.exists() {
            return Ok(Vec::new());
        }
        let text = guarded::read_to_string(&path, METRICS_MAX)?;
        let lines = text.lines().filter_map(|line| serde_json::from_str::<MetricsLine>(line).ok());
        Ok(lines.filter(|line| line.step() <= last_step).collect())
    }

    /// Opens metrics.jsonl for appending, beginning with `lines`.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn open_metrics(&self, lines: &[MetricsLine]) -> Result<MetricsFile> {
        let path = self.metrics();
        let text: String = lines.iter().map(json_line).collect();
        write_atomic(&path, text.as_bytes())?;
        let file =
            OpenOptions::new().append(true).open(&path).with_context(|| format!("{}: cannot write", path.display()))?;
        Ok(MetricsFile { file, path, unwritten: String::new() })
    }

    /// Writes eval.json.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_eval(&self, eval: &EvalFile) -> Result<()> {
        write_json(&self.eval(), eval)
    }

    /// Reads eval.json.
    ///
    /// # Errors
    /// When it does not exist or is not in this version's format.
    pub fn read_eval(&self) -> Result<EvalFile> {
        let path = self.eval();
        let text = guarded::read_to_string(&path, EVAL_MAX).context("cannot read the figures of the run")?;
        serde_json::from_str(&text).with_context(|| format!("{}: expected the figures of a run", path.display()))
    }
}

/// metrics.jsonl, open for appending.
#[derive(Debug)]
pub struct MetricsFile {
    file: File,
    path: PathBuf,
    /// Lines that the disk did not take.
    unwritten: String,
}

impl MetricsFile {
    /// Appends a line. Where the disk does not take it, it is kept and written with the next.
    ///
    /// # Errors
    /// When it cannot be written now; the file then ends with a whole line.
    pub fn append(&mut self, line: &MetricsLine) -> Result<()> {
        self.unwritten += &json_line(line);
        self.flush()
    }

    /// Writes the lines that the disk did not take.
    ///
    /// # Errors
    /// When they still cannot be written.
    pub fn flush(&mut self) -> Result<()> {
        let before = self.file.metadata().map(|metadata| metadata.len());
        let written = self.file.write_all(self.unwritten.as_bytes());
        match (&written, before) {
            (Ok(()), _) => self.unwritten.clear(),
            // The write error is the one to report.
            (Err(_), Ok(length)) => drop(self.file.set_len(length)),
            (Err(_), Err(_)) => {}
        }
        written.with_context(|| format!("{}: cannot write", self.path.display()))
    }
}

fn json_line(line: &MetricsLine) -> String {
    serde_json::to_string(line).expect("figures are JSON") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(step: usize) -> MetricsLine {
        MetricsLine::Train(TrainLine {
            step,
            loss: Some(0.5),
            psnr: None,
            skipped: 0,
            seconds: step as f64,
            cpu_seconds: None,
            counts: BTreeMap::from([("gaussians".into(), 10.0)]),
        })
    }

    #[test]
    fn metrics_resume_at_the_checkpoint() {
        let temporary = tempfile::tempdir().expect("a folder");
        let folder = RunFolder::vacant(temporary.path().join("run")).expect("free");
        folder.make().expect("made");
        let mut metrics = folder.open_metrics(&[]).expect("opened");
        for step in 1..=5 {
            metrics.append(&line(step)).expect("written");
        }
        fs::write(folder.metrics(), fs::read_to_string(folder.metrics()).expect("read") + "{\"kind\":\"tra")
            .expect("cut");
        let kept = folder.read_metrics(3).expect("read");
        assert_eq!(kept, [line(1), line(2), line(3)]);
        folder.open_metrics(&kept).expect("opened").append(&line(4)).expect("written");
        assert_eq!(folder.read_metrics(100).expect("read").len(), 4);
    }

    #[test]
    fn old_and_half_written_checkpoints_go() {
        let temporary = tempfile::tempdir().expect("a folder");
        let folder = RunFolder::vacant(temporary.path()).expect("free");
        folder.make().expect("made");
        for name in
            ["step-0000100.safetensors", "step-0000200.safetensors", "step-0000300.part", ".step-1.safetensors.7.0.tmp"]
        {
            fs::write(folder.checkpoints().join(name), "x").expect("written");
        }
        folder.prune_checkpoints(1);
        let left: Vec<_> = fs::read_dir(folder.checkpoints()).expect("read").flatten().map(|e| e.file_name()).collect();
        assert_eq!(left, ["step-0000200.safetensors"]);
    }
}
