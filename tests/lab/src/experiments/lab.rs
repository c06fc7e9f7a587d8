//! Shared parts of experiments: small worlds on disk, runs with access to their state, and a bar with the time left.

use std::cell::{Cell, RefCell};
use std::fmt::Debug;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Result;
use burn::tensor::{Device, Tensor};
use gs_datasets::{LoadOptions, Scene, load};
use gs_pipelines::fit::SceneMethod;
use gs_train::config::{ConfigError, FitConfig, tables};
use gs_train::fit::photos::Photo;
use gs_train::fit::session::{self, Data, Stepped};
use gs_train::fit::told::MOVING;
use gs_train::run::evaluate::{Evaluator, HeldOut};
use gs_train::run::interrupt;
use gs_train::run::measured::Measured;
use gs_worlds::deblur::{self, DeblurOptions, World};
use gs_worlds::driving::StreetOptions;
use gs_worlds::extrapolation::{self, ExtrapolationOptions};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::Request;

/// Size of the images, pixels.
pub const SIZE: (usize, usize) = (96, 72);

/// The user asked to end before all experiments had run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted; what was finished before is in the output folder")]
pub struct Interrupted;

/// The environment of experiments.
pub struct Lab {
    worlds: PathBuf,
    /// The user's data set, on which experiments that can use one run too.
    pub data: Option<PathBuf>,
    /// Fewer variants and steps.
    pub quick: bool,
    /// The compute device.
    pub device: Device,
    quiet: bool,
    bar: ProgressBar,
    begun: Instant,
    name: RefCell<&'static str>,
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
            name: RefCell::new(""),
            done: Cell::new(0),
            total,
        }
    }

    /// Shows this name in the bar from now on.
    pub fn enter(&self, name: &'static str) {
        self.name.replace(name);
        self.bar.set_message(name);
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
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn world(&self, options: &DeblurOptions) -> Result<Scene> {
        let DeblurOptions { world, cameras, frames, .. } = options;
        let name = format!("{world}-{cameras}x{frames}");
        let folder = self.made(&name, options, |folder| Ok(deblur::write(folder, options, |_, _| {})?))?;
        Ok(load(&folder, &LoadOptions { training_truth: true, ..LoadOptions::default() })?)
    }

    /// A synthetic world whose future is to be predicted, written once and read as training loads it.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn future_world(&self, options: &ExtrapolationOptions) -> Result<Scene> {
        let ExtrapolationOptions { world, cameras, frames, .. } = options;
        let name = format!("{world}-{cameras}x{frames}");
        let write = |folder: &Path| Ok(extrapolation::write(folder, options, |_, _| {})?);
        Ok(load(&self.made(&name, options, write)?, &LoadOptions::default())?)
    }

    /// A driving log of a synthetic street, written once.
    ///
    /// # Errors
    /// When it cannot be written.
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

    /// A data set of the user, as training loads it.
    ///
    /// # Errors
    /// When it cannot be loaded.
    pub fn real(&self, path: &Path, options: &LoadOptions) -> Result<Scene> {
        Ok(load(path, options)?)
    }

    /// The configuration of a method with `changes` as `--set` overrides.
    ///
    /// # Errors
    /// When a change is not valid.
    pub fn config<M: SceneMethod>(&self, steps: usize, changes: &[&str]) -> Result<FitConfig<M::Config>, ConfigError> {
        let mut table = M::defaults().to_table();
        let own = [format!("steps={steps}")];
        for text in changes.iter().map(|text| (*text).to_string()).chain(own) {
            tables::merge(&mut table, tables::override_layer(&text)?.table);
        }
        FitConfig::from_table(&table, "experiment")
    }

    /// Counts one step of training.
    pub fn count_step(&self) {
        self.done.set(self.done.get() + 1);
        self.bar.inc(1);
    }
}

/// Fills a folder that is not there yet: under another name until it is whole.
///
/// # Errors
/// When it cannot be written.
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

/// A run in progress, open to an experiment between its steps.
pub struct Session<'a, M: SceneMethod> {
    lab: &'a Lab,
    /// The fit.
    pub fit: session::Session<'a, M>,
}

impl<'a, M: SceneMethod> Session<'a, M> {
    /// The state before the first step, as in a run.
    pub fn begin(lab: &'a Lab, data: &'a Data<M>, config: &'a FitConfig<M::Config>) -> Self {
        Self { lab, fit: session::Session::begin(data, config, None, &lab.device) }
    }

    /// Takes one step.
    ///
    /// # Errors
    /// [`Interrupted`], when the user asked to end.
    pub fn step(&mut self) -> Result<Stepped<M::Extra>> {
        if interrupt::asked() {
            return Err(Interrupted.into());
        }
        let stepped = self.fit.step();
        self.lab.count_step();
        Ok(stepped)
    }

    /// Steps until `step` steps are taken, at most those of the configuration.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn until(&mut self, step: usize) -> Result<()> {
        while self.fit.trainer.step < step.min(self.fit.config.steps) {
            self.step()?;
        }
        Ok(())
    }

    /// Takes all steps, then measures the held-out views.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn finish(&mut self) -> Result<Measured> {
        self.until(self.fit.config.steps)?;
        Ok(self.measure())
    }

    /// Measures the held-out views now.
    pub fn measure(&self) -> Measured {
        let (scene, at) = (&self.fit.data.scene, self.fit.at());
        let evaluator = Evaluator::new(&self.fit.config.eval, &self.lab.device);
        let held_out = HeldOut::of::<M>(scene, None).expect("the reported split");
        evaluator.measure(self.fit.trainer.model(), scene, &held_out, &at, 0).0
    }

    /// Training photo `index`, and the image that is compared with it now, `[H, W, 3]`; the state does not change.
    pub fn formed(&mut self, index: usize) -> (Photo<M::Extra>, Tensor<3>) {
        self.fit.formed(index)
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
