//! `--minutes`: the cost of a step is measured on the data before the run, and the budget becomes a number of steps.

use anyhow::{Result, bail};
use burn::tensor::Device;
use gs_burn::device::is_gpu;

use gs_train::config::{FitConfig, Strategy, brief};
use gs_train::fit::budget::{STEPS_MAX, StepCost, steps_within};
use gs_train::fit::intake::Intake;
use gs_train::fit::session::{Data, Session};
use gs_train::fit::trainer::Trainer;
use gs_train::run::resources::Stopwatch;
use gs_train::run::watch::Job;

/// Steps before a measurement: the first ones fill buffers and caches.
const WARM_UP: usize = 2;

/// Steps of a measurement. Photos cost differently, so there are several.
const MEASURED: usize = 6;

/// A number of steps for a budget of time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepPlan {
    /// The steps.
    pub steps: usize,
    /// Seconds of the budget that reading the data and finding the first Gaussians take.
    pub start: f64,
    /// Seconds of a step at full width with the first Gaussians, and with `density.cap` of them.
    pub step: [f64; 2],
}

impl StepPlan {
    /// The plan in one line.
    pub fn line(&self, minutes: f64) -> String {
        let [first, last] = self.step;
        let most = if self.steps == STEPS_MAX { ", the most that are planned," } else { "" };
        format!(
            "{} steps{most} fit into {} minutes: {:.1} s to begin, {first:.3} s a step with the first Gaussians, {last:.3} s with the most",
            self.steps,
            brief(minutes),
            self.start
        )
    }
}

/// The steps of `config` that fit into `minutes` on `data`, of a run that begins at `begin`, or at points: of processor
/// time on a CPU, as the clock shows on a GPU. `watch` began before the data set was read; what it shows is part of the
/// budget, the measuring is not. The data come back without their reduced widths, which depend on the number of steps.
///
/// # Errors
/// A sentence, if the budget is too small for a single step.
pub fn plan_steps<M: Intake>(
    data: Data<M>,
    config: &FitConfig<M::Config>,
    begin: Option<Trainer<M>>,
    minutes: f64,
    job: &Job,
    watch: &Stopwatch,
) -> Result<(Data<M>, StepPlan)> {
    let device = &job.device;
    let first = Session::begin(&data, config, begin, device).into_trainer();
    let start = seconds(watch, device);
    let count = first.gaussians().len();

    // Nothing changes the count, and photos have their full width.
    let mut still = config.clone();
    still.shared.density.strategy = Strategy::None;
    let full = Data::<M> { coarse: Default::default(), ..data };
    let few = cost(&full, &still, first.clone(), device);
    // All at once up to the cap; only relocation can be told to.
    let mut growing = config.clone();
    let density = &mut growing.shared.density;
    let cap = density.cap;
    (density.mcmc.full, density.mcmc.growth, density.start, density.every, density.stop) = (0.0, cap as f64, 1, 1, 1.0);
    let (many, at_many) = match config.density.strategy {
        Strategy::Mcmc => {
            let mut session = Session::begin(&full, &growing, Some(first), device);
            session.step();
            let grown = session.into_trainer();
            (grown.gaussians().len(), cost(&full, &still, grown, device))
        }
        Strategy::Default | Strategy::None => (count, few),
    };
    let line = StepCost::through((count, few), (many, at_many));
    let coarse = Data::<M>::coarse_of(&full.scene, config);
    let steps = steps_within(60.0 * minutes - start, &line, count, &coarse, config);
    if steps == 0 {
        bail!(
            "--minutes {}: expected more: reading {} and finding the first Gaussians takes {start:.1} s, and a step {few:.2} s",
            brief(minutes),
            job.dataset.display()
        );
    }
    Ok((full, StepPlan { steps, start, step: [few, at_many] }))
}

/// Mean seconds of a step from the state of `trainer`.
fn cost<M: Intake>(data: &Data<M>, config: &FitConfig<M::Config>, trainer: Trainer<M>, device: &Device) -> f64 {
    let mut session = Session::begin(data, config, Some(trainer), device);
    for _ in 0..WARM_UP {
        session.step();
    }
    let watch = Stopwatch::start();
    for _ in 0..MEASURED {
        session.step();
    }
    seconds(&watch, device) / MEASURED as f64
}

/// Processor time on a CPU, the time that passed on a GPU.
fn seconds(watch: &Stopwatch, device: &Device) -> f64 {
    let (wall, cpu) = watch.spent();
    cpu.filter(|_| !is_gpu(device)).unwrap_or(wall)
}
