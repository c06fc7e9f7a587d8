//! The network, its moments and its counters as a checkpoint.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Result, bail};
use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::adam::{Adam, Moments};
use gs_burn::{NamedParameter, named_parameters, try_map_parameters};
use serde::{Deserialize, Serialize};

use super::NAME;
use super::config::FluxConfig;
use super::network::FluxNetwork;
use super::trainer::Trainer;
use gs_train::config::tables;
use gs_train::fit::snapshot::{Column, Snapshot, Source};
use gs_train::run::checkpoint::Checkpoint;

const MODEL: &str = "model.";
const FIRST: &str = "first.";
const SECOND: &str = "second.";

/// The counters beside the tensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Counters {
    step: usize,
    skipped: usize,
    updates: u64,
}

/// The state of a training.
pub fn snapshot(trainer: &Trainer) -> Snapshot {
    let mut columns = BTreeMap::new();
    for NamedParameter { path, shape, table } in learned(trainer.network()) {
        columns.insert(format!("{MODEL}{path}"), Column::of_table(table, shape));
    }
    for (path, moments) in &trainer.adam.moments {
        columns.insert(format!("{FIRST}{path}"), Column::new(moments.first.clone()));
        columns.insert(format!("{SECOND}{path}"), Column::new(moments.second.clone()));
    }
    let counters = Counters { step: trainer.step, skipped: trainer.skipped, updates: trainer.adam.updates };
    Snapshot { columns, notes: serde_json::to_value(counters).expect("numbers are JSON") }
}

/// The network that ships with the program.
///
/// # Errors
/// When its file does not fit this version.
pub fn shipped_checkpoint() -> Result<Checkpoint> {
    Ok(Checkpoint::parse(Path::new("flux4d/streets"), gs_recipes::STREETS.to_vec())?)
}

/// A network with its counters and without the state of its optimiser: a third of a checkpoint.
///
/// # Errors
/// A sentence when the checkpoint is of another pipeline or damaged.
pub fn network_alone(checkpoint: &Checkpoint, device: &Device) -> Result<Snapshot> {
    let SavedNetwork { network, step, .. } = read_network(checkpoint, device)?;
    let mut alone = snapshot(&Trainer::new(network));
    let counters = Counters { step, skipped: 0, updates: 0 };
    alone.notes = serde_json::to_value(counters).expect("numbers are JSON");
    Ok(alone)
}

/// Running statistics are left out: batch norm takes those of the snippet at hand.
fn learned(network: &FluxNetwork) -> Vec<NamedParameter> {
    named_parameters(network).into_iter().filter(|parameter| is_learned(&parameter.path)).collect()
}

fn is_learned(path: &str) -> bool {
    !path.ends_with("running_mean") && !path.ends_with("running_var")
}

/// A network with its configuration and the steps it was trained.
#[derive(Debug)]
pub struct SavedNetwork {
    /// The network, outside autodiff.
    pub network: FluxNetwork,
    /// Its configuration.
    pub config: FluxConfig,
    /// Steps.
    pub step: usize,
}

/// Reads the network of a checkpoint.
///
/// # Errors
/// A sentence when the checkpoint is of another pipeline or damaged.
pub fn read_network(checkpoint: &Checkpoint, device: &Device) -> Result<SavedNetwork> {
    let Checkpoint { path, origin, .. } = checkpoint;
    if origin.pipeline != NAME {
        bail!("{}: expected a network of the pipeline {NAME}, found a scene of {}", path.display(), origin.pipeline);
    }
    let place = format!("{}: configuration", path.display());
    let config = FluxConfig::from_table(&tables::parse(&origin.config, &place)?, &place)?;
    let read = || -> Result<(FluxNetwork, usize), String> {
        Ok((network(checkpoint, &config, device)?, counters(checkpoint)?.step))
    };
    let (network, step) = read().map_err(|found| checkpoint.damaged(found))?;
    Ok(SavedNetwork { network, config, step })
}

/// Reads the state of a training.
///
/// # Errors
/// A sentence when a part is missing or damaged, or parts do not fit each other.
pub fn restore(source: &dyn Source, config: &FluxConfig, device: &Device) -> Result<Trainer, String> {
    let network = network(source, config, device)?;
    let Counters { step, skipped, updates } = counters(source)?;
    let mut adam = Adam { updates, ..Adam::new() };
    for NamedParameter { path, table, .. } in learned(&network) {
        let moment = |prefix: &str| -> Result<Tensor<2>, String> {
            let (values, shape) = source.read(&format!("{prefix}{path}"))?;
            if shape != table.dims() {
                return Err(format!("{path} and its moments have different shapes"));
            }
            Ok(Tensor::from_data(TensorData::new(values, table.dims()), device))
        };
        // Before its first update a parameter has none.
        if updates > 0 {
            adam.moments.insert(path.clone(), Moments { first: moment(FIRST)?, second: moment(SECOND)? });
        }
    }
    let mut trainer = Trainer::new(network);
    (trainer.adam, trainer.step, trainer.skipped) = (adam, step, skipped);
    Ok(trainer)
}

fn network(source: &dyn Source, config: &FluxConfig, device: &Device) -> Result<FluxNetwork, String> {
    try_map_parameters(FluxNetwork::new(config, device), |parameter| {
        let NamedParameter { path, shape, table } = parameter;
        if !is_learned(&path) {
            return Ok(table);
        }
        let (values, found) = source.read(&format!("{MODEL}{path}"))?;
        if found != shape {
            return Err(format!("{path} has the shape {found:?}, the configuration says {shape:?}"));
        }
        Ok(Tensor::from_data(TensorData::new(values, table.dims()), device))
    })
}

fn counters(source: &dyn Source) -> Result<Counters, String> {
    serde_json::from_value(source.notes().clone()).map_err(|error| error.to_string())
}

/// Learned numbers of a network.
pub fn parameters(network: &FluxNetwork) -> usize {
    learned(network).iter().map(|parameter| parameter.shape.iter().product::<usize>()).sum()
}
