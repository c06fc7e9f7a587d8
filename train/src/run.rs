//! The whole run: load, begin or resume, step until done while observers watch, measure, save, report.

mod words;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Error, Result, bail};
use burn::tensor::Device;
use gs_datasets::Scene;

use crate::checkpoint::Checkpoint;
use crate::data::{Fingerprint, Order, Photo, Photos, check_pixels, check_times, near_warning, settled};
use crate::evaluate::{Comparison, Evaluation, Evaluator};
use crate::experiment::Config;
use crate::export::write_ply;
use crate::interrupt;
use crate::memory::{Prediction, megabytes};
use crate::metrics::{psnr, psnr_masked};
use crate::profile;
use crate::progress::Progress;
use crate::report;
use crate::resources::{cpu_seconds, peak_memory};
use crate::run_folder::{EvalFile, MetricsFile, MetricsLine, RunFolder, TrainLine, full_path};
use crate::schedule::due;
use crate::step::{StepReport, Trainer};
use crate::taylormode::hints;
use crate::taylormode::measure;

/// Steps from one line of metrics to the next.
const METRICS_EVERY: usize = 10;

/// What to run, and where.
#[derive(Debug, Clone)]
pub struct RunRequest {
    /// The data set.
    pub dataset: PathBuf,
    /// The resolved configuration.
    pub config: Config,
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

/// Runs what is asked for.
///
/// # Errors
/// One sentence: bad data, a damaged checkpoint, a full disk.
pub fn run(request: &RunRequest) -> Result<Ending> {
    let config = &request.config;
    let scene = config.load(&request.dataset)?;
    let timed = scene.train.iter().filter(|view| view.time.is_some()).count();
    check_times(&request.dataset, config, timed).map_err(Error::msg)?;
    check_pixels(&request.dataset, &scene).map_err(Error::msg)?;
    let asked = config;
    let request = &RunRequest { config: settled(config, &scene), ..request.clone() };
    let config = &request.config;
    config.validate().with_context(|| format!("{}: what the data set settles", request.dataset.display()))?;
    if let Some(warning) = near_warning(config, scene.subject_distance()) {
        tracing::warn!("{warning}");
    }
    let prediction = Prediction::new(&scene, config);
    let views = Fingerprint::of(&scene);
    let saved = saved_trainer(request, views)?;
    let found = hints::gather(&scene, config);
    let trainer = saved.unwrap_or_else(|| Trainer::begin(&scene, found.as_ref(), config, &request.device));
    let mut run = Run::begin(request, asked, (scene.origin, views), trainer, prediction)?;
    let mut order = Order::new(&scene.train, run.trainer.motion.as_ref().map(|state| state.window.t0), config);
    run.introduce(&scene);
    if let Some(found) = &found {
        run.introduce_motion(&scene, found);
    }
    let mut photos = Photos::new(&scene.train, &request.device, config.data.cache_mb << 20).with_motion(found);

    while run.trainer.step < config.steps {
        if interrupt::asked() || request.stop_at == Some(run.trainer.step) {
            return run.leave();
        }
        let step = gs_burn::profile::step();
        let started = (Instant::now(), cpu_seconds());
        let index = order.pick(run.trainer.step + 1);
        let photo = gs_burn::profile::timed("photo upload", || photos.get(index));
        let report = run.trainer.step(&photo, config);
        run.trainer.simplify(&scene.train, config);
        run.clock.add(started);
        drop(step);

        run.observe(&report, &photo)?;
        if config.eval.at.contains(&run.trainer.step) && run.trainer.step < config.steps {
            run.measure(&scene, 0)?;
        }
        if due(run.trainer.step, config.checkpoint.every) && run.trainer.step < config.steps {
            run.save()?;
        }
    }
    drop(photos);
    run.finish(&scene)
}

/// The state of the newest checkpoint, where the run is to be continued and has one.
fn saved_trainer(request: &RunRequest, views: Fingerprint) -> Result<Option<Trainer>> {
    let newest = request.resume.then(|| request.folder.saved().pop()).flatten();
    let Some((_, path)) = newest else { return Ok(None) };
    let checkpoint = Checkpoint::load(&path, &request.device)?;
    if checkpoint.config != request.config {
        let config = request.folder.config();
        bail!("{}: expected the configuration of {}, found another one", path.display(), config.display());
    }
    if let Some(begun_on) = checkpoint.views.filter(|begun_on| *begun_on != views) {
        bail!(
            "{}: expected the {} training views that the run in {} began on, found {}: other names, poses, intrinsics or times",
            request.dataset.display(),
            begun_on.views,
            request.folder.path().display(),
            views.views
        );
    }
    Ok(Some(checkpoint.trainer))
}

/// Training time so far, what observers do left out.
#[derive(Debug, Clone, Copy, Default)]
struct Clock {
    seconds: f64,
    cpu_seconds: Option<f64>,
}

impl Clock {
    fn add(&mut self, (begun, cpu_begun): (Instant, Option<f64>)) {
        self.seconds += begun.elapsed().as_secs_f64();
        self.cpu_seconds =
            self.cpu_seconds.zip(cpu_seconds().zip(cpu_begun)).map(|(sum, (now, begun))| sum + now - begun);
    }
}

/// A run under way: the state, and what watches it.
struct Run<'a> {
    request: &'a RunRequest,
    trainer: Trainer,
    origin: glam::DVec3,
    views: Fingerprint,
    prediction: Prediction,
    metrics: MetricsFile,
    history: Vec<MetricsLine>,
    evaluator: Evaluator,
    progress: Progress,
    clock: Clock,
    begun: Instant,
    /// Steps whose photo's depth prior fitted nothing that was rendered.
    depth_misfits: usize,
}

