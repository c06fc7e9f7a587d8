//! A [`Method`](gs_train::fit::method::Method) as a pipeline: the loop that fits the Gaussians of one scene.

use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::path::Path;

use anyhow::{Error, Result, bail, ensure};
use burn::tensor::Device;
use glam::{DMat4, DVec3};
use gs_base::counted;
use gs_burn::limits::{gaussians_within, largest_buffer, too_many_gaussians};
use gs_datasets::{CheckReport, DatasetError, LoadOptions, PoseConvention, Scene, View};
use gs_driving::{LogFormat, logs_in};
use gs_models::{DynamicScene, Shutter};
use gs_multiview::PoseVerdict;
use toml::Table;

use super::from_scene::from_scene;
use super::plan::plan_steps;
use super::{EvalRequest, Evaluated, Extrapolate, Opened, Pipeline};
use gs_train::config::{Background, Config, ConfigError, FitConfig, tables};
use gs_train::fit::density::ops::Draft;
use gs_train::fit::facts::SceneFacts;
use gs_train::fit::intake::Intake;
use gs_train::fit::method::Step;
use gs_train::fit::preflight::{
    check_pixels, few_points, judge_dataset, judge_scene, leave_out_few_points, near_warning, no_pixels,
};
use gs_train::fit::region::{Region, bounds};
use gs_train::fit::saved::Saved;
use gs_train::fit::session::{Data, Session, Stepped};
use gs_train::fit::snapshot::{Notes, Snapshot, read_cameras, read_correction, read_gaussians, read_method, restore};
use gs_train::fit::timetable::Timetable;
use gs_train::fit::told::{ChartKey, Introduction, Told};
use gs_train::fit::trainer::{Model, Trainer};
use gs_train::run::checkpoint::{Checkpoint, Origin};
use gs_train::run::ending::LastFiles;
use gs_train::run::evaluate::{Evaluator, HeldOut};
use gs_train::run::exchange::host::gaussians_of;
use gs_train::run::fingerprint::Fingerprint;
use gs_train::run::folder::{Setting, full_path};
use gs_train::run::memory::{Prediction, megabytes};
use gs_train::run::metrics::psnr_counted;
use gs_train::run::outcome::{Contents, Outcome, ScenePhotos};
use gs_train::run::presentation;
use gs_train::run::progress;
use gs_train::run::resources::{Spent, Stopwatch};
use gs_train::run::retaken::retaken;
use gs_train::run::scene::{LoadedScene, SceneFile, SceneRun, placed_note, translated, within_reach, write_ply_as};
use gs_train::run::watch::{self, Ending, Job, Plan, Run};

/// A method with everything that a pipeline needs of it.
pub trait SceneMethod: Intake + Saved + Told {}

impl<M: Intake + Saved + Told> SceneMethod for M {}

/// The pipeline of a method.
pub struct Fit<M> {
    future: Option<Extrapolate>,
    method: PhantomData<fn() -> M>,
}

impl<M> Fit<M> {
    /// The pipeline of a method whose scenes have no future of their own.
    pub const NEW: Self = Self { future: None, method: PhantomData };

    /// The pipeline of a method with the future of its scenes.
    pub const fn with_future(future: Extrapolate) -> Self {
        Self { future: Some(future), method: PhantomData }
    }
}

/// Refuses a scene that would outgrow the device's buffers, before anything is read.
///
/// # Errors
/// A sentence with the number of Gaussians that fit.
fn check_capacity(config: &Config, device: &Device) -> Result<()> {
    let (cap, sh_degree) = (config.density.cap as u64, config.model.sh_degree);
    let Some(bytes) = largest_buffer(device) else { return Ok(()) };
    let most = gaussians_within(bytes, sh_degree);
    ensure!(cap <= most, too_many_gaussians(cap, sh_degree, bytes, most));
    Ok(())
}

