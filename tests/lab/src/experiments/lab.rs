//! Shared parts of experiments: small worlds on disk, runs with access to their state, and a bar with the time left.

use std::cell::Cell;
use std::fmt::Debug;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Result, ensure};
use burn::tensor::Device;
use gs_datasets::{LoadOptions, Scene, load};
use gs_pipelines::fit::SceneMethod;
use gs_train::config::{FitConfig, tables};
use gs_train::fit::session::{self, Data};
use gs_train::fit::told::MOVING;
use gs_train::run::evaluate::{Evaluator, HeldOut};
use gs_train::run::interrupt;
use gs_train::run::measured::Measured;
use gs_worlds::deblur::{self, DeblurOptions, World};
use gs_worlds::driving::StreetOptions;
use gs_worlds::extrapolation::{self, ExtrapolationOptions};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::{Experiment, Request};

/// Size of the images, pixels.
pub const SIZE: (usize, usize) = (96, 72);

/// The user asked to end before all experiments had run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted; what was finished before is in the output folder")]
pub struct Interrupted;

/// [`Interrupted`] once the user asked to end.
pub fn go_on() -> Result<()> {
    ensure!(!interrupt::asked(), Interrupted);
    Ok(())
}

/// The environment of experiments.
pub struct Lab {
    worlds: PathBuf,
    /// The user's data set, on which experiments that can use one run too.
    pub data: Option<PathBuf>,
    /// Fewer variants and steps.
    pub quick: bool,
    pub device: Device,
    quiet: bool,
    bar: ProgressBar,
    begun: Instant,
    /// Steps of a training of the experiment at hand.
    steps: Cell<usize>,
    done: Cell<usize>,
    total: usize,
}

impl Lab {
    /// A lab in the folder of `request` for `total` steps of training.
    pub fn new(request: &Request, total: usize) -> Self {
        let target = if request.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(4) };
        let bar = ProgressBar::with_draw_target(Some(total as u64), target);
        let style = ProgressStyle::with_template("{bar:30.cyan/blue} {pos}/{len} steps, {eta} left, {msg}");
        bar.set_style(style.expect("a valid template"));
        Self {
            worlds: request.out.join("worlds"),
            data: request.data.clone(),
            quick: request.quick,
            device: request.device.clone(),
            quiet: request.quiet,
            bar,
            begun: Instant::now(),
            steps: Cell::new(0),
            done: Cell::new(0),
            total,
        }
    }

    /// Trains as this experiment says from now on, and shows its name in the bar.
    pub fn enter(&self, experiment: &Experiment) {
        let [full, quick] = experiment.steps;
        self.steps.set(self.either(full, quick));
        self.bar.set_message(experiment.name);
    }

    /// Steps of a training of the experiment at hand.
    pub fn steps(&self) -> usize {
        self.steps.get()
    }

    /// Prints a line; without a bar, with the time left.
    pub fn say(&self, line: &str) {
        if self.quiet {
            return;
        }
        if !self.bar.is_hidden() {
            return self.bar.suspend(|| eprintln!("{line}"));
        }
        let (done, elapsed) = (self.done.get(), self.begun.elapsed().as_secs_f64());
        if done == 0 {
            return eprintln!("{line}");
        }
        let left = elapsed * self.total.saturating_sub(done) as f64 / done as f64;
        eprintln!("{line}; {done}/{} steps, about {left:.0} s left", self.total);
    }

    /// Restores the terminal.
    pub fn leave(&self) {
        self.bar.finish_and_clear();
    }

    /// `full` for a run that measures, `quick` for a first impression.
    pub fn either<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    /// A synthetic world, written once and read with all its truth.
    pub fn world(&self, options: &DeblurOptions) -> Result<Scene> {
        let DeblurOptions { world, cameras, frames, .. } = options;
        let name = format!("{world}-{cameras}x{frames}");
        let folder = self.made(&name, options, |folder| Ok(deblur::write(folder, options, |_, _| {})?))?;
        Ok(load(&folder, &LoadOptions { training_truth: true, ..LoadOptions::default() })?)
    }

    /// A synthetic world whose future is to be predicted, written once and read as training loads it.
    pub fn future_world(&self, options: &ExtrapolationOptions) -> Result<Scene> {
        let ExtrapolationOptions { world, cameras, frames, .. } = options;
        let name = format!("{world}-{cameras}x{frames}");
        let write = |folder: &Path| Ok(extrapolation::write(folder, options, |_, _| {})?);
        Ok(load(&self.made(&name, options, write)?, &LoadOptions::default())?)
    }

    /// A driving log of a synthetic street, written once.
    pub fn street(&self, options: &StreetOptions) -> Result<PathBuf> {
        let write = |folder: &Path| Ok(gs_worlds::driving::write(folder, options, |_, _| {})?);
        self.made("street", options, write)
    }

    /// The folder that `write` fills for these options, written whole and once.
    fn made(&self, name: &str, options: &impl Debug, write: impl Fn(&Path) -> Result<()>) -> Result<PathBuf> {
        // The hash covers every option, including those that are not in the name.
        let all = crc32fast::hash(format!("{options:?}").as_bytes());
        let folder = self.worlds.join(format!("{name}-{all:08x}"));
        whole(&folder, write)?;
        Ok(folder)
    }

    /// The configuration of a method for the steps of the experiment at hand, with `changes` as `--set` overrides.
    pub fn config<M: SceneMethod>(&self, changes: &[&str]) -> Result<FitConfig<M::Config>> {
        let mut table = M::defaults().to_table();
        let steps = format!("steps={}", self.steps());
        for text in [&[steps.as_str()], changes].concat() {
            tables::merge(&mut table, tables::override_layer(text)?.table);
        }
        Ok(FitConfig::from_table(&table, "experiment")?)
    }

    /// Counts one step of training.
    pub fn count_step(&self) {
        self.done.set(self.done.get() + 1);
        self.bar.inc(1);
    }
}