impl<'a> Run<'a> {
    /// `asked` is the configuration before the data set settled what it leaves open.
    fn begin(
        request: &'a RunRequest,
        asked: &Config,
        (origin, views): (glam::DVec3, Fingerprint),
        trainer: Trainer,
        prediction: Prediction,
    ) -> Result<Self> {
        let folder = &request.folder;
        folder.make()?;
        folder.prune_checkpoints(request.config.checkpoint.keep);
        folder.write_config(asked, &request.dataset)?;
        let history = if request.resume { folder.read_metrics(trainer.step)? } else { Vec::new() };
        let progress = Progress::new(trainer.step, request.config.steps, request.quiet);
        Ok(Self {
            metrics: folder.open_metrics(&history)?,
            clock: last_clock(&history),
            history,
            evaluator: Evaluator::new(&request.config.eval, &request.device),
            origin,
            views,
            begun: Instant::now(),
            depth_misfits: 0,
            request,
            trainer,
            prediction,
            progress,
        })
    }

    /// Bar and metrics after a step.
    fn observe(&mut self, report: &StepReport, photo: &Photo) -> Result<()> {
        let step = self.trainer.step;
        let last = step == self.request.config.steps;
        self.watch_depth(report);
        let checkpoint = due(step, self.request.config.checkpoint.every);
        // A line at every planned checkpoint, because the clock of a resumed run continues from the last line. A run that is stopped in
        // between has none there, so that its metrics are those of an uninterrupted one; it loses the clock of a few steps.
        let noted = due(step, METRICS_EVERY) || checkpoint || last || report.skipped;
        let psnr = (noted && !report.skipped).then(|| {
            let (image, truth) = (report.color.clone().clamp(0.0, 1.0), photo.image.clone());
            match &photo.mask {
                None => psnr(image, truth),
                Some(mask) => psnr_masked(image, truth, mask.clone()),
            }
        });
        self.progress.step(step, report.loss, psnr, self.trainer.parameters.len());
        if noted {
            self.note(MetricsLine::Train(TrainLine {
                step,
                loss: report.loss.is_finite().then_some(report.loss),
                psnr,
                gaussians: self.trainer.parameters.len(),
                sh_degree: self.trainer.parameters.sh_degree(),
                intersections: report.intersections,
                skipped: self.trainer.skipped,
                seconds: self.clock.seconds,
                cpu_seconds: self.clock.cpu_seconds,
            }))?;
        }
        Ok(())
    }

    fn note(&mut self, line: MetricsLine) -> Result<()> {
        self.metrics.append(&line)?;
        self.history.push(line);
        Ok(())
    }