/// Trains a scene: begin or resume, step until done while the run observes, save, measure.
fn fit<M: SceneMethod>(job: &Job, mut config: FitConfig<M::Config>) -> Result<Ending> {
    if let Some(outcome) = watch::finished(job, &config.to_toml()) {
        return Ok(Ending::Finished(outcome));
    }
    let lock = watch::acquire_lock(job)?;
    check_capacity(&config, &job.device)?;
    let (data, spent) = read::<M>(job, &mut config)?;
    let config = &config;
    let plan = plan::<M>(job, config, &data);
    let watch = Stopwatch::start();
    let trainer = match newest::<M>(job, config, &plan)? {
        None => from_scene(&data, config, &job.device)?,
        saved => saved,
    };
    let mut session = Session::begin(&data, config, trainer, &job.device);
    check_region(&session.trainer, &data)?;
    let mut run = Run::begin(job, plan, session.trainer.step, lock)?;
    if session.trainer.step == 0 {
        // Photos, cues and initial Gaussians take from seconds to minutes.
        run.count_spent(spent);
        run.count_time(watch);
    }
    let introduction = session.trainer.method().introduction(&data.scene, &session.at());
    introduce(&run, &session, job, &introduction);
    if let Some(schedule) = &introduction.schedule {
        run.plot(schedule)?;
    }
    let evaluator = Evaluator::new(&config.eval, &job.device);

    while session.trainer.step < config.steps {
        if run.is_stopped(session.trainer.step) {
            run.save(session.trainer.step, &Snapshot::of(&session.trainer))?;
            return run.leave(session.trainer.step);
        }
        let stepped = run.timed(|| session.step());
        observe(&mut run, &session, stepped);
        let step = session.trainer.step;
        if config.eval.at.contains(&step) && step < config.steps {
            let held_out = HeldOut::of::<M>(&data.scene, None).expect("the reported split");
            let (measured, _) = evaluator.measure(session.trainer.model(), &data.scene, &held_out, &session.at(), 0);
            run.record(step, measured).1?;
        }
        if run.is_save_due(step) {
            run.save_on_the_way(step, &Snapshot::of(&session.trainer));
        }
    }
    let trainer = session.into_trainer();
    finish(run, job, data, trainer, config, &evaluator, introduction.schedule)
}

/// Refuses a region of interest in which no Gaussian begins.
///
/// # Errors
/// A sentence with the bounds of the Gaussians.
fn check_region<M: SceneMethod>(trainer: &Trainer<M>, data: &Data<M>) -> Result<()> {
    let Some(region) = trainer.facts.region else { return Ok(()) };
    let means = Draft::read(trainer.gaussians()).means;
    ensure!(
        means.iter().any(|mean| region.contains(*mean)),
        "data.region: expected Gaussians to begin with in the box, found none; 90 % of them are at {}",
        bounds(&means, data.scene.origin)
    );
    Ok(())
}

/// Reads the data set of a job, and plans the steps if the job has a budget of minutes; with the seconds of reading,
/// and those of the processor.
fn read<M: SceneMethod>(job: &Job, config: &mut FitConfig<M::Config>) -> Result<(Data<M>, Spent)> {
    let watch = Stopwatch::start();
    progress::say(&format!("reading {} ...", job.dataset.display()), job.quiet);
    let data = Data::<M>::new(load::<M>(&job.dataset, config)?, config);
    let spent = watch.spent();
    let Some(minutes) = job.minutes else { return Ok((data, spent)) };
    let begin = from_scene(&data, config, &job.device)?;
    let (data, plan) = plan_steps(data, config, begin, minutes, job, &watch)?;
    progress::say(&plan.line(minutes), job.quiet);
    config.shared.steps = plan.steps;
    let coarse = Data::<M>::coarse_of(&data.scene, config);
    Ok((Data { coarse, ..data }, spent))
}

