//! One optimisation step: render a photo's view, compare, go back, update, let density control act.

use burn::tensor::Tensor;
use gs_burn::{Extras, Gaussians, RenderOptions, profile, render_with};
use gs_datasets::{Scene, View};
use gs_models::Motion;
use serde::{Deserialize, Serialize};

use crate::data::Photo;
use crate::density::{Changes, Density, Moment, Observation, Succession, trim};
use crate::experiment::Config;
use crate::losses::{photometric, regularisers};
use crate::optimiser::Optimiser;
use crate::parameters::{Gradients, Group, Parameters};
use crate::scene_init::{first_gaussians, size_of};
use crate::schedule::{due, sh_degree};
use crate::taylormode;
use crate::taylormode::hints::Found;
use crate::taylormode::state::{MotionGradients, MotionState, model};

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
    /// Gaussians nearer than this are not drawn, scene units; 0: by the data set, see [`settled`](crate::data::settled()).
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
        Self { near: 0.0, far: options.far, eps2d: options.eps2d, antialiased: options.antialiased }
    }
}

impl RenderConfig {
    /// The options of one rendering.
    pub fn options(&self, sh_degree: usize, background: [f32; 3]) -> RenderOptions {
        RenderOptions {
            sh_degree,
            background,
            near: if self.near > 0.0 { self.near } else { RenderOptions::default().near },
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
    /// What moves, and how; `None` for a static scene.
    pub motion: Option<MotionState>,
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
    /// The photo's depth prior fitted nothing that is rendered, and was left out.
    pub depth_misfit: bool,
    /// Whether loss or gradients were not finite, so that nothing was updated.
    pub skipped: bool,
    /// What density control did.
    pub changes: Changes,
}

/// What an image formation hands to the step.
pub(crate) struct Formed {
    /// What stands beside the photo: blurred where blur is modelled, `[H, W, 3]`.
    pub color: Tensor<3>,
    /// All terms but the regularisers, `[1]`.
    pub loss: Tensor<1>,
    /// Bounding radii in the image, `[N]`, pixels.
    pub radii: Tensor<1>,
    /// Tile intersections.
    pub intersections: usize,
    /// The photo's depth prior fitted nothing that is rendered, and was left out.
    pub depth_misfit: bool,
}

/// A rendering compared with a photo, gone back from.
#[derive(Debug)]
pub(crate) struct Compared {
    /// What stands beside the photo, `[H, W, 3]`, without autodiff.
    pub color: Tensor<3>,
    /// Tile intersections.
    pub intersections: usize,
    /// See [`StepReport::depth_misfit`].
    pub depth_misfit: bool,
    /// What density control wants to know.
    pub observation: Observation,
    /// The loss.
    pub loss: f32,
    /// Gradients of the table and, where something moves, of the motion; `None` when they or the loss are not finite.
    pub gradients: Option<(Gradients, Option<MotionGradients>)>,
}

impl Trainer {
    /// The state before the first step, on `device` (without autodiff), from what [`gather`](taylormode::hints::gather)
    /// found in the scene; `None`: a scene that stands still.
    pub fn begin(scene: &Scene, found: Option<&Found>, config: &Config, device: &burn::tensor::Device) -> Self {
        match found {
            None => {
                let first = first_gaussians(scene, &config.init, config.density.cap, config.seed);
                Self::from_parts(Parameters::first(&first, device), None, size_of(scene), config)
            }
            Some(found) => taylormode::init::begin(scene, found, config, device),
        }
    }

    pub(crate) fn from_parts(
        parameters: Parameters,
        motion: Option<MotionState>,
        extent: f64,
        config: &Config,
    ) -> Self {
        Self {
            optimiser: Optimiser::new(&parameters),
            density: Density::new(&config.density, &parameters),
            parameters,
            motion,
            step: 0,
            skipped: 0,
            extent,
        }
    }

    /// The scene as it is now, without autodiff.
    pub fn model(&self) -> Box<dyn Motion> {
        model(self.parameters.gaussians(), self.motion.as_ref())
    }

    /// Share of the run done before this step, 0 to 1.
    pub(crate) fn progress(&self, config: &Config) -> f64 {
        (self.step.max(1) - 1) as f64 / config.steps as f64
    }

    /// Whether this step should compute screen gradients.
    pub(crate) fn wants_screen(&self, config: &Config) -> bool {
        self.density.wants_screen(&config.density, self.step, config.steps)
    }

    /// One step on one photo.
    pub fn step(&mut self, photo: &Photo, config: &Config) -> StepReport {
        self.step += 1;
        self.raise_sh_degree(config);

        let compared = self.compare(photo, config);
        let mut report = StepReport {
            loss: compared.loss,
            color: compared.color,
            intersections: compared.intersections,
            depth_misfit: compared.depth_misfit,
            skipped: compared.gradients.is_none(),
            changes: Changes::default(),
        };
        match compared.gradients {
            Some((of_table, of_motion)) => {
                let adam = profile::whole_stage("Adam");
                let rates = config.optimiser.rates(self.step, config.steps, self.extent);
                self.optimiser.step(&mut self.parameters, of_table, rates, &config.optimiser);
                if let (Some(state), Some(gradients)) = (&mut self.motion, of_motion) {
                    let rates = taylormode::rates(state, config, self.step, self.extent);
                    state.step(gradients, &rates, self.parameters.get(Group::Means));
                }
                drop(adam);
                report.changes = self.control_density(&compared.observation, config);
            }
            None => {
                self.skipped += 1;
                let loss = compared.loss;
                tracing::warn!(step = self.step, loss, "loss or gradients are not finite: step skipped");
            }
        }
        report
    }

    /// Forms the photo's image, compares the two and goes back.
    fn compare(&self, photo: &Photo, config: &Config) -> Compared {
        let tracked = self.parameters.tracked();
        let lent = self.motion.as_ref().map(|state| (state, state.lend(&tracked)));
        let screen = self.wants_screen(config).then(|| {
            Tensor::<2>::zeros([self.parameters.len(), 4], &self.parameters.device()).autodiff().require_grad()
        });
        let formed = match &lent {
            None => self.form(&tracked, photo, config, screen.clone()),
            Some((state, lent)) => {
                taylormode::step::form(self, (*state, lent), &tracked, photo, config, screen.clone())
            }
        };
        let loss = formed.loss + regularisers(&tracked, self.extent, &config.loss);
        let mut gradients = profile::timed("backward, rest of the graph", || loss.backward());

        let observation = Observation {
            screen: screen.and_then(|screen| screen.grad_remove(&mut gradients)),
            radii: formed.radii.inner(),
            width: photo.camera.width,
            height: photo.camera.height,
        };
        let of_table = Gradients::take(&tracked, &mut gradients);
        let of_motion = lent.map(|(_, lent)| MotionState::take(&lent, &mut gradients));
        let _stage = profile::stage("check of the gradients");
        let finiteness = match &of_motion {
            None => of_table.finiteness(),
            Some(of_motion) => of_table.finiteness() + of_motion.finiteness(),
        };
        // One read for both, because a read waits for the device.
        let checked = Tensor::cat(vec![loss.inner(), finiteness], 0).into_data();
        let checked = checked.as_slice::<f32>().expect("tensors of this crate hold f32");
        let finite = checked.iter().all(|value| value.is_finite());
        Compared {
            color: formed.color.inner(),
            intersections: formed.intersections,
            depth_misfit: formed.depth_misfit,
            observation,
            loss: checked[0],
            gradients: finite.then_some((of_table, of_motion)),
        }
    }

    /// The image of a scene that stands still.
    fn form(&self, tracked: &Gaussians, photo: &Photo, config: &Config, screen: Option<Tensor<2>>) -> Formed {
        let options = config.render.options(self.parameters.sh_degree(), config.data.background.color());
        let rendering = render_with(tracked, &photo.camera, &options, Extras { screen, features: None });
        Formed {
            loss: photometric(rendering.color.clone(), photo.image.clone(), photo.mask.clone(), &config.loss),
            radii: rendering.radii(),
            intersections: rendering.intersections,
            color: rendering.color,
            depth_misfit: false,
        }
    }

    fn control_density(&mut self, observation: &Observation, config: &Config) -> Changes {
        let _stage = profile::whole_stage("density control");
        let moment = Moment {
            step: self.step,
            steps: config.steps,
            seed: config.seed,
            extent: self.extent,
            means_lr: config.optimiser.means_lr_at(self.step, config.steps),
        };
        let Self { parameters, optimiser, density, .. } = self;
        let refinement = density.after_step(parameters, optimiser, observation, &config.density, &moment);
        if let Some(succession) = &refinement.succession {
            self.follow(succession);
        }
        refinement.changes
    }

    /// Has the motion follow a change of the table.
    fn follow(&mut self, succession: &Succession) {
        if let Some(state) = &mut self.motion {
            state.follow(&succession.source, &succession.fresh);
        }
    }

    /// Leaves out what the scene does not need, when it is time: Gaussians, orders of paths, bands of colour.
    pub fn simplify(&mut self, views: &[View], config: &Config) {
        if config.density.trim > 0.0 && config.density.rests_at(self.step, config.steps) {
            self.trim(views, config);
        }
        self.select_motion(views, config);
    }

    fn trim(&mut self, views: &[View], config: &Config) {
        let _stage = profile::whole_stage("trimming");
        let options = config.render.options(0, [0.0; 3]);
        let contributions = trim::contributions(&*self.model(), views, &options, config.seed);
        let before = self.parameters.len();
        let succession = trim::trim(&mut self.parameters, &mut self.optimiser, &contributions, config.density.trim);
        if let Some(succession) = succession {
            self.follow(&succession);
            // Its statistics were of the rows before, and are not used any more.
            self.density = Density::new(&config.density, &self.parameters);
        }
        let (gaussians, share) = (self.parameters.len(), config.density.trim);
        tracing::info!(before, gaussians, share, "Gaussians that add next to nothing were dropped");
    }

    fn select_motion(&mut self, views: &[View], config: &Config) {
        let motion = &config.motion;
        let Some(state) = &mut self.motion else { return };
        let begun = self.step as f64 >= motion.select_from * config.steps as f64;
        if motion.select && begun && (due(self.step, motion.select_every) || self.step == config.steps) {
            let _stage = profile::whole_stage("selection of orders");
            let selected = taylormode::likelihood::select_with_check(&mut self.parameters, state, views, config);
            tracing::debug!(step = self.step, moving = state.rows.len(), ?selected, "motion");
            taylormode::select::select_bands(&mut self.parameters, motion, self.step == config.steps);
        }
    }

    fn raise_sh_degree(&mut self, config: &Config) {
        let degree = sh_degree(self.step, config.model.sh_interval, config.model.sh_degree, config.steps);
        if degree > self.parameters.sh_degree() {
            self.parameters.grow_sh(degree);
            self.optimiser.grow_sh(degree);
        }
    }
}
