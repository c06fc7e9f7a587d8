//! A run in progress: it observes a training and writes its files.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use burn::tensor::Device;
use gs_base::{guarded, write_atomic};
use toml::Table;

use super::checkpoint::{self, Checkpoint, CheckpointError, Origin};
use super::fingerprint::Fingerprint;
use super::folder::{EvalFile, MetricsFile, MetricsLine, RunFolder, Setting, TrainLine, full_path, utf8};
use super::interrupt;
use super::lock::Lock;
use super::measured::{Cost, Evaluation, Measured};
use super::memory::Prediction;
use super::outcome::Outcome;
use super::outputs;
use super::profile;
use super::progress::Progress;
use super::resources::{Spent, Stopwatch, cpu_seconds, peak_memory};
use crate::config::{CheckpointConfig, tables};
use crate::fit::method::Note;
use crate::fit::schedule::due;
use crate::fit::snapshot::Snapshot;
use crate::fit::timetable::Timetable;
use crate::sentence::one_sentence;

/// Name of the count of Gaussians in metrics.
pub const GAUSSIANS: &str = "Gaussians";

/// Name of the chart of the schedule among the plots of a run.
pub const SCHEDULE: &str = "schedule";

/// Steps from one line of metrics to the next.
const METRICS_EVERY: usize = 10;

/// Steps from a save that failed to the next try: a disk is rarely full for seconds, and a checkpoint costs about a
/// step's time.
const RETRY_AFTER: usize = 50;

/// The training that is asked for: its data set, its configuration, its folder and its device.
#[derive(Debug, Clone)]
pub struct Job {
    /// The data set.
    pub dataset: PathBuf,
    /// The resolved configuration, every key of its pipeline.
    pub config: Table,
    /// Folder of the run's files.
    pub folder: RunFolder,
    /// The compute device (without autodiff).
    pub device: Device,
    /// Devices that train beside it, for a pipeline that uses several.
    pub more_devices: Vec<Device>,
    /// The device for people, for the report.
    pub device_name: String,
    /// Continue from the newest checkpoint in `folder`.
    pub resume: bool,
    /// Save and end after this many steps, as after Ctrl-C.
    pub stop_at: Option<usize>,
    /// Show nothing on the terminal.
    pub quiet: bool,
    /// Minutes that the training may take, from which its steps are planned; `None`: it takes those of `config`.
    pub minutes: Option<f64>,
    /// Draws the schedule of the training as SVG, before its first step.
    pub schedule_svg: Option<fn(&Timetable) -> String>,
}

impl Job {
    /// Number of devices that train.
    pub fn devices(&self) -> usize {
        1 + self.more_devices.len()
    }
}

/// The end of a run.
#[derive(Debug)]
pub enum Ending<T = Outcome> {
    /// All steps were taken.
    Finished(T),
    /// Stopped on request, with the state saved after this step.
    Interrupted(usize),
}

/// A run's knowledge of the training that it observes.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Steps of the whole run.
    pub steps: usize,
    /// When the state is saved.
    pub checkpoint: CheckpointConfig,
    /// The run, as its checkpoints name it.
    pub origin: Origin,
    /// The predicted memory.
    pub prediction: Prediction,
    /// Values fixed by the data set: name, value, and the key that sets it.
    pub facts: Vec<(String, String, String)>,
    /// Settings by which charts distinguish runs.
    pub settings: Vec<Setting>,
}

/// A run in progress.
pub struct Run {
    job: Job,
    plan: Plan,
    metrics: MetricsFile,
    history: Vec<MetricsLine>,
    progress: Progress,
    /// Time of training so far, with reading the photos and finding the first Gaussians, without observers.
    clock: Cost,
    begun: Instant,
    /// Number of steps with each note.
    notes: BTreeMap<Note, usize>,
    skipped: usize,
    /// The step at which a save that failed is tried again.
    retry_at: Option<usize>,
    /// Whether the user knows that the disk takes no more.
    disk_warned: bool,
    _lock: Lock,
}

/// The newest whole checkpoint of the run in `job.folder`, where it is to be continued and has one. Damaged ones that
/// are newer are named, and set aside so that nothing takes them for the newest again.
///
/// # Errors
/// A sentence when all are damaged, or it was begun with another configuration.
pub fn newest_checkpoint(job: &Job, config: &str) -> Result<Option<Checkpoint>> {
    if !job.resume {
        return Ok(None);
    }
    let mut damaged: Vec<(PathBuf, CheckpointError)> = Vec::new();
    for (step, path) in job.folder.saved().into_iter().rev() {
        let checkpoint = match Checkpoint::load(&path).and_then(Checkpoint::whole) {
            Ok(checkpoint) => checkpoint,
            Err(error) if error.is_damage() => {
                damaged.push((path, error));
                continue;
            }
            Err(error) => return Err(error.into()),
        };
        if checkpoint.origin.config != config {
            let config = job.folder.config();
            bail!("{}: expected the configuration of {}, found another one", path.display(), config.display());
        }
        for (path, error) in damaged {
            let aside = path.with_extension("damaged");
            fs::rename(&path, &aside).with_context(|| format!("{}: cannot set aside", path.display()))?;
            tracing::warn!("{error}; it is {} now, and the run goes on from step {step}", aside.display());
        }
        return Ok(Some(checkpoint));
    }
    // The newest one's damage is what the user can do something about, with a backup.
    match damaged.into_iter().next() {
        Some((_, error)) => Err(error).context("no whole checkpoint is left to continue from"),
        None => Ok(None),
    }
}