/// Saves and measures a finished training. Of the files that a disk is too full for, the others are written
/// all the same.
fn finish<M: SceneMethod>(
    mut run: Run,
    job: &Job,
    data: Data<M>,
    trainer: Trainer<M>,
    config: &FitConfig<M::Config>,
    evaluator: &Evaluator,
    schedule: Option<Timetable>,
) -> Result<Ending> {
    let (step, at) = (trainer.step, trainer.at(&data.cues, config));
    let mut files = LastFiles::default();
    files.tried("the checkpoint", run.save(step, &Snapshot::of(&trainer)));
    let (path, antialiased) = (job.folder.ply(), Some(config.render.antialiased));
    let ply = write_ply_as(&path, trainer.gaussians(), data.scene.origin, antialiased);
    files.tried("scene.ply", ply.map_err(|error| error.context("the finished scene could not be exported")));
    if let Some(note) = placed_note(data.scene.origin) {
        run.say(&format!("{}: {note}", path.display()));
    }
    let held_out = HeldOut::of::<M>(&data.scene, None).expect("the reported split");
    let (measured, mut pictures) = evaluator.measure(trainer.model(), &data.scene, &held_out, &at, config.eval.images);
    if config.eval.images > 0 {
        pictures.extend(retaken(trainer.model(), &data.scene.train, &at, &job.device));
    }
    let (eval, written) = run.record(step, measured);
    files.tried("eval.json", written);
    let (history, written) = run.finish();
    files.tried("metrics.jsonl", written);
    let scene = loaded(trainer.model(), config, trainer.facts, data.scene.origin, None);
    let scene = scene.presented(&eval.name, presentation::cameras(&data.scene));
    let (facts, render, device) = (trainer.facts, config.render.clone(), job.device.clone());
    let photos = Some(ScenePhotos { photos: data.scene, facts, render, device });
    let contents =
        Contents { config: config.to_toml(), history, pictures, schedule, scene: Some(scene), photos, files };
    Ok(Ending::Finished(Outcome { eval, report: Some(Box::new(contents)) }))
}

/// Reads the data set at `path` for training and measuring.
///
/// # Errors
/// A sentence naming the file, what was expected and what was found; or the reason why the method cannot learn from it.
pub fn load<M: SceneMethod>(path: &Path, config: &FitConfig<M::Config>) -> Result<Scene> {
    let loaded = load_posed(path, options::<M>(config));
    let mut scene = loaded.map_err(|error| driving(path, M::NAME).map_or_else(|| error.into(), Error::msg))?;
    let warnings = scene.warnings.len();
    scene.warnings.extend(leave_out_few_points(&mut scene.points));
    scene.warnings.extend(Some(config.data.memory_mb).filter(|_| !M::ON_DEMAND).and_then(|mb| too_large(&scene, mb)));
    let prepared = M::prepare(path, &mut scene, config);
    for warning in &scene.warnings[warnings..] {
        tracing::warn!("{warning}");
    }
    let timed = scene.train.iter().filter(|view| view.time.is_some()).count();
    M::suits(path, scene.train.len(), timed).map_err(Error::msg)?;
    prepared.map_err(Error::msg)?;
    check_pixels(path, &scene).map_err(Error::msg)?;
    Ok(scene)
}

/// Reads a data set; its poses as the photos say that they are meant, where nobody says it and they speak against the
/// format's own.
fn load_posed(path: &Path, options: LoadOptions) -> Result<Scene, DatasetError> {
    let mut scene = gs_datasets::load(path, &options)?;
    let (judgement, is_open) = (judge_scene(&scene), options.poses.is_none());
    if let PoseVerdict::Convention(other, _) = judgement.verdict
        && is_open
    {
        scene = gs_datasets::load(path, &LoadOptions { poses: Some(other), ..options })?;
    }
    if let Some(fault) = judgement.warning(is_open) {
        tracing::warn!("{fault}");
        scene.warnings.push(fault);
    }
    Ok(scene)
}

/// A warning about photos that take more than `data.memory_mb`, of a pipeline that looks at all of them.
fn too_large(scene: &Scene, memory_mb: usize) -> Option<String> {
    let bytes: usize = scene.train.iter().chain(scene.held_out_views()).map(View::bytes).sum();
    (bytes > memory_mb << 20).then(|| {
        format!(
            "photos take {}, more than data.memory_mb = {memory_mb}: only pipeline=static decodes them when they are \
             asked for; all are kept in memory",
            megabytes(bytes as u64)
        )
    })
}

/// Why a driving log is no data set of this pipeline; `None` where there is none.
fn driving(path: &Path, name: &str) -> Option<String> {
    let is_log = LogFormat::of(path).is_some() || path.is_dir() && logs_in(path).is_ok_and(|logs| !logs.is_empty());
    let (path, of_logs) = (path.display(), super::flux4d::NAME);
    is_log.then(|| {
        format!(
            "{path}: expected photos for the pipeline {name}, found driving logs, which --set pipeline={of_logs} takes"
        )
    })
}

