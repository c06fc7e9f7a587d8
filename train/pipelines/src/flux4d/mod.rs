//! Flux4D: a network that turns a driving log into moving Gaussians, trained on many logs without labels.
//!
//! It fits no scene, so it is a [`Pipeline`] of its own around steps over snippets.
//!
//! | file | idea |
//! |---|---|
//! | [`config`] | the sections and their ranges |
//! | [`logs`] | the logs of a folder and their snippets |
//! | [`prepare`](mod@prepare), [`host_view`] | a snippet on the host; its images |
//! | [`points`], [`start`] | its points; the velocities that its sweeps show |
//! | [`feed`], [`recolour`] | the snippets of steps to come; other colours for them |
//! | [`memory`] | prediction of the memory |
//! | [`sample`], [`network`] | a snippet on the device; the networks `f` and `r` |
//! | [`trainer`] | a step, on one device or several |
//! | [`train`](mod@train), [`observer`], [`saved`] | the run; what follows a step; checkpoints |
//! | [`infer`](mod@infer), [`confirm`] | the network applied; its motions held against the sweeps |
//! | [`evaluate`], [`moving`] | figures of held-out images; the pixels that move |
//! | [`label_scores`], [`flow`], [`actor_recall`] | figures of the flow and the actors against labels |
//! | [`sweep_flow`](mod@sweep_flow), [`protocol`] | scene flow of sweeps alone; the points that are scored |
//! | [`reconstruct`](mod@reconstruct), [`summary`] | a log to images, actors and Gaussians; the figures |
//! | [`degrees`], [`actors_file`], [`world`] | degrees of velocities; the file of the actors; the axes of the world |
//! | [`polish`](mod@polish) | the Gaussians of one snippet optimised after the network |

pub mod actor_recall;
pub mod actors_file;
pub mod config;
pub mod confirm;
pub mod degrees;
pub mod evaluate;
pub mod feed;
pub mod flow;
pub mod host_view;
pub mod infer;
pub mod label_scores;
pub mod logs;
pub mod memory;
pub mod moving;
pub mod network;
pub mod observer;
pub mod points;
pub mod polish;
pub mod prepare;
pub mod protocol;
pub mod recolour;
pub mod reconstruct;
pub mod sample;
pub mod saved;
mod snippet_page;
pub mod start;
pub mod summary;
pub mod sweep_flow;
pub mod train;
pub mod trainer;
pub mod world;

use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, bail};
use burn::tensor::Device;
use gs_base::counted;
use gs_datasets::CheckReport;
use toml::Table;

use super::{EvalRequest, Evaluated, Networks, Opened, Pipeline, Reconstruction, resolve_changed};
use config::FluxConfig;
use evaluate::{Split, measure};
use gs_train::config::{ConfigError, tables};
use gs_train::fit::snapshot::Snapshot;
use gs_train::fit::training::Training;
use gs_train::run::checkpoint::Checkpoint;
use gs_train::run::scene::SceneFile;
use gs_train::run::watch::{Ending, Job};
use gs_train::sentence::one_sentence;
use logs::Logs;
use saved::{SavedNetwork, read_network};

/// The pipeline's name.
pub const NAME: &str = "flux4d";

/// The pipeline.
pub struct Flux4d;

