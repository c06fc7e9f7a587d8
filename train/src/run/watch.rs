//! A run under way: what watches a training and writes its files.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Result, bail};
use burn::tensor::Device;
use toml::Table;

use super::checkpoint::{self, Checkpoint, Origin};
use super::evaluate::{Cost, Evaluation, Measured};
use super::fingerprint::Fingerprint;
use super::folder::{EvalFile, MetricsFile, MetricsLine, RunFolder, Setting, TrainLine, full_path};
use super::interrupt;
use super::memory::Prediction;
use super::profile;
use super::progress::Progress;
use super::resources::{cpu_seconds, peak_memory};
use crate::config::CheckpointConfig;
use crate::fit::method::Note;
use crate::fit::schedule::due;
use crate::fit::snapshot::Snapshot;

/// Steps from one line of metrics to the next.
const METRICS_EVERY: usize = 10;

/// What to train, and where.
#[derive(Debug, Clone)]
pub struct Job {
    /// The data set.
    pub dataset: PathBuf,
    /// The resolved configuration, every key of its pipeline.
    pub config: Table,
    /// Where the run's files go.
    pub folder: RunFolder,
    /// Where it computes (without autodiff).
    pub device: Device,
    /// The device in words, for the report.
    pub device_name: String,
    /// Continue from the newest checkpoint in `folder`.
    pub resume: bool,
    /// Save and leave after this many steps, as Ctrl-C would.
    pub stop_at: Option<usize>,
    /// Show nothing on the terminal.
    pub quiet: bool,
}

/// How a run ended.
#[derive(Debug)]
pub enum Ending {
    /// All steps were taken.
    Finished(Box<EvalFile>),
    /// It was asked to stop, and saved its state after this step.
    Interrupted(usize),
}

/// What a run is told of the training that it watches.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Steps of the whole run.
    pub steps: usize,
    /// When the state is saved.
    pub checkpoint: CheckpointConfig,
    /// What checkpoints say of the run.
    pub origin: Origin,
    /// The memory it is expected to need.
    pub prediction: Prediction,
    /// What the data set settled: name, value, and the key that says otherwise.
    pub facts: Vec<(String, String, String)>,
    /// What charts tell runs apart by.
    pub settings: Vec<Setting>,
}

/// A run under way.
pub struct Run<'a> {
    job: &'a Job,
    plan: Plan,
    metrics: MetricsFile,
    history: Vec<MetricsLine>,
    progress: Progress,
    clock: Clock,
    begun: Instant,
    /// How often each note came.
    notes: BTreeMap<Note, usize>,
    skipped: usize,
}

/// The newest checkpoint of the run in `job.folder`, where it is to be continued and has one.
///
/// # Errors
/// A sentence when it is damaged, or was begun with another configuration.
pub fn saved(job: &Job, config: &str) -> Result<Option<Checkpoint>> {
    let newest = job.resume.then(|| job.folder.saved().pop()).flatten();
    let Some((_, path)) = newest else { return Ok(None) };
    let checkpoint = Checkpoint::load(&path)?;
    if checkpoint.origin.config != config {
        let config = job.folder.config();
        bail!("{}: expected the configuration of {}, found another one", path.display(), config.display());
    }
    Ok(Some(checkpoint))
}

/// That a run goes on with the views that it began on.
///
/// # Errors
/// A sentence when it does not.
pub fn check_views(job: &Job, begun_on: Fingerprint, views: Fingerprint) -> Result<()> {
    if begun_on != views {
        bail!(
            "{}: expected the {} training views that the run in {} began on, found {}: other names, poses, intrinsics or times",
            job.dataset.display(),
            begun_on.views,
            job.folder.path().display(),
            views.views
        );
    }
    Ok(())
}

