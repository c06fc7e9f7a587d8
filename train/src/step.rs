//! One optimisation step: render a photo's view, compare, go back, update, let density control act.

use burn::tensor::Tensor;
use gs_burn::{RenderOptions, Rendering, render, render_with_screen_gradients};
use gs_datasets::Scene;
use serde::{Deserialize, Serialize};

use crate::data::Photo;
use crate::density::{Changes, Density, Moment, Observation};
use crate::experiment::Config;
use crate::losses::loss;
use crate::optimiser::Optimiser;
use crate::parameters::{Gradients, Parameters};
use crate::scene_init::{first_gaussians, size_of};
use crate::schedule::sh_degree;

/// What a Gaussian stores.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ModelConfig {
    /// Highest degree of the view-dependent colour, 0 to 3; 48 numbers per Gaussian at 3, 3 at 0.
    pub sh_degree: usize,
    /// Steps from one degree to the next; a short run takes shorter ones.
    pub sh_interval: usize,
}

impl Default for ModelConfig {
    fn default() -> Self {
        Self { sh_degree: 3, sh_interval: 1000 }
    }
}

/// How images are formed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RenderConfig {
    /// Gaussians nearer than this are not drawn, scene units.
    pub near: f64,
    /// Gaussians farther than this are not drawn, scene units.
    pub far: f64,
    /// Variance added to every projected Gaussian, square pixels.
    pub eps2d: f64,
    /// Undo the brightening by `eps2d` (Mip-Splatting): steadier when zooming, and then to be rendered with it too.
    pub antialiased: bool,
}

impl Default for RenderConfig {
    fn default() -> Self {
        let options = RenderOptions::default();
        Self { near: options.near, far: options.far, eps2d: options.eps2d, antialiased: options.antialiased }
    }
}

impl RenderConfig {
    /// The options of one rendering.
    pub fn options(&self, sh_degree: usize, background: [f32; 3]) -> RenderOptions {
        RenderOptions {
            sh_degree,
            background,
            near: self.near,
            far: self.far,
            eps2d: self.eps2d,
            antialiased: self.antialiased,
            ..RenderOptions::default()
        }
    }
}

/// Everything that changes from step to step.
#[derive(Debug, Clone)]
pub struct Trainer {
    /// The Gaussians.
    pub parameters: Parameters,
    /// Their moments.
    pub optimiser: Optimiser,
    /// Density control and its statistics.
    pub density: Density,
    /// Steps taken.
    pub step: usize,
    /// Steps whose loss or gradients were not finite; they changed nothing.
    pub skipped: usize,
    /// The scene's size, scene units.
    pub extent: f64,
}

/// What happened in a step.
#[derive(Debug)]
pub struct StepReport {
    /// The loss before the update.
    pub loss: f32,
    /// The rendered image, `[H, W, 3]`, without autodiff.
    pub color: Tensor<3>,
    /// Tile intersections of the rendering.
    pub intersections: usize,
    /// Whether loss or gradients were not finite, so that nothing was updated.
    pub skipped: bool,
    /// What density control did.
    pub changes: Changes,
}

impl Trainer {
    /// The state before the first step, on `device` (without autodiff).
    pub fn begin(scene: &Scene, config: &Config, device: &burn::tensor::Device) -> Self {
        let first = first_gaussians(scene, &config.init, config.density.cap, config.seed);
        let parameters = Parameters::first(&first, device);
        Self {
            optimiser: Optimiser::new(&parameters),
            density: Density::new(&config.density, &parameters),
            parameters,
            step: 0,
            skipped: 0,
            extent: size_of(scene),
        }
    }

    /// One step on one photo.
    pub fn step(&mut self, photo: &Photo, config: &Config) -> StepReport {
        self.step += 1;
        self.raise_sh_degree(config);

        let (rendering, observation, evaluated) = self.compare(photo, config);
        let (loss, gradients) = evaluated;
        let mut report = StepReport {
            loss,
            color: rendering.color.inner(),
            intersections: rendering.intersections,
            skipped: gradients.is_none(),
            changes: Changes::default(),
        };
        match gradients {
            Some(gradients) => {
                let rates = config.optimiser.rates(self.step, config.steps, self.extent);
                self.optimiser.step(&mut self.parameters, gradients, rates, &config.optimiser);
                report.changes = self.control_density(&observation, config);
            }
            None => {
                self.skipped += 1;
                tracing::warn!(step = self.step, loss, "loss or gradients are not finite: step skipped");
            }
        }
        report
    }

    /// Renders the view, compares it with the photo and goes back. The gradients are `None` when they or the loss are not
    /// finite.
    fn compare(&self, photo: &Photo, config: &Config) -> (Rendering, Observation, (f32, Option<Gradients>)) {
        let tracked = self.parameters.tracked();
        let options = config.render.options(self.parameters.sh_degree(), config.data.background);
        let screen = self.density.wants_screen(&config.density, self.step, config.steps).then(|| {
            Tensor::<2>::zeros([self.parameters.len(), 4], &self.parameters.device()).autodiff().require_grad()
        });
        let rendering = match &screen {
            Some(screen) => render_with_screen_gradients(&tracked, &photo.camera, &options, screen.clone()),
            None => render(&tracked, &photo.camera, &options),
        };
        let loss = loss(rendering.color.clone(), photo, &tracked, self.extent, &config.loss);
        let mut gradients = loss.backward();

        let observation = Observation {
            screen: screen.and_then(|screen| screen.grad_remove(&mut gradients)),
            radii: rendering.radii().inner(),
            width: photo.camera.width,
            height: photo.camera.height,
        };
        let gradients = Gradients::take(&tracked, &mut gradients);
        // One read for both, because a read waits for the device.
        let checked = Tensor::cat(vec![loss.inner(), gradients.finiteness()], 0).into_data();
        let checked = checked.as_slice::<f32>().expect("tensors of this crate hold f32");
        let finite = checked.iter().all(|value| value.is_finite());
        (rendering, observation, (checked[0], finite.then_some(gradients)))
    }

    fn control_density(&mut self, observation: &Observation, config: &Config) -> Changes {
        let moment = Moment {
            step: self.step,
            steps: config.steps,
            seed: config.seed,
            extent: self.extent,
            means_lr: config.optimiser.means_lr_at(self.step, config.steps),
        };
        let Self { parameters, optimiser, density, .. } = self;
        density.after_step(parameters, optimiser, observation, &config.density, &moment)
    }

    fn raise_sh_degree(&mut self, config: &Config) {
        let degree = sh_degree(self.step, config.model.sh_interval, config.model.sh_degree, config.steps);
        if degree > self.parameters.sh_degree() {
            self.parameters.grow_sh(degree);
            self.optimiser.grow_sh(degree);
        }
    }
}
