//! The network of a checkpoint, and the state of its training.

use std::path::Path;

use anyhow::{Result, bail};
use burn::tensor::Device;

use super::NAME;
use super::config::FluxConfig;
use super::network::FluxNetwork;
use gs_train::config::tables;
use gs_train::fit::snapshot::{Counters, Source, learned, read_module, read_training};
use gs_train::fit::training::Training;
use gs_train::run::checkpoint::Checkpoint;

/// The network that ships with the program.
///
/// # Errors
/// When its file does not fit this version.
pub fn shipped_checkpoint() -> Result<Checkpoint> {
    Ok(Checkpoint::parse(Path::new("flux4d/streets"), gs_recipes::STREETS.to_vec())?)
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
        Ok((network(checkpoint, &config, device)?, Counters::read(checkpoint)?.step))
    };
    let (network, step) = read().map_err(|found| checkpoint.damaged(found))?;
    Ok(SavedNetwork { network, config, step })
}

/// Reads the state of a training.
///
/// # Errors
/// A sentence when a part is missing or damaged, or parts do not fit each other.
pub fn restore(source: &dyn Source, config: &FluxConfig, device: &Device) -> Result<Training<FluxNetwork>, String> {
    read_training(source, network(source, config, device)?, device)
}

fn network(source: &dyn Source, config: &FluxConfig, device: &Device) -> Result<FluxNetwork, String> {
    read_module(source, "", FluxNetwork::new(config, device), |found, own| found == own, device)
}

/// Learned numbers of a network.
pub fn parameters(network: &FluxNetwork) -> usize {
    learned(network).map(|parameter| parameter.shape.iter().product::<usize>()).sum()
}