/// The figures of a run that is to be continued and has nothing left to do; `None` for any other.
pub fn finished(job: &Job, config: &str) -> Option<Outcome> {
    let folder = &job.folder;
    let newest = folder.saved().pop().filter(|_| job.resume)?;
    let saved = guarded::read_to_string(&folder.config(), tables::FILE_MAX).ok()?;
    let eval = folder.read_eval().ok()?;
    let is_done = newest.0 == eval.steps && eval.last.step == eval.steps && saved == config;
    let is_done = is_done && folder.ply().is_file() && folder.report().is_file();
    // A damaged checkpoint is replaced, from the one before it.
    let is_done = is_done && Checkpoint::load(&newest.1).and_then(Checkpoint::whole).is_ok();
    if is_done && !job.quiet {
        eprintln!("{}: the run is finished; nothing is written", folder.path().display());
    }
    is_done.then_some(Outcome { eval, report: None })
}

/// The lock of the folder that a run goes on in, after a check that the paths of the run can be written down.
///
/// # Errors
/// A sentence: a path that is not UTF-8, or another process that writes the folder.
pub fn acquire_lock(job: &Job) -> Result<Option<Lock>> {
    utf8(&job.dataset)?;
    utf8(job.folder.path())?;
    (job.resume && job.folder.path().is_dir()).then(|| Lock::take(job.folder.path())).transpose()
}

/// Checks that a resumed run has the views that it began with.
///
/// # Errors
/// A sentence if it does not.
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