fn options<M: SceneMethod>(config: &FitConfig<M::Config>) -> LoadOptions {
    let mut options = config.data.options();
    options.memory = M::ON_DEMAND.then_some(config.data.memory_mb << 20);
    M::loading(config, &mut options);
    options
}

fn plan<M: SceneMethod>(job: &Job, config: &FitConfig<M::Config>, data: &Data<M>) -> Plan {
    let views = Fingerprint::of(&data.scene);
    let scene = &data.scene;
    let mut origin = Origin::new(M::NAME, config.to_toml(), full_path(&job.dataset), scene.origin, views);
    origin.poses = (scene.poses != PoseConvention::of(scene.format)).then(|| scene.poses.to_string());
    let fact = |(name, value, key): (&str, String, &str)| (name.to_string(), value, key.to_string());
    Plan {
        steps: config.steps,
        checkpoint: config.checkpoint.clone(),
        origin,
        prediction: Prediction::of_fit::<M>(&data.scene, config),
        facts: data.facts.listed().into_iter().map(fact).collect(),
        settings: settings(M::chart_keys(), &config.to_table()),
    }
}

/// The values of the keys by which charts distinguish runs, as far as they have a meaning.
fn settings(keys: &[ChartKey], config: &Table) -> Vec<Setting> {
    let values: BTreeMap<String, String> = tables::flat(config).into_iter().collect();
    let means_something =
        |key: &&ChartKey| key.unless.is_none_or(|(other, value)| values.get(other).is_none_or(|found| found != value));
    let setting = |key: &ChartKey| {
        let value = values.get(key.key)?.clone();
        Some(Setting { name: key.name.into(), key: key.key.into(), label: key.label(&value), value })
    };
    keys.iter().filter(means_something).filter_map(setting).collect()
}

/// The state of the newest checkpoint, if the run is to be continued and has one.
fn newest<M: SceneMethod>(job: &Job, config: &FitConfig<M::Config>, plan: &Plan) -> Result<Option<Trainer<M>>> {
    let Some(checkpoint) = watch::newest_checkpoint(job, &plan.origin.config)? else { return Ok(None) };
    watch::check_views(job, checkpoint.origin.views, plan.origin.views)?;
    let restored = restore::<M>(&checkpoint, config, &job.device);
    Ok(Some(restored.map_err(|found| checkpoint.damaged(found))?))
}

/// Prints what the run is about to do.
fn introduce<M: SceneMethod>(run: &Run, session: &Session<M>, job: &Job, introduction: &Introduction) {
    let (scene, trainer) = (&session.data.scene, &session.trainer);
    let size = scene.train.first().map_or((0, 0), |view| (view.width, view.height));
    let held_out: Vec<String> =
        scene.held_out.iter().map(|split| format!("{} {}", split.views.len(), split.name)).collect();
    let held_out = if held_out.is_empty() { "0 held-out".to_string() } else { held_out.join(" and ") };
    run.say(&format!(
        "{} ({}): {} training and {held_out} views of {} x {} pixels, {} to begin with, at most {}",
        job.dataset.display(),
        scene.format,
        scene.train.len(),
        size.0,
        size.1,
        counted(trainer.gaussians().len(), "Gaussian"),
        session.config.density.cap
    ));
    let near_open = session.config.render.near == 0.0;
    let background_open = matches!(session.config.data.background, Background::Found(_));
    let is_open = |key: &str| (key == "render.near" && near_open) || (key == "data.background" && background_open);
    let facts = trainer.facts.listed().into_iter().filter(|(_, _, key)| is_open(key));
    let facts: Vec<String> = facts.map(|(name, value, key)| format!("{name} {value} ({key})")).collect();
    if !facts.is_empty() {
        run.say(&format!("found in the data set: {}", facts.join("; ")));
    }
    if let Some(correction) = &trainer.model().correction {
        run.say(&format!("photos differ in exposure: {} (correction.mode)", correction.described()));
    }
    introduction.lines.iter().for_each(|line| run.say(line));
    let near = near_warning(trainer.facts.near, trainer.facts.subject_distance);
    introduction.warnings.iter().chain(&near).for_each(|warning| run.say(&format!("warning: {warning}")));
}

