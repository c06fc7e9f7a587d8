//! The network trained by burn-train's learner, on one device or several.
//!
//! Burn's strategies drive: `single` on one device, `multi` on several, and distributed data parallel (DDP) on several of CUDA's.
//! Each calls [`TrainStep::step`] for a snippet, adds up the gradients and calls [`TrainStep::optimize`], which ends a step here:
//! Adam of the training, then the run's observers. So a run is saved after any step, by its own checkpoint, and Burn's checkpointers,
//! loggers and display have nothing to do.
//!
//! | file | idea |
//! |---|---|
//! | [`session`] | the state of a training that all devices share |
//! | [`learned`] | the network as burn-train sees it |
//! | [`loader`] | the draws of each device |
//! | [`silent`] | a display that shows nothing |

pub mod learned;
pub mod loader;
pub mod session;
pub mod silent;

use std::sync::Arc;

use anyhow::{Result, anyhow};
use burn::tensor::Device;
use burn::tensor::distributed::{DistributedConfig, ReduceOperation};
use burn_optim::SgdConfig;
use burn_train::logger::InMemoryMetricLogger;
use burn_train::{ExecutionStrategy, Interrupter, Learner, MultiDeviceOptim, SupervisedTraining};

use self::learned::Learned;
use self::loader::{Nothing, Snippets};
use self::session::Session;
use self::silent::Silent;
use super::feed::Library;
use super::network::FluxNetwork;
use super::observer::Observer;
use crate::fit::training::Training;
use crate::run::watch::Job;

/// Takes steps until the training is over; the run observes.
///
/// # Errors
/// When a snippet cannot be handed out, a worker panics, or a measurement fails.
pub fn advance(
    training: Training<FluxNetwork>,
    observer: Observer,
    job: &Job,
) -> Result<(Training<FluxNetwork>, Observer)> {
    if observer.is_over(training.step) {
        return Ok((training, observer));
    }
    let devices: Vec<Device> = std::iter::once(&job.device).chain(&job.more_devices).cloned().collect();
    let config = observer.config.clone();
    let accumulate = config.own.learning.accumulate;
    let (taken, left) = (training.step * accumulate, (config.steps - training.step) * accumulate);
    let library = Arc::new(Library::new(observer.logs.clone(), &config));
    let snippets = Snippets::new(library, taken, left, devices.len());
    let tracked: Vec<Device> = devices.iter().map(|device| device.clone().autodiff()).collect();
    let strategy = strategy(&tracked);
    let interrupter = Interrupter::new();
    let is_distributed = matches!(strategy, ExecutionStrategy::DistributedDataParallel { .. });
    let model = Learned::new(training.module());
    let session = Arc::new(Session::new((training, observer), devices, is_distributed, interrupter.clone()));
    // Burn's optimiser and its rate are not used: `Learned::optimize` has its own.
    let learner = Learner::new(model.within(&session), SgdConfig::new().init(), 1.0);
    let training = SupervisedTraining::new(job.folder.path(), Arc::new(snippets), Arc::new(Nothing))
        .num_epochs(1)
        .grads_accumulation(accumulate / session.devices())
        .with_interrupter(interrupter)
        .with_application_logger(None)
        .with_metric_logger(InMemoryMetricLogger::new())
        .renderer(Box::new(Silent))
        .with_training_strategy(strategy.into());
    let result = training.launch(learner);
    let (training, observer) = session.end()?;
    match result.error {
        Some(error) => Err(anyhow!("{error}")),
        None => Ok((training, observer)),
    }
}

/// Burn's strategy for some devices with autodiff. `multi` moves gradients to the first device and adds them there; CUDA has an
/// all-reduce of its own, which no other backend of this program has.
fn strategy(devices: &[Device]) -> ExecutionStrategy {
    match devices {
        [device] => ExecutionStrategy::single(device.clone()),
        devices if devices.iter().all(|device| gs_burn::device::is_cuda(&device.clone().inner())) => {
            ExecutionStrategy::ddp(devices.to_vec(), DistributedConfig { all_reduce_op: ReduceOperation::Mean })
        }
        devices => ExecutionStrategy::multi(devices.to_vec(), MultiDeviceOptim::OptimMainDevice),
    }
}