impl Pipeline for Flux4d {
    fn name(&self) -> &'static str {
        NAME
    }

    fn defaults(&self) -> Table {
        FluxConfig::default().to_table()
    }

    fn validate(&self, config: &Table, origin: &str) -> Result<String, ConfigError> {
        Ok(FluxConfig::from_table(config, origin)?.to_toml())
    }

    fn check(&self, dataset: &Path, config: &Table) -> Result<CheckReport> {
        let config = FluxConfig::from_table(config, "configuration")?;
        let mut report = CheckReport { path: dataset.to_path_buf(), ..CheckReport::default() };
        match Logs::open(dataset, &config.own.logs) {
            Err(error) => report.errors.push(one_sentence(&error)),
            Ok(logs) => {
                report.train = logs.train.len();
                report.held_out = vec![(logs.split.to_string(), logs.held_out.len())];
                for log in &logs.logs {
                    let (frames, cameras) =
                        (counted(log.frames().len(), "frame"), counted(log.cameras().len(), "camera"));
                    report.facts.push(format!("log {} ({}): {frames}, {cameras}", log.name(), log.format().name()));
                    report.warnings.extend(log.warnings().iter().cloned());
                    let gaps = logs::gaps(log);
                    report.warnings.extend(gaps.map(|gaps| format!("log {}: {gaps}", log.name())));
                }
                let (train, held) = (counted(logs.train.len(), "snippet"), counted(logs.held_out.len(), "snippet"));
                report.facts.push(format!("{train} to train on, {held} of the split {}", logs.split));
            }
        }
        Ok(report)
    }

    fn train(&self, job: &Job) -> Result<Ending> {
        if job.minutes.is_some() {
            bail!("--minutes: expected a pipeline that fits one scene, found {NAME}; use --steps");
        }
        train::train(job, &FluxConfig::from_table(&job.config, "configuration")?)
    }

    fn open(&self, checkpoint: &Checkpoint, _dataset: Option<&Path>, _device: &Device) -> Result<Opened> {
        bail!("{}: {NO_SCENE}", checkpoint.path.display())
    }

    fn evaluate(&self, request: &EvalRequest) -> Result<Evaluated> {
        let SceneFile::Checkpoint(checkpoint) = request.file else {
            bail!("expected a run or a checkpoint of the pipeline {NAME}, found a PLY file, which is no network");
        };
        let saved = read_configured(checkpoint, request.config, request.device)?;
        let config = &saved.config;
        let trained = tables::parse(&checkpoint.origin.config, "configuration")?;
        let trained = FluxConfig::from_table(&trained, "configuration")?.own.logs;
        let asked = &config.own.logs;
        let is_asked = asked.validation != trained.validation || asked.split != trained.split;
        let logs = Arc::new(Logs::open_to_measure(request.dataset, asked, &checkpoint.origin.views, is_asked)?);
        logs.warn();
        let name = request.split.unwrap_or(logs.split);
        let places = match name {
            "train" => &logs.train,
            name if name == logs.split => &logs.held_out,
            other => {
                let path = request.dataset.display();
                bail!("{path}: expected a split from train, {}; found {other:?}", logs.split)
            }
        };
        let pictures = if request.pictures { usize::MAX } else { 0 };
        let split = Split { logs: &logs, places, name, pictures };
        let found = measure(&saved.network, &split, config, request.device)?;
        Ok(Evaluated { step: saved.step, measured: found.measured, pictures: found.pictures })
    }

    fn networks(&self) -> Option<&dyn Networks> {
        Some(self)
    }
}

impl Networks for Flux4d {
    fn reconstruct(&self, checkpoint: &Checkpoint, request: &Reconstruction) -> Result<Vec<String>> {
        let origin = format!("{}: configuration", checkpoint.path.display());
        let config = resolve_changed(&tables::parse(&checkpoint.origin.config, &origin)?, &origin, request.set)?.config;
        reconstruct::reconstruct(&read_configured(checkpoint, &config, request.device)?, request)
    }

    fn alone(&self, checkpoint: &Checkpoint, device: &Device) -> Result<Snapshot> {
        // Counters without the state of the optimiser: a third of a checkpoint.
        let SavedNetwork { network, step, .. } = read_network(checkpoint, device)?;
        let mut training = Training::new(network);
        training.step = step;
        Ok(Snapshot::of_training(&training))
    }
}

/// Why a checkpoint cannot be shown.
const NO_SCENE: &str =
    "expected a scene, found a network; `gsburn reconstruct LOG --model RUN` makes a scene of a log with it";

/// The network of a checkpoint with another configuration, whose network is the same.
fn read_configured(checkpoint: &Checkpoint, config: &Table, device: &Device) -> Result<SavedNetwork> {
    let saved = read_network(checkpoint, device)?;
    let config = FluxConfig::from_table(config, "configuration")?;
    let networks = [&config, &saved.config].map(|config| (&config.own.unet, config.own.refinement.passes > 1));
    if networks[0] != networks[1] {
        bail!("{}: the keys of [unet] and refinement are those of the network", checkpoint.path.display());
    }
    Ok(SavedNetwork { config, ..saved })
}
