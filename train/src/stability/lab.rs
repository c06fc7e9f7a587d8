//! What experiments share: small worlds on disk, runs on them that can be reached into, and a bar with the time left.

use std::cell::{Cell, RefCell};
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Result, bail};
use burn::tensor::{Device, Tensor};
use gs_datasets::synthetic::deblur::{self, DeblurOptions, World};
use gs_datasets::{LoadOptions, Scene, load};
use gs_models::taylormode::TaylorScene;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::data::{Order, Photo, Photos, settled};
use crate::evaluate::{Evaluation, Evaluator};
use crate::experiment::Config;
use crate::interrupt;
use crate::stability::Request;
use crate::step::{StepReport, Trainer};
use crate::taylormode::state::MotionState;
use crate::taylormode::{hints, measure};

/// What all runs on the small worlds have in common: few Gaussians and few instants, because the images are small, and rates of
/// the Gaussians some times those of a real run, because a few hundred steps must make a scene sharp enough for blur to matter.
/// The rest is `configs/taylormode/base.toml`.
const RECIPE: [&str; 22] = [
    "pipeline=taylormode",
    "model.sh_degree=0",
    "density.cap=2500",
    "density.start=30",
    "density.every=30",
    "density.growth=0.1",
    "density.trim=0.005",
    "motion.points=800",
    "motion.select_every=50",
    "blur.samples=5",
    "blur.decouple=false",
    "prior.sharp=0.2",
    "prior.until=0.3",
    "optimiser.means_lr=8e-4",
    "optimiser.means_lr_final=2e-5",
    "optimiser.quats_lr=4e-3",
    "optimiser.scales_lr=1.5e-2",
    "optimiser.sh_lr=1e-2",
    "optimiser.opacity_lr=0.1",
    "eval.ms_ssim=false",
    "eval.lpips=false",
    "data.cache_mb=256",
];

/// Size of the images, pixels.
pub const SIZE: (usize, usize) = (96, 72);

/// Where experiments are made.
pub struct Lab {
    worlds: PathBuf,
    /// Fewer variants and steps.
    pub quick: bool,
    /// Where to compute.
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

    /// From here on the bar shows this name.
    pub fn enter(&self, name: &'static str) {
        self.name.replace(name);
        self.bar.set_message(name);
    }

    /// Prints a line; where there is no bar, with the time left.
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

    /// Leaves the terminal as it was.
    pub fn leave(&self) {
        self.bar.finish_and_clear();
    }

    /// The number for a run that measures, or for a quick look.
    pub fn either<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    /// A world, written once and read with all its truth.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn world(&self, options: &DeblurOptions) -> Result<Scene> {
        let DeblurOptions { world, cameras, frames, .. } = options;
        // Every option counts, those too long for a name.
        let all = crc32fast::hash(format!("{options:?}").as_bytes());
        let folder = self.worlds.join(format!("{world}-{cameras}x{frames}-{all:08x}"));
        // Written last.
        if !folder.join("transforms_train.json").is_file() {
            deblur::write(&folder, options, |_, _| {})?;
        }
        Ok(load(&folder, &LoadOptions { training_truth: true, ..LoadOptions::default() })?)
    }

    /// The recipe of the lab with changes.
    ///
    /// # Errors
    /// When a change is not valid.
    pub fn config(&self, steps: usize, changes: &[&str]) -> Result<Config> {
        let own = [format!("steps={steps}")];
        let all = RECIPE.iter().chain(changes).map(|text| (*text).to_string()).chain(own);
        Ok(Config::resolve(None, &all.collect::<Vec<_>>())?)
    }
}

/// The options that worlds of the lab start from.
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

/// A run under way, open to an experiment between its steps.
pub struct Session<'a> {
    lab: &'a Lab,
    scene: &'a Scene,
    /// Its configuration.
    pub config: Config,
    /// Its state.
    pub trainer: Trainer,
    photos: Photos<'a>,
    order: Order,
}

impl<'a> Session<'a> {
    /// Before the first step, as `run` begins.
    pub fn begin(lab: &'a Lab, scene: &'a Scene, config: Config) -> Self {
        let config = settled(&config, scene);
        let found = hints::gather(scene, &config);
        let trainer = Trainer::begin(scene, found.as_ref(), &config, &lab.device);
        Self {
            order: Order::new(&scene.train, trainer.motion.as_ref().map(|state| state.window.t0), &config),
            trainer,
            photos: Photos::new(&scene.train, &lab.device, config.data.cache_mb << 20).with_motion(found),
            lab,
            scene,
            config,
        }
    }

    /// One step.
    ///
    /// # Errors
    /// When the user asked to stop.
    pub fn step(&mut self) -> Result<StepReport> {
        if interrupt::asked() {
            bail!("interrupted; what was finished before is in the output folder");
        }
        let photo = self.photos.get(self.order.pick(self.trainer.step + 1));
        let report = self.trainer.step(&photo, &self.config);
        self.trainer.simplify(&self.scene.train, &self.config);
        self.lab.done.set(self.lab.done.get() + 1);
        self.lab.bar.inc(1);
        Ok(report)
    }

    /// Steps until `step` steps are taken, at most those of the configuration.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn until(&mut self, step: usize) -> Result<()> {
        while self.trainer.step < step.min(self.config.steps) {
            self.step()?;
        }
        Ok(())
    }

    /// All steps, then the figures of the held-out views.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn finish(&mut self) -> Result<Evaluation> {
        self.until(self.config.steps)?;
        Ok(self.evaluate())
    }

    /// The figures of the held-out views now.
    pub fn evaluate(&self) -> Evaluation {
        let mut photos = Photos::new(&self.scene.test, &self.lab.device, 0);
        let evaluator = Evaluator::new(&self.config.eval, &self.lab.device);
        let (found, _) = evaluator.evaluate(&*self.trainer.model(), &mut photos, &self.config, 0);
        let gaussians = self.trainer.parameters.gaussians();
        let of = |state| measure::measure(state, &gaussians, self.scene, &self.config);
        Evaluation { step: self.trainer.step, motion: self.trainer.motion.as_ref().map(of), ..found }
    }

    /// The motion state.
    ///
    /// # Panics
    /// In a static run, which has none.
    pub fn state(&mut self) -> &mut MotionState {
        self.trainer.motion.as_mut().expect("the run's pipeline moves")
    }

    /// The moving scene.
    ///
    /// # Panics
    /// In a static run, which has none.
    pub fn scene(&self) -> TaylorScene {
        let state = self.trainer.motion.as_ref().expect("the run's pipeline moves");
        state.scene(self.trainer.parameters.gaussians())
    }

    /// Training photo `index`, and what the run forms in its place, `[H, W, 3]`, without going on.
    pub fn formed(&mut self, index: usize) -> (Photo, Tensor<3>) {
        let photo = self.photos.get(index);
        let formed = self.trainer.clone().step(&photo, &self.config).color;
        (photo, formed)
    }
}

/// PSNR over moving parts, dB; NaN where nothing moves.
pub fn moving_psnr(evaluation: &Evaluation) -> f64 {
    evaluation.moving.as_ref().map_or(f64::NAN, |scores| scores.psnr)
}