impl<'a> Run<'a> {
    /// Makes the folder, or goes on in it after `step` steps.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn begin(job: &'a Job, plan: Plan, step: usize) -> Result<Self> {
        let folder = &job.folder;
        folder.make()?;
        folder.prune_checkpoints(plan.checkpoint.keep);
        folder.write_config(&plan.origin.config, &job.dataset)?;
        let history = if job.resume { folder.read_metrics(step)? } else { Vec::new() };
        let progress = Progress::new(step, plan.steps, job.quiet);
        let run = Self {
            metrics: folder.open_metrics(&history)?,
            clock: last_clock(&history),
            history,
            progress,
            begun: Instant::now(),
            notes: BTreeMap::new(),
            skipped: 0,
            job,
            plan,
        };
        run.say(&format!(
            "device {}; run folder {}; memory expected: {}",
            job.device_name,
            folder.path().display(),
            run.plan.prediction
        ));
        if step > 0 {
            run.say(&format!("resuming after step {step}"));
        }
        Ok(run)
    }

    /// Prints a line above the bar.
    pub fn say(&self, line: &str) {
        self.progress.say(line);
    }

    /// Whether the user, or the job, wants the run to end after `step` steps.
    pub fn is_stopped(&self, step: usize) -> bool {
        interrupt::asked() || self.job.stop_at == Some(step)
    }

    /// A step of the training, on the clock.
    pub fn timed<T>(&mut self, step: impl FnOnce() -> T) -> T {
        let recording = gs_burn::profile::step();
        let (begun, cpu_begun) = (Instant::now(), cpu_seconds());
        let result = step();
        self.clock.seconds += begun.elapsed().as_secs_f64();
        let spent = cpu_seconds().zip(cpu_begun).map(|(now, begun)| now - begun);
        self.clock.cpu_seconds = self.clock.cpu_seconds.zip(spent).map(|(sum, spent)| sum + spent);
        drop(recording);
        result
    }

    /// Bar and metrics after `step` steps. `psnr` measures the step's image where a line is written.
    ///
    /// # Errors
    /// When the disk does not take the line.
    pub fn observe(
        &mut self,
        step: usize,
        (loss, skipped): (f32, usize),
        counts: &[(&str, f64)],
        psnr: impl FnOnce() -> Option<f64>,
    ) -> Result<()> {
        let was_skipped = skipped > self.skipped;
        self.skipped = skipped;
        // A line at every planned checkpoint, because the clock of a resumed run continues from the last line. A run that is stopped in
        // between has none there, so that its metrics are those of an uninterrupted one; it loses the clock of a few steps.
        let last = step == self.plan.steps;
        let noted = due(step, METRICS_EVERY) || due(step, self.plan.checkpoint.every) || last || was_skipped;
        let psnr = if noted && !was_skipped { psnr() } else { None };
        self.progress.step(step, loss, psnr, counts);
        if noted {
            self.note(MetricsLine::Train(TrainLine {
                step,
                loss: loss.is_finite().then_some(loss),
                psnr,
                skipped,
                seconds: self.clock.seconds,
                cpu_seconds: self.clock.cpu_seconds,
                counts: counts.iter().map(|(name, count)| ((*name).to_string(), *count)).collect(),
            }))?;
        }
        Ok(())
    }

    /// Counts what went other than asked in a step; after the `last` step at which it may, each note that came often is said.
    pub fn count(&mut self, notes: &[Note], step: usize, last: usize) {
        for note in notes {
            *self.notes.entry(*note).or_default() += 1;
        }
        if step == last {
            for (note, count) in &self.notes {
                if count * 100 > note.often_percent as usize * last {
                    let sentence = note.sentence.replace("{count}", &count.to_string());
                    self.say(&format!("warning: {}", sentence.replace("{steps}", &last.to_string())));
                }
            }
        }
    }

    fn note(&mut self, line: MetricsLine) -> Result<()> {
        self.metrics.append(&line)?;
        self.history.push(line);
        Ok(())
    }

    /// Whether the state is to be saved after `step` steps, the last excepted.
    pub fn is_save_due(&self, step: usize) -> bool {
        due(step, self.plan.checkpoint.every) && step < self.plan.steps
    }

    /// Writes a measurement into metrics.jsonl and eval.json.
    ///
    /// # Errors
    /// When the disk does not take them.
    pub fn record(&mut self, step: usize, measured: Measured) -> Result<EvalFile> {
        let cost =
            Cost { seconds: self.clock.seconds, cpu_seconds: self.clock.cpu_seconds, peak_memory_bytes: peak_memory() };
        let evaluation = Evaluation { step, measured, cost };
        self.say(&evaluation.line());
        if let Some(line) = evaluation.measured.figures_line() {
            self.say(&line);
        }
        self.note(MetricsLine::Eval(Box::new(evaluation.clone())))?;
        let file = self.eval_file(evaluation);
        self.job.folder.write_eval(&file)?;
        Ok(file)
    }

    fn eval_file(&self, last: Evaluation) -> EvalFile {
        // A finished run that is resumed is measured once more at its last step; the newer figures count.
        let mut evaluations = BTreeMap::new();
        for line in &self.history {
            if let MetricsLine::Eval(evaluation) = line {
                evaluations.insert(evaluation.step, evaluation.without_details());
            }
        }
        EvalFile {
            name: self.job.folder.name(),
            dataset: full_path(&self.job.dataset).display().to_string(),
            device: self.job.device_name.clone(),
            pipeline: self.plan.origin.pipeline.clone(),
            steps: self.plan.steps,
            skipped_steps: self.skipped,
            predicted_memory_bytes: self.plan.prediction.total(),
            total_seconds: self.begun.elapsed().as_secs_f64(),
            facts: self.plan.facts.clone(),
            settings: self.plan.settings.clone(),
            last,
            evaluations: evaluations.into_values().collect(),
        }
    }

    /// Saves the state after `step` steps.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn save(&self, step: usize, snapshot: &Snapshot) -> Result<()> {
        let folder = &self.job.folder;
        checkpoint::save(&folder.checkpoint(step), &self.plan.origin, snapshot)?;
        folder.prune_checkpoints(self.plan.checkpoint.keep);
        tracing::info!(step, "checkpoint saved");
        Ok(())
    }

    /// Ends the run before its last step; the state was saved.
    ///
    /// # Errors
    /// When the disk does not take the profile.
    pub fn leave(self, step: usize) -> Result<Ending> {
        profile::write_if_recording(&self.job.folder, &self.job.device_name)?;
        self.progress.finish();
        Ok(Ending::Interrupted(step))
    }

    /// Ends the run after its last measurement; the lines of its metrics come back for the report.
    ///
    /// # Errors
    /// When the disk does not take the profile.
    pub fn finish(self) -> Result<Vec<MetricsLine>> {
        self.progress.finish();
        profile::write_if_recording(&self.job.folder, &self.job.device_name)?;
        Ok(self.history)
    }
}

/// Training time so far, what observers do left out.
#[derive(Debug, Clone, Copy)]
struct Clock {
    seconds: f64,
    cpu_seconds: Option<f64>,
}

/// The clock at the last line of metrics.
fn last_clock(history: &[MetricsLine]) -> Clock {
    let last = history.iter().rev().find_map(|line| match line {
        MetricsLine::Train(line) => Some(Clock { seconds: line.seconds, cpu_seconds: line.cpu_seconds }),
        MetricsLine::Eval(_) => None,
    });
    last.unwrap_or(Clock { seconds: 0.0, cpu_seconds: cpu_seconds().map(|_| 0.0) })
}
