//! Training: snippets of many logs in an order of the seed, one step after another under a [`Run`].

use std::sync::Arc;

use anyhow::{Result, bail};
use burn::tensor::Device;
use glam::DVec3;
use gs_base::counted;

use super::NAME;
use super::config::FluxConfig;
use super::evaluate::Measurement;
use super::feed::{Feed, SnippetCache};
use super::logs::Logs;
use super::memory;
use super::network::FluxNetwork;
use super::observer::Observer;
use super::saved::{parameters, restore};
use super::trainer::{Setup, step};
use gs_train::fit::snapshot::Snapshot;
use gs_train::fit::training::Training;
use gs_train::run::checkpoint::Origin;
use gs_train::run::ending::LastFiles;
use gs_train::run::folder::{Setting, full_path};
use gs_train::run::memory::Prediction;
use gs_train::run::outcome::{Contents, Outcome};
use gs_train::run::progress;
use gs_train::run::scene::{placed_note, write_ply};
use gs_train::run::watch::{self, Ending, Job, Plan, Run};

/// Trains a network: begin or resume, take steps while the run observes, save, measure.
///
/// # Errors
/// One sentence: bad data, a damaged checkpoint, a full disk.
pub fn train(job: &Job, config: &FluxConfig) -> Result<Ending> {
    if let Some(outcome) = watch::finished(job, &config.to_toml()) {
        return Ok(Ending::Finished(outcome));
    }
    check_devices(job, config)?;
    let lock = watch::acquire_lock(job)?;
    progress::say(&format!("reading {} ...", job.dataset.display()), job.quiet);
    let logs = Arc::new(Logs::open(&job.dataset, &config.own.logs)?);
    logs.warn();
    let mut plan = plan(job, config, &logs);
    let training = newest(job, config, &plan)?;
    plan.prediction = memory::of_training(config, &logs, parameters(training.module()), job.devices());
    let run = Run::begin(job, plan, training.step, lock)?;
    introduce(&run, &logs, &training);
    let observer = Observer::new(run, logs, config.clone(), job.device.clone());
    let (training, observer) = advance(training, observer, job)?;
    if training.step < config.steps {
        observer.run.save(training.step, &Snapshot::of_training(&training))?;
        return observer.run.leave(training.step);
    }
    finish(observer, job, &training)
}

/// Takes steps until the training is over; the run observes.
fn advance(
    mut training: Training<FluxNetwork>,
    mut observer: Observer,
    job: &Job,
) -> Result<(Training<FluxNetwork>, Observer)> {
    let devices: Vec<Device> = std::iter::once(&job.device).chain(&job.more_devices).cloned().collect();
    let (logs, config) = (observer.logs.clone(), observer.config.clone());
    let accumulate = config.own.learning.accumulate;
    let cache = Arc::new(SnippetCache::new(logs.clone(), &config));
    let mut feed = Feed::start(&cache, training.step * accumulate, devices.len())?;
    let setup = Setup { logs: &logs, config: &config, devices: &devices };
    while !observer.is_over(training.step) {
        let snippets = (0..accumulate).map(|_| feed.take()).collect::<Result<Vec<_>>>()?;
        let mut reasons = Vec::new();
        let report = observer
            .run
            .timed(|| step(&mut training, &snippets, setup, &mut |reason| reasons.push(reason.to_string())));
        observer.observe(&training, report, &reasons)?;
    }
    Ok((training, observer))
}

/// Checks that the devices of a job can share its steps.
fn check_devices(job: &Job, config: &FluxConfig) -> Result<()> {
    let (devices, accumulate) = (job.devices(), config.own.learning.accumulate);
    if accumulate % devices != 0 {
        bail!(
            "--devices {devices}: expected a multiple of it in learning.accumulate, the snippets of a step, which the \
             devices share; found {accumulate}"
        );
    }
    Ok(())
}

fn finish(observer: Observer, job: &Job, training: &Training<FluxNetwork>) -> Result<Ending> {
    let mut files = LastFiles::default();
    files.tried("the checkpoint", observer.run.save(training.step, &Snapshot::of_training(training)));
    let Measurement { measured, pictures, scene, viewed } = observer.measure(training, observer.config.eval.images)?;
    let Observer { mut run, config, .. } = observer;
    if let Some((gaussians, origin)) = scene {
        let ply = write_ply(&job.folder.ply(), &gaussians, origin);
        files
            .tried("scene.ply", ply.map_err(|error| error.context("the first held-out snippet could not be exported")));
        if let Some(note) = placed_note(origin) {
            run.say(&format!("{}: {note}", job.folder.ply().display()));
        }
    }
    let (eval, written) = run.record(training.step, measured);
    files.tried("eval.json", written);
    let (history, written) = run.finish();
    files.tried("metrics.jsonl", written);
    let (config, schedule, photos) = (config.to_toml(), None, None);
    let contents = Contents { config, history, pictures, schedule, scene: viewed, photos, files };
    Ok(Ending::Finished(Outcome { eval, report: Some(Box::new(contents)) }))
}

/// The saved training, or one before its first step.
fn newest(job: &Job, config: &FluxConfig, plan: &Plan) -> Result<Training<FluxNetwork>> {
    match watch::newest_checkpoint(job, &config.to_toml())? {
        Some(checkpoint) => {
            watch::check_views(job, checkpoint.origin.views, plan.origin.views)?;
            Ok(restore(&checkpoint, config, &job.device).map_err(|found| checkpoint.damaged(found))?)
        }
        None => Ok(Training::new(FluxNetwork::new(config, &job.device))),
    }
}

fn introduce(run: &Run, logs: &Logs, training: &Training<FluxNetwork>) {
    run.say(&format!(
        "{} with {} to train on and {} of the split {}; {} parameters",
        counted(logs.logs.len(), "log"),
        counted(logs.train.len(), "snippet"),
        counted(logs.held_out.len(), "snippet"),
        logs.split,
        parameters(training.module()),
    ));
    if logs.split == "train" {
        run.say("warning: no log is held out, so the figures are those of training snippets");
    }
}

fn plan(job: &Job, config: &FluxConfig, logs: &Logs) -> Plan {
    let origin = Origin::new(NAME, config.to_toml(), full_path(&job.dataset), DVec3::ZERO, logs.fingerprint());
    let own = &config.own;
    let setting = |name: &str, key: &str, value: String, label: String| Setting {
        name: name.into(),
        key: key.into(),
        value,
        label,
    };
    let (width, passes, points) = (own.unet.width, own.refinement.passes, own.lift.points);
    let settings = vec![
        setting("width", "unet.width", width.to_string(), format!("width {width}")),
        setting("passes", "refinement.passes", passes.to_string(), format!("{passes} passes")),
        setting("points", "lift.points", points.to_string(), format!("{points} points")),
        setting("degree", "unet.degree", own.unet.degree.to_string(), format!("degree {}", own.unet.degree)),
    ];
    let (facts, prediction) = (Vec::new(), Prediction::default());
    Plan { steps: config.steps, checkpoint: config.checkpoint.clone(), origin, prediction, facts, settings }
}