/// Updates bar and metrics after a step.
fn observe<M: SceneMethod>(run: &mut Run, session: &Session<M>, stepped: Stepped<M::Extra>) {
    let Stepped { report, photos } = stepped;
    let trainer = &session.trainer;
    let counts = [
        (watch::GAUSSIANS, trainer.gaussians().len() as f64),
        ("SH degree", trainer.gaussians().sh_degree() as f64),
        ("tile intersections", report.intersections as f64),
    ];
    run.count(&report.notes, trainer.step);
    run.observe(trainer.step, (report.loss, trainer.skipped), &counts, || {
        let (image, photo) = report.images.first().zip(photos.first())?;
        let (image, truth) = (image.clone().clamp(0.0, 1.0), photo.image.clone());
        Some(psnr_counted(image, truth, photo.mask.clone()))
    });
}

impl<M: SceneMethod> Pipeline for Fit<M> {
    fn name(&self) -> &'static str {
        M::NAME
    }

    fn defaults(&self) -> Table {
        M::defaults().to_table()
    }

    fn validate(&self, config: &Table, origin: &str) -> Result<String, ConfigError> {
        Ok(FitConfig::<M::Config>::from_table(config, origin)?.to_toml())
    }

    fn check(&self, dataset: &Path, config: &Table) -> Result<CheckReport> {
        let config = FitConfig::<M::Config>::from_table(config, "configuration")?;
        let mut report = gs_datasets::check(dataset, &options::<M>(&config));
        // Without a training view the report gives the reason, and there is nothing to check against the configuration.
        if report.train == 0 {
            return Ok(report);
        }
        report.warnings.extend(M::leaves_out(report.without_time));
        if config.render.near > 0.0 {
            report.warnings.extend(near_warning(config.render.near, report.subject_distance));
        }
        report.warnings.extend(few_points(report.points));
        report.errors.extend((report.blank == report.views()).then(|| no_pixels(dataset)));
        report.errors.extend(M::suits(dataset, report.train, report.timed).err());
        // Its errors are in the report.
        if report.is_ok()
            && let Ok(judgement) = judge_dataset(dataset, &options::<M>(&config))
        {
            report.facts.push(judgement.fact());
            report.warnings.extend(judgement.warning(config.data.options().poses.is_none()));
        }
        Ok(report)
    }

    fn train(&self, job: &Job) -> Result<Ending> {
        if job.devices() > 1 {
            bail!("--devices {}: the pipeline {} trains on one device", job.devices(), M::NAME);
        }
        fit::<M>(job, FitConfig::from_table(&job.config, "configuration")?)
    }

    fn open(&self, checkpoint: &Checkpoint, dataset: Option<&Path>, device: &Device) -> Result<Opened> {
        let (model, config, notes) = read_model::<M>(checkpoint, device)?;
        let run = SceneRun {
            pipeline: M::NAME.into(),
            dataset: checkpoint.origin.dataset.clone(),
            poses: checkpoint.origin.poses.as_ref().and_then(|poses| poses.parse().ok()),
            step: notes.counters.step,
            described: model.method.described(),
        };
        let loaded = loaded(&model, &config, notes.facts(), checkpoint.origin.world(), Some(run));
        let photos = dataset.map(|dataset| photos_of::<M>(dataset, &config, &loaded)).transpose()?;
        Ok(Opened { loaded, photos })
    }

    fn evaluate(&self, request: &EvalRequest) -> Result<Evaluated> {
        let config = FitConfig::<M::Config>::from_table(request.config, "configuration")?;
        let scene = load::<M>(request.dataset, &config)?;
        // A measurement reads no cue.
        let cues = M::Cues::default();
        // As in training: a checkpoint has its facts; those of a PLY file are derived again.
        let (mut model, facts, step, origin) = match request.file {
            SceneFile::Checkpoint(checkpoint) => {
                let (model, _, notes) = read_model::<M>(checkpoint, request.device)?;
                let region = Region::of(&config.data.region, scene.origin);
                let facts = SceneFacts { region, ..notes.facts() };
                (model, facts, notes.counters.step, checkpoint.origin.world())
            }
            SceneFile::Ply(packed) => {
                let facts = SceneFacts::of(&scene, &config, M::near_share(&scene, &config), M::UNSEEN);
                let at = Step { step: 0, config: &config, facts: &facts, cues: &cues, room: None };
                let method = M::at_rest(&scene, &at, request.device).map_err(Error::msg)?;
                let gaussians = gaussians_of(&packed.splats, request.device);
                (Model::uncorrected(gaussians, method), facts, 0, DVec3::from_array(packed.splats.offset))
            }
        };
        // A file and a checkpoint have their `origin` subtracted, views have `scene.origin` subtracted.
        model.gaussians = translated(&model.gaussians, origin - scene.origin);
        let at = Step { step: step.max(1), config: &config, facts: &facts, cues: &cues, room: None };
        let Some(held_out) = HeldOut::of::<M>(&scene, request.split) else {
            let names: Vec<&str> = scene.held_out.iter().map(|split| split.name.as_str()).collect();
            let asked = request.split.unwrap_or_default();
            bail!("{}: expected a split from train, {}; found {asked:?}", request.dataset.display(), names.join(", "));
        };
        let of_model = model.method.scene(model.gaussians.clone());
        let name = request.dataset.display().to_string();
        within_reach(&*of_model, &name, held_out.views.iter().filter_map(|view| view.time))?;
        let kept = if request.pictures { held_out.views.len() } else { 0 };
        let evaluator = Evaluator::new(&config.eval, request.device);
        let (measured, pictures) = evaluator.measure(&model, &scene, &held_out, &at, kept);
        Ok(Evaluated { step, measured, pictures })
    }

    fn future(&self) -> Option<Extrapolate> {
        self.future
    }
}