impl Run {
    /// Makes the folder, or goes on in it after `step` steps. `lock` is that of a folder that a run goes on in.
    ///
    /// # Errors
    /// When the disk does not take it, or another process writes it.
    pub fn begin(job: &Job, plan: Plan, step: usize, lock: Option<Lock>) -> Result<Self> {
        let folder = &job.folder;
        folder.make()?;
        let lock = lock.map_or_else(|| Lock::take(folder.path()), Ok)?;
        if !job.resume && folder.config().exists() {
            // While this run read its data.
            bail!(
                "{}: another process has begun a run here; choose another folder with --out",
                folder.path().display()
            );
        }
        folder.prune_checkpoints(plan.checkpoint.keep);
        outputs::remove_left_over(&folder.single_files());
        folder.write_config(&plan.origin.config, &job.dataset)?;
        let mut history = if job.resume { folder.read_metrics(step)? } else { Vec::new() };
        // A run that ended in the writing of its report is measured again at its last step.
        history.retain(|line| !matches!(line, MetricsLine::Eval(_)) || line.step() < plan.steps);
        let progress = Progress::new(step, plan.steps, job.quiet);
        let run = Self {
            metrics: folder.open_metrics(&history)?,
            clock: last_clock(&history),
            history,
            progress,
            begun: Instant::now(),
            notes: BTreeMap::new(),
            skipped: 0,
            retry_at: None,
            disk_warned: false,
            _lock: lock,
            job: job.clone(),
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

    /// Whether the user or the job ends the run after `step` steps.
    pub fn is_stopped(&self, step: usize) -> bool {
        interrupt::asked() || self.job.stop_at == Some(step)
    }

    /// Runs and times a training step.
    pub fn timed<T>(&mut self, step: impl FnOnce() -> T) -> T {
        let recording = gs_burn::profile::step();
        let watch = Stopwatch::start();
        let result = step();
        self.count_time(watch);
        drop(recording);
        result
    }

    /// Adds the time since `watch` began to that of training: reading the photos and finding the first Gaussians are
    /// part of its cost.
    pub fn count_time(&mut self, watch: Stopwatch) {
        self.count_spent(watch.spent());
    }

    /// Adds seconds, and those of the processor, to the time of training.
    pub fn count_spent(&mut self, (seconds, cpu): Spent) {
        self.clock.seconds += seconds;
        self.clock.cpu_seconds = self.clock.cpu_seconds.zip(cpu).map(|(sum, spent)| sum + spent);
    }

    /// Updates bar and metrics after `step` steps. `psnr` measures the step's image, if a line is written.
    pub fn observe(
        &mut self,
        step: usize,
        (loss, skipped): (f32, usize),
        counts: &[(&str, f64)],
        psnr: impl FnOnce() -> Option<f64>,
    ) {
        let was_skipped = skipped > self.skipped;
        self.skipped = skipped;
        // A line at every planned checkpoint, because the clock of a resumed run continues from the last line. A run
        // that is stopped in between writes none there, so that its metrics equal those of an uninterrupted one; its
        // clock loses a few steps.
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
            }));
        }
    }

    /// Counts the notes of a step. After the last step that may have a note, it is shown if it was frequent.
    pub fn count(&mut self, notes: &[Note], step: usize) {
        for note in notes {
            *self.notes.entry(*note).or_default() += 1;
        }
        for (note, count) in &self.notes {
            if step == note.last && count * 100 > note.often_percent as usize * note.last {
                let sentence = note.sentence.replace("{count}", &count.to_string());
                self.say(&format!("warning: {}", sentence.replace("{steps}", &note.last.to_string())));
            }
        }
    }

    /// A line of metrics. One that the disk does not take now is written with the next.
    fn note(&mut self, line: MetricsLine) {
        if let Err(error) = self.metrics.append(&line) {
            self.warn_of_disk(&error);
        }
        self.history.push(line);
    }

    /// Says once that the disk takes no more.
    fn warn_of_disk(&mut self, error: &anyhow::Error) {
        if !self.disk_warned {
            self.say(&format!("warning: {}; the run goes on and tries again", one_sentence(error)));
            self.disk_warned = true;
        }
    }

    /// Whether the state is saved after `step` steps, the last excepted.
    pub fn is_save_due(&self, step: usize) -> bool {
        (due(step, self.plan.checkpoint.every) || self.retry_at == Some(step)) && step < self.plan.steps
    }

    /// Saves the state in the course of the run. A save that fails is said, and tried again.
    pub fn save_on_the_way(&mut self, step: usize, snapshot: &Snapshot) {
        match self.save(step, snapshot) {
            Ok(()) => {
                if self.retry_at.take().is_some() {
                    self.say(&format!("saved after step {step}"));
                }
            }
            Err(error) => {
                let error = one_sentence(&error);
                self.say(&format!("warning: {error}; the run goes on and tries again after {RETRY_AFTER} steps"));
                self.retry_at = Some(step + RETRY_AFTER);
            }
        }
    }

    /// Writes a measurement into metrics.jsonl and eval.json. That of the last step is shown by the command, as its
    /// result.
    ///
    /// # Errors
    /// The second value, when the disk does not take the last one; it may take an earlier one later.
    pub fn record(&mut self, step: usize, measured: Measured) -> (EvalFile, Result<()>) {
        let cost = Cost { peak_memory_bytes: peak_memory(), ..self.clock };
        let evaluation = Evaluation { step, measured, cost };
        if step < self.plan.steps {
            self.say(&evaluation.line());
        }
        if let Some(line) = evaluation.measured.figures_line() {
            self.say(&line);
        }
        self.note(MetricsLine::Eval(Box::new(evaluation.clone())));
        let file = self.eval_file(evaluation);
        match self.job.folder.write_eval(&file) {
            Err(error) if step < self.plan.steps => {
                self.warn_of_disk(&error);
                (file, Ok(()))
            }
            written => (file, written),
        }
    }

    /// Draws the schedule into the run folder.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn plot(&self, schedule: &Timetable) -> Result<()> {
        let Some(svg) = self.job.schedule_svg else { return Ok(()) };
        let path = self.job.folder.plots().join(format!("{SCHEDULE}.svg"));
        write_atomic(&path, svg(schedule).as_bytes())?;
        self.say(&format!("schedule plotted in {}", path.display()));
        Ok(())
    }

    fn eval_file(&self, last: Evaluation) -> EvalFile {
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
            most_gaussians: most_gaussians(&self.history),
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
    /// When it cannot be written.
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
    /// When the disk does not take the metrics or the profile.
    pub fn leave(mut self, step: usize) -> Result<Ending> {
        self.metrics.flush()?;
        profile::write_if_recording(&self.job.folder, &self.job.device_name)?;
        self.progress.finish();
        Ok(Ending::Interrupted(step))
    }

    /// Ends the run after its last measurement; returns the lines of its metrics for the report.
    ///
    /// # Errors
    /// The second value, when the disk does not take the metrics or the profile.
    pub fn finish(mut self) -> (Vec<MetricsLine>, Result<()>) {
        self.progress.finish();
        let written = self.metrics.flush();
        let profile = profile::write_if_recording(&self.job.folder, &self.job.device_name);
        (self.history, written.and(profile.map(drop)))
    }
}

/// The most Gaussians in any line of metrics.
fn most_gaussians(history: &[MetricsLine]) -> Option<usize> {
    let counts = history.iter().filter_map(|line| match line {
        MetricsLine::Train(line) => line.counts.get(GAUSSIANS).copied(),
        MetricsLine::Eval(_) => None,
    });
    counts.reduce(f64::max).map(|count| count as usize)
}

/// The clock at the last line of metrics.
fn last_clock(history: &[MetricsLine]) -> Cost {
    let last = history.iter().rev().find_map(|line| match line {
        MetricsLine::Train(line) => Some((line.seconds, line.cpu_seconds)),
        MetricsLine::Eval(_) => None,
    });
    let (seconds, cpu_seconds) = last.unwrap_or((0.0, cpu_seconds().map(|_| 0.0)));
    Cost { seconds, cpu_seconds, peak_memory_bytes: None }
}