    /// Renders and measures the held-out views (or the training views where there are none) and writes the figures.
    fn measure(&mut self, scene: &Scene, kept: usize) -> Result<(EvalFile, Vec<Comparison>)> {
        let (views, split) = if scene.test.is_empty() { (&scene.train, "train") } else { (&scene.test, "test") };
        let mut photos = Photos::new(views, &self.request.device, 0);
        let model = self.trainer.model();
        let (measured, comparisons) = self.evaluator.evaluate(&*model, &mut photos, &self.request.config, kept);
        let gaussians = self.trainer.parameters.gaussians();
        let evaluation = Evaluation {
            step: self.trainer.step,
            split: split.into(),
            seconds: self.clock.seconds,
            cpu_seconds: self.clock.cpu_seconds,
            peak_memory_bytes: peak_memory(),
            motion: self
                .trainer
                .motion
                .as_ref()
                .map(|state| measure::measure(state, &gaussians, scene, &self.request.config)),
            ..measured
        };
        self.progress.say(&evaluation.line());
        if let Some(motion) = &evaluation.motion {
            self.progress.say(&motion.line());
        }
        self.note(MetricsLine::Eval(Box::new(evaluation.clone())))?;
        let file = self.eval_file(evaluation);
        self.request.folder.write_eval(&file)?;
        Ok((file, comparisons))
    }

    fn eval_file(&self, last: Evaluation) -> EvalFile {
        // A finished run that is resumed is measured once more at its last step; the newer figures count.
        let mut evaluations = BTreeMap::new();
        for line in &self.history {
            if let MetricsLine::Eval(evaluation) = line {
                evaluations.insert(evaluation.step, Evaluation { views: Vec::new(), ..(**evaluation).clone() });
            }
        }
        EvalFile {
            name: self.request.folder.name(),
            dataset: full_path(&self.request.dataset).display().to_string(),
            device: self.request.device_name.clone(),
            steps: self.request.config.steps,
            cap: self.request.config.density.cap,
            skipped_steps: self.trainer.skipped,
            predicted_memory_bytes: self.prediction.total(),
            total_seconds: self.begun.elapsed().as_secs_f64(),
            last,
            evaluations: evaluations.into_values().collect(),
        }
    }

    fn save(&self) -> Result<()> {
        let folder = &self.request.folder;
        let checkpoint = Checkpoint {
            trainer: self.trainer.clone(),
            config: self.request.config.clone(),
            dataset: full_path(&self.request.dataset),
            origin: self.origin,
            views: Some(self.views),
        };
        checkpoint.save(&folder.checkpoint(self.trainer.step))?;
        folder.prune_checkpoints(self.request.config.checkpoint.keep);
        tracing::info!(step = self.trainer.step, "checkpoint saved");
        Ok(())
    }

    fn leave(self) -> Result<Ending> {
        self.save()?;
        profile::write_if_recording(&self.request.folder, &self.request.device_name)?;
        self.progress.finish();
        Ok(Ending::Interrupted(self.trainer.step))
    }

    fn finish(mut self, scene: &Scene) -> Result<Ending> {
        let folder = &self.request.folder;
        self.save()?;
        write_ply(&folder.ply(), &self.trainer.parameters.gaussians(), self.origin)
            .with_context(|| "the finished scene could not be exported")?;
        let (file, comparisons) = self.measure(scene, self.request.config.eval.images)?;
        self.progress.finish();
        profile::write_if_recording(folder, &self.request.device_name)?;
        report::write(folder, &file, &self.history, &comparisons, &self.request.config)?;
        if let Some(peak) = file.last.peak_memory_bytes {
            tracing::info!("peak memory {} (expected {})", megabytes(peak), megabytes(self.prediction.total()));
        }
        Ok(Ending::Finished(Box::new(file)))
    }
}

/// The clock at the last line of metrics.
fn last_clock(history: &[MetricsLine]) -> Clock {
    let last = history.iter().rev().find_map(|line| match line {
        MetricsLine::Train(line) => Some(Clock { seconds: line.seconds, cpu_seconds: line.cpu_seconds }),
        MetricsLine::Eval(_) => None,
    });
    last.unwrap_or(Clock { seconds: 0.0, cpu_seconds: cpu_seconds().map(|_| 0.0) })
}
