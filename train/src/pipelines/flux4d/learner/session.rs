//! The state of a training that all devices share.

use std::fmt;
use std::sync::{Arc, Barrier, Mutex, MutexGuard, PoisonError};

use anyhow::{Error, Result};
use burn::module::Module;
use burn::tensor::Device;
use burn_train::Interrupter;
use gs_burn::NamedGradients;
use gs_burn::adam::Moments;
use gs_burn::profile::{self, Stage};

use super::super::config::FluxConfig;
use super::super::logs::Logs;
use super::super::network::FluxNetwork;
use super::super::observer::Observer;
use super::super::trainer::{Setting, Unusable, Used, finish};
use crate::fit::training::Training;
use crate::run::resources::Stopwatch;

/// A training by burn-train.
pub struct Session {
    logs: Arc<Logs>,
    config: FluxConfig,
    devices: Vec<Device>,
    is_distributed: bool,
    interrupter: Interrupter,
    /// One that updates the network of all devices; with DDP one for each device, and all take the same steps.
    trainers: Vec<Mutex<Option<Training<FluxNetwork>>>>,
    /// Where the trainers of a step meet.
    meeting: Barrier,
    /// Outcomes of the step at hand by the number of the draw.
    outcomes: Mutex<Vec<(usize, Result<Used, Unusable>)>>,
    /// Time of the step at hand, with its stage of a profile.
    clock: Mutex<Option<(Stopwatch, Stage)>>,
    observer: Mutex<Option<Observer>>,
    failure: Mutex<Option<Error>>,
}

impl fmt::Debug for Session {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Session").field("devices", &self.devices).finish_non_exhaustive()
    }
}

impl Session {
    /// A training before the next step of `trainer`.
    pub fn new(
        (trainer, observer): (Training<FluxNetwork>, Observer),
        devices: Vec<Device>,
        is_distributed: bool,
        interrupter: Interrupter,
    ) -> Self {
        let trainers: Vec<_> = match is_distributed {
            true => devices.iter().map(|device| copy(&trainer, device)).collect(),
            false => vec![trainer],
        };
        Self {
            logs: observer.logs.clone(),
            config: observer.config.clone(),
            devices,
            is_distributed,
            interrupter,
            meeting: Barrier::new(trainers.len()),
            trainers: trainers.into_iter().map(|trainer| Mutex::new(Some(trainer))).collect(),
            outcomes: Mutex::default(),
            clock: Mutex::default(),
            observer: Mutex::new(Some(observer)),
            failure: Mutex::default(),
        }
    }

    /// Number of devices.
    pub fn devices(&self) -> usize {
        self.devices.len()
    }

    /// Whether each device updates a network of its own, by gradients that Burn averages.
    pub fn is_distributed(&self) -> bool {
        self.is_distributed
    }

    /// Data and configuration, with a device.
    pub fn setting<'a>(&'a self, device: &'a Device) -> Setting<'a> {
        (&self.logs, &self.config, device)
    }

    /// Begins the clock of a step with its first snippet.
    pub fn begin_step(&self) {
        locked(&self.clock).get_or_insert_with(|| (Stopwatch::start(), profile::step()));
    }

    /// What became of a snippet.
    pub fn add_outcome(&self, draw: usize, outcome: Result<Used, Unusable>) {
        locked(&self.outcomes).push((draw, outcome));
    }

    /// Ends a step with the sum of its gradients on `device`, observes it, and returns the new network.
    pub fn end_step(&self, device: &Device, sum: NamedGradients) -> FluxNetwork {
        let own = if self.is_distributed { self.devices.iter().position(|other| other == device) } else { Some(0) };
        let own = own.expect("a device of the training");
        // Every device has told the outcomes of its snippets.
        self.meeting.wait();
        let mut outcomes = locked(&self.outcomes).clone();
        outcomes.sort_by_key(|(draw, _)| *draw);
        let count = match self.is_distributed {
            // Each of the gradients added up is a mean over the devices already.
            true => outcomes.len() / self.devices.len(),
            false => outcomes.len(),
        };
        let outcomes: Vec<_> = outcomes.into_iter().map(|(_, outcome)| outcome).collect();
        let mut trainer = locked(&self.trainers[own]);
        let trainer = trainer.as_mut().expect("in training");
        let mut reasons = Vec::new();
        let report =
            finish(trainer, sum, count, &outcomes, &self.config, &mut |reason| reasons.push(reason.to_string()));
        // Every device has read the outcomes.
        self.meeting.wait();
        if own == 0 {
            locked(&self.outcomes).clear();
            let mut observer = locked(&self.observer);
            let observer = observer.as_mut().expect("in training");
            if let Some((watch, stage)) = locked(&self.clock).take() {
                observer.run.count_time(watch);
                drop(stage);
            }
            if let Err(error) = observer.observe(trainer, report, &reasons) {
                *locked(&self.failure) = Some(error);
                self.interrupter.stop(None);
            } else if observer.is_over(trainer.step) {
                self.interrupter.stop(None);
            }
        }
        // Every device sees the same answer to the question whether the training is over.
        self.meeting.wait();
        trainer.module().clone()
    }

    /// The training after its end.
    ///
    /// # Errors
    /// The failure of an observer.
    pub fn end(&self) -> Result<(Training<FluxNetwork>, Observer)> {
        if let Some(error) = locked(&self.failure).take() {
            return Err(error);
        }
        let trainer = locked(&self.trainers[0]).take().expect("ended once");
        Ok((trainer, locked(&self.observer).take().expect("ended once")))
    }
}

/// The same training on another device.
fn copy(trainer: &Training<FluxNetwork>, device: &Device) -> Training<FluxNetwork> {
    let mut copy = Training::new(trainer.module().clone().to_device(device));
    (copy.step, copy.skipped, copy.adam.updates) = (trainer.step, trainer.skipped, trainer.adam.updates);
    for (path, Moments { first, second }) in &trainer.adam.moments {
        let moved = Moments { first: first.clone().to_device(device), second: second.clone().to_device(device) };
        copy.adam.moments.insert(path.clone(), moved);
    }
    copy
}

/// A panic on another thread ends the training anyway.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