/// Fills a folder that is not there yet: under another name until it is whole.
pub fn whole(folder: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    if folder.is_dir() {
        return Ok(());
    }
    let part = folder.with_extension("part");
    if part.is_dir() {
        fs::remove_dir_all(&part)?;
    }
    write(&part)?;
    Ok(fs::rename(&part, folder)?)
}

/// The base options of the lab's worlds.
pub fn small(world: World, frames: usize) -> DeblurOptions {
    let (width, height) = SIZE;
    DeblurOptions {
        world,
        width,
        height,
        cameras: 6,
        held_out: 1,
        frames,
        subframes: 16,
        points: 1000,
        ..DeblurOptions::default()
    }
}

/// A run of an experiment: a scene and its configuration.
pub struct Trial<M: SceneMethod> {
    /// The scene with its facts and cues.
    pub data: Data<M>,
    pub config: FitConfig<M::Config>,
}

impl<M: SceneMethod> Trial<M> {
    /// A run on `scene`, configured as [`Lab::config`] says.
    pub fn new(lab: &Lab, scene: Scene, changes: &[&str]) -> Result<Self> {
        let config = lab.config::<M>(changes)?;
        Ok(Self { data: Data::new(scene, &config), config })
    }

    /// The state before the first step, as in a run.
    pub fn begin<'a>(&'a self, lab: &'a Lab) -> Session<'a, M> {
        Session { lab, fit: session::Session::begin(&self.data, &self.config, None, &lab.device) }
    }

    /// The run with all its steps taken.
    pub fn trained<'a>(&'a self, lab: &'a Lab) -> Result<Session<'a, M>> {
        let mut session = self.begin(lab);
        session.until(self.config.steps)?;
        Ok(session)
    }

    /// The held-out views, measured after all steps.
    pub fn measured(&self, lab: &Lab) -> Result<Measured> {
        Ok(self.trained(lab)?.measure())
    }
}

/// A run in progress, open to an experiment between its steps.
pub struct Session<'a, M: SceneMethod> {
    lab: &'a Lab,
    pub fit: session::Session<'a, M>,
}

impl<M: SceneMethod> Session<'_, M> {
    /// Steps until `step` steps are taken, at most those of the configuration.
    pub fn until(&mut self, step: usize) -> Result<()> {
        while self.fit.trainer.step < step.min(self.fit.config.steps) {
            go_on()?;
            self.fit.step();
            self.lab.count_step();
        }
        Ok(())
    }

    /// Measures the held-out views now.
    pub fn measure(&self) -> Measured {
        let (scene, at) = (&self.fit.data.scene, self.fit.at());
        let evaluator = Evaluator::new(&self.fit.config.eval, &self.lab.device);
        let held_out = HeldOut::of::<M>(scene, None).expect("the reported split");
        evaluator.measure(self.fit.trainer.model(), scene, &held_out, &at, 0).0
    }
}

/// PSNR over moving parts, dB; NaN if nothing moves.
pub fn moving_psnr(measured: &Measured) -> f64 {
    measured.quality.regions.get(MOVING).map_or(f64::NAN, |scores| scores.psnr)
}

/// A figure by its key; `None` if it was not measured.
pub fn figure(measured: &Measured, key: &str) -> Option<f64> {
    measured.figures.iter().find(|figure| figure.key == key).map(|figure| figure.value)
}