/// The photos of a data set with the origin of a scene subtracted from their cameras.
///
/// # Errors
/// A sentence about the data set, or when the scene cannot be asked at its times.
fn photos_of<M: SceneMethod>(dataset: &Path, config: &FitConfig<M::Config>, loaded: &LoadedScene) -> Result<Scene> {
    let mut photos = load::<M>(dataset, config)?;
    let shift = photos.origin - loaded.origin;
    let views = photos.train.iter_mut().chain(photos.held_out.iter_mut().flat_map(|split| &mut split.views));
    views.for_each(|view| view.c2w = DMat4::from_translation(shift) * view.c2w);
    photos.origin -= shift;
    let times = photos.train.iter().chain(photos.held_out_views()).filter_map(|view| view.time);
    within_reach(&*loaded.scene, &dataset.display().to_string(), times)?;
    Ok(photos)
}

/// A model as a scene.
fn loaded<M: SceneMethod>(
    model: &Model<M>,
    config: &FitConfig<M::Config>,
    facts: SceneFacts,
    origin: DVec3,
    run: Option<SceneRun>,
) -> LoadedScene {
    let Model { gaussians, method, .. } = model;
    let scene = method.scene(gaussians.clone());
    LoadedScene {
        shutter: shutter::<M>(&*scene, config),
        scene,
        gaussians: gaussians.clone(),
        origin,
        facts,
        render: config.render.clone(),
        middle: method.middle(),
        run,
    }
}

/// How exposures are formed, where the method and `config` model blur.
fn shutter<M: Told>(scene: &dyn DynamicScene, config: &FitConfig<M::Config>) -> Option<Shutter> {
    M::blur()?.shutter(scene, config)
}

/// The model of a checkpoint with its configuration and notes, on `device` without autodiff.
///
/// # Errors
/// A sentence when the checkpoint is damaged or of another pipeline.
pub fn read_model<M: SceneMethod>(
    checkpoint: &Checkpoint,
    device: &Device,
) -> Result<(Model<M>, FitConfig<M::Config>, Notes)> {
    let origin = format!("{}: configuration", checkpoint.path.display());
    let config = FitConfig::<M::Config>::from_table(&tables::parse(&checkpoint.origin.config, &origin)?, &origin)?;
    let read = || -> Result<(Model<M>, Notes), String> {
        let gaussians = read_gaussians(checkpoint, device)?;
        let method = read_method::<M>(checkpoint, gaussians.len(), &config, device)?;
        let correction = read_correction(checkpoint, device)?;
        let cameras = read_cameras(checkpoint, device)?;
        Ok((Model { gaussians, correction, cameras, method }, Notes::read(checkpoint)?))
    };
    let (model, notes) = read().map_err(|found| checkpoint.damaged(found))?;
    Ok((model, config, notes))
}
