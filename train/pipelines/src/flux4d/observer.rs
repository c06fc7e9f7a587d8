//! The observer of a training: each step is shown, written down, measured and saved where that is due.

use std::sync::Arc;

use anyhow::Result;
use burn::tensor::Device;

use super::config::FluxConfig;
use super::evaluate::{Measurement, Split, measure};
use super::logs::Logs;
use super::network::FluxNetwork;
use super::trainer::StepReport;
use gs_train::fit::snapshot::Snapshot;
use gs_train::fit::training::Training;
use gs_train::run::watch::{GAUSSIANS, Run};

/// Reasons for skipped snippets that are shown; more are counted.
const REASONS_SHOWN: usize = 5;

/// A run that observes a training, with what it measures on.
pub struct Observer {
    /// The run.
    pub run: Run,
    /// The logs.
    pub logs: Arc<Logs>,
    /// The configuration.
    pub config: FluxConfig,
    /// The device of measurements.
    pub device: Device,
    shown: usize,
}

impl Observer {
    /// Nothing was observed yet.
    pub fn new(run: Run, logs: Arc<Logs>, config: FluxConfig, device: Device) -> Self {
        Self { run, logs, config, device, shown: 0 }
    }

    /// Whether no step follows: all were taken, or the user or the job ends the run.
    pub fn is_over(&self, step: usize) -> bool {
        step >= self.config.steps || self.run.is_stopped(step)
    }

    /// Observes a step that was taken; `reasons` are those of the snippets that it skipped.
    ///
    /// # Errors
    /// When a measurement fails.
    pub fn observe(&mut self, training: &Training<FluxNetwork>, report: StepReport, reasons: &[String]) -> Result<()> {
        for reason in reasons.iter().take(REASONS_SHOWN.saturating_sub(self.shown)) {
            self.run.say(&format!("warning: {reason}"));
        }
        self.shown += reasons.len();
        let step = training.step;
        let counts = [(GAUSSIANS, report.gaussians as f64), ("voxels", report.voxels as f64)];
        self.run.observe(step, (report.loss, training.skipped), &counts, || None);
        if self.config.eval.at.contains(&step) && step < self.config.steps {
            let measurement = self.measure(training, 0)?;
            self.run.record(step, measurement.measured).1?;
        }
        if self.run.is_save_due(step) {
            self.run.save_on_the_way(step, &Snapshot::of_training(training));
        }
        Ok(())
    }

    /// Measures the network on the snippets that are held out.
    ///
    /// # Errors
    /// When a snippet cannot be read or rendered.
    pub fn measure(&self, training: &Training<FluxNetwork>, pictures: usize) -> Result<Measurement> {
        let logs = &self.logs;
        let split = Split { logs, places: &logs.held_out, name: logs.split, pictures };
        measure(training.module(), &split, &self.config, &self.device)
    }
}
