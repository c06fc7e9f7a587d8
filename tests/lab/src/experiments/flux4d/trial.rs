//! Streets on disk and networks applied to them.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use gs_driving::{DrivingLog, INTERPOLATION_FRAMES, Snippet};
use gs_pipelines::flux4d::config::FluxConfig;
use gs_pipelines::flux4d::evaluate::{Split, measure};
use gs_pipelines::flux4d::infer::{Inferred, infer};
use gs_pipelines::flux4d::logs::{Logs, open};
use gs_pipelines::flux4d::network::FluxNetwork;
use gs_pipelines::flux4d::prepare::{HostSnippet, prepare};
use gs_pipelines::flux4d::saved::{SavedNetwork, read_network, shipped_checkpoint};
use gs_train::run::measured::Measured;
use gs_worlds::driving::StreetOptions;

use crate::experiments::Lab;
use crate::experiments::lab::{figure, go_on};

/// Seed of the streets of experiments: none of those that the shipped network was trained on.
const SEED: u64 = 2000;

/// The street of the experiments: one snippet of eleven frames before the front camera.
pub fn street() -> StreetOptions {
    StreetOptions { frames: 11, cameras: 1, seed: SEED, ..StreetOptions::default() }
}

/// Streets of that kind, each with another seed.
pub fn streets(count: u64) -> impl Iterator<Item = StreetOptions> {
    (0..count).map(|index| StreetOptions { seed: SEED + index, ..street() })
}

/// The network that ships with the program.
pub fn network(lab: &Lab) -> Result<SavedNetwork> {
    read_network(&shipped_checkpoint()?, &lab.device)
}

/// A snippet of a street with a network applied to it.
pub struct Seen {
    pub log: DrivingLog,
    pub host: HostSnippet,
    pub inferred: Inferred,
    /// Of lifting and inferring.
    pub seconds: f64,
}

/// Applies a network to the one snippet of a street.
pub fn seen(lab: &Lab, street: &Path, SavedNetwork { network, config, .. }: &SavedNetwork) -> Result<Seen> {
    go_on()?;
    let log = open(street, &config.own.logs)?;
    let begun = Instant::now();
    let snippet = Snippet::new(0, INTERPOLATION_FRAMES);
    let host = prepare(&log, &snippet, "street", &config.own.lift, config.seed)?;
    let inferred = infer(network, &host, &log, config, &lab.device)?;
    Ok(Seen { log, host, inferred, seconds: begun.elapsed().as_secs_f64() })
}

/// The figures of an application.
#[derive(Debug, Clone, Copy)]
pub struct Outcome {
    /// PSNR of the frames between the inputs, dB.
    pub psnr: f64,
    /// EPE3D of moving points, metres in 0.1 s.
    pub moving: f64,
    /// Mean speed of what rests, metres per second.
    pub resting: f64,
    /// Snippets that could not be used.
    pub skipped: f64,
    /// Seconds of reading, applying and measuring.
    pub seconds: f64,
}

impl Outcome {
    fn of(measured: &Measured) -> Self {
        let value = |key: &str| figure(measured, key).unwrap_or(f64::NAN);
        Self {
            psnr: measured.quality.mean.psnr,
            moving: value("epe_moving"),
            resting: value("speed_at_rest"),
            skipped: value("snippets_skipped"),
            seconds: f64::NAN,
        }
    }

    /// The means over several streets.
    pub fn mean(all: &[Self]) -> Self {
        let mean = |figure: fn(&Self) -> f64| all.iter().map(figure).sum::<f64>() / all.len() as f64;
        Self {
            psnr: mean(|one| one.psnr),
            moving: mean(|one| one.moving),
            resting: mean(|one| one.resting),
            skipped: mean(|one| one.skipped),
            seconds: mean(|one| one.seconds),
        }
    }
}

/// Applies a network to the snippets of a street.
pub fn applied(lab: &Lab, street: &Path, network: &FluxNetwork, config: &FluxConfig) -> Result<Outcome> {
    go_on()?;
    let logs = Arc::new(Logs::unseen(street, &config.own.logs)?);
    let split = Split { places: &logs.held_out, name: logs.split, logs: &logs, pictures: 0 };
    Ok(Outcome::of(&measure(network, &split, config, &lab.device)?.measured))
}
