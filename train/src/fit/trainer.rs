//! The state of a training and its step: render, compare, backward, update, density control.

use std::borrow::Cow;
use std::ops::{Deref, DerefMut};

use burn::module::{Module, ModuleDisplay};
use burn::tensor::{Device, Tensor};
use gs_burn::adam::{Adam, AdamRate};
use gs_burn::ops::intersect::DeviceCount;
use gs_burn::ops::rasterize::SCREEN;
use gs_burn::{Gaussians, NamedGradients, RowMap, profile};
use gs_datasets::{Scene, View};
use gs_models::DynamicScene;

use super::camera_paths::CameraPaths;
use super::correction::Correction;
use super::density::prune::{contributions, prune_by_contribution};
use super::density::{Changes, Density, Observation, StepContext};
use super::facts::SceneFacts;
use super::losses::regularised;
use super::method::{Drawn, Forward, Method, Note, Step};
use super::parameters::{Group, Table, first, widen};
use super::photos::Photo;
use super::room::{ListRoom, fitting};
use super::schedule::{exponential, rate_factor, sh_degree};
use super::training::Training;
use crate::config::{Config, FitConfig, OptimiserConfig};

/// All that is learned, as one module tree: paths begin with `gaussians.`, `correction.`, `cameras.` and `method.`.
#[derive(Module, Debug)]
pub struct Model<M: Module + ModuleDisplay> {
    /// The Gaussians.
    pub gaussians: Gaussians,
    /// Exposure and white balance of the photos, if they are learned.
    pub correction: Option<Correction>,
    /// Poses of the photos' cameras, if they are learned.
    pub cameras: Option<CameraPaths>,
    /// The method's module.
    pub method: M,
}

impl<M: Module + ModuleDisplay> Model<M> {
    /// A model whose photos agree in exposure and white balance.
    pub fn uncorrected(gaussians: Gaussians, method: M) -> Self {
        Self { gaussians, correction: None, cameras: None, method }
    }

    /// Some photos of `views` with the changes of their colours and the ways of their cameras, in this model's graph.
    pub fn taken<'a, X: Clone>(
        &self,
        photos: &'a [Photo<X>],
        views: &[View],
        facts: &SceneFacts,
    ) -> Cow<'a, [Photo<X>]> {
        if self.correction.is_none() && self.cameras.is_none() {
            return Cow::Borrowed(photos);
        }
        let taken = |photo: &Photo<X>| {
            let view = &views[photo.index];
            let color = self.correction.as_ref().and_then(|it| it.of(view));
            let path = self.cameras.as_ref().and_then(|it| it.path(view, &photo.camera, facts));
            Photo { color, path, ..photo.clone() }
        };
        Cow::Owned(photos.iter().map(taken).collect())
    }
}

/// The state that changes from step to step: a [`Training`] of the model, and the values that density control and
/// renderings keep.
#[derive(Debug, Clone)]
pub struct Trainer<M: Method> {
    training: Training<Model<M>>,
    /// Density control and its statistics.
    pub density: Density,
    /// Values fixed by the data set.
    pub facts: SceneFacts,
    room: ListRoom,
    /// The input of which density control wants the gradient, `[N, 4]`: zeros, kept because they are the same in each
    /// step.
    zeros: Option<Tensor<2>>,
}

/// The outcome of a step.
#[derive(Debug)]
pub struct StepReport {
    /// The loss before the update.
    pub loss: f32,
    /// The images as they were compared with the step's photos, `[H, W, 3]`, without autodiff.
    pub images: Vec<Tensor<3>>,
    /// Tile intersections of the renderings.
    pub intersections: usize,
    /// Departures from the configuration.
    pub notes: Vec<Note>,
    /// Whether loss or gradients were not finite, so that nothing was updated.
    pub skipped: bool,
    /// The changes by density control.
    pub changes: Changes,
}

/// A finished backward pass.
struct Backward {
    images: Vec<Tensor<3>>,
    /// Tile intersections of each rendering.
    intersections: Vec<usize>,
    /// Tiles of each exposure.
    tiles: Vec<usize>,
    notes: Vec<Note>,
    observations: Vec<Observation>,
    loss: f32,
    /// `None` if they or the loss are not finite.
    gradients: Option<NamedGradients>,
}

impl<M: Method> Deref for Trainer<M> {
    type Target = Training<Model<M>>;

    fn deref(&self) -> &Self::Target {
        &self.training
    }
}

impl<M: Method> DerefMut for Trainer<M> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.training
    }
}

impl<M: Method> Trainer<M> {
    /// The state before the first step, on `device` (without autodiff).
    pub fn begin(
        scene: &Scene,
        cues: &M::Cues,
        config: &FitConfig<M::Config>,
        facts: SceneFacts,
        device: &Device,
    ) -> Self {
        let (initial, method) = M::begin(scene, &Step { step: 0, config, facts: &facts, cues, room: None }, device);
        let correction = Correction::begin(&scene.train, &initial.means, &config.correction, device);
        let cameras = CameraPaths::begin(&scene.train, &facts, config, device);
        Self::from_model(Model { gaussians: first(&initial, device), correction, cameras, method }, facts, config)
    }

    /// The state before the first step of a training that starts from `model`.
    pub fn from_model(model: Model<M>, facts: SceneFacts, config: &Config) -> Self {
        Self::from_training(Training::new(model), facts, config)
    }

    /// The state of a training whose density control has no statistics yet.
    pub fn from_training(training: Training<Model<M>>, facts: SceneFacts, config: &Config) -> Self {
        let density = Density::new(&config.density, &training.module().gaussians);
        Self { training, density, facts, room: ListRoom::default(), zeros: None }
    }

    /// The model.
    pub fn model(&self) -> &Model<M> {
        self.module()
    }

    /// The Gaussians.
    pub fn gaussians(&self) -> &Gaussians {
        &self.model().gaussians
    }

    /// The method's module.
    pub fn method(&self) -> &M {
        &self.model().method
    }

    /// Replaces the method's module by `change` of it.
    pub fn change_method(&mut self, change: impl FnOnce(M) -> M) {
        self.change(|model, _| Model { method: change(model.method), ..model });
    }

    /// The current scene, without autodiff.
    pub fn scene(&self) -> Box<dyn DynamicScene> {
        self.method().scene(self.gaussians().clone())
    }

    /// The current step, with everything that the method may read.
    pub fn at<'a>(&'a self, cues: &'a M::Cues, config: &'a FitConfig<M::Config>) -> Step<'a, M> {
        Step { step: self.step, config, facts: &self.facts, cues, room: None }
    }

    /// One step on some photos; `views` are all training views.
    pub fn step(
        &mut self,
        photos: &[Photo<M::Extra>],
        views: &[View],
        cues: &M::Cues,
        config: &FitConfig<M::Config>,
    ) -> StepReport {
        self.step += 1;
        let facts = self.facts;
        let at = Step { step: self.step, config, facts: &facts, cues, room: None };
        self.raise_sh_degree(config);
        let Backward { images, intersections, tiles, notes, observations, loss, gradients } =
            self.compared(photos, views, &at);
        self.room.observe(&intersections, &tiles);
        let intersections = intersections.iter().sum();
        let skipped = gradients.is_none();
        let mut changes = Changes::default();
        match gradients {
            Some(gradients) => {
                self.update(gradients, &at);
                changes = self.control_density(observations, &at);
            }
            None => {
                self.skipped += 1;
                tracing::warn!(step = self.step, loss, "loss or gradients are not finite: step skipped");
            }
        }
        self.finish_step(views, &at);
        StepReport { loss, images, intersections, notes, skipped, changes }
    }

    /// Forward and backward pass over the photos. If a rendering had more pairs or tiles than the steps before made
    /// room for, both are done again with lists of the right length.
    fn compared(&mut self, photos: &[Photo<M::Extra>], views: &[View], at: &Step<M>) -> Backward {
        if self.wants_screen(at.config) {
            let (shape, device) = ([self.gaussians().len(), SCREEN], self.gaussians().device());
            self.zeros = self.zeros.take().filter(|zeros| zeros.dims() == shape);
            self.zeros.get_or_insert_with(|| Tensor::zeros(shape, &device));
        } else {
            self.zeros = None;
        }
        self.compare(photos, views, &Step { room: self.room.room(), ..*at }).unwrap_or_else(|| {
            tracing::debug!(
                step = self.step,
                "more tile intersections or tiles than there was room for: the step is done again"
            );
            let again = self.compare(photos, views, at);
            again.expect("lists that are counted first have room")
        })
    }

    fn wants_screen(&self, config: &FitConfig<M::Config>) -> bool {
        self.density.wants_screen(&config.density, M::control(self.step, config), self.step, config.steps)
    }

    /// Forward and backward pass with the step's room for the lists of each rendering; `None` if there was too little.
    fn compare(&self, photos: &[Photo<M::Extra>], views: &[View], at: &Step<M>) -> Option<Backward> {
        let config = at.config;
        let tracked = self.model().clone().train();
        let screen = |zeros: &Tensor<2>| zeros.clone().autodiff().require_grad();
        let screens: Vec<Tensor<2>> = photos.iter().filter_map(|_| self.zeros.as_ref().map(screen)).collect();
        let Forward { images, loss, drawn, notes, remainder } =
            tracked.method.forward(&tracked.gaussians, &tracked.taken(photos, views, at.facts), &screens, at);
        let fixed = config.density.rests_by(self.step, config.steps);
        let loss = regularised(loss, &tracked.gaussians, self.facts.extent, fixed, &config.loss);
        let loss = tracked.correction.as_ref().map_or(loss.clone(), |it| loss + it.size() * config.correction.weight);
        let mut graph = profile::timed("backward, rest of the graph", || loss.backward());

        let mut counts: Vec<DeviceCount> = drawn.iter().flat_map(|drawn| drawn.intersections.clone()).collect();
        let renderings = counts.len();
        counts.extend(drawn.iter().flat_map(|drawn| drawn.tiles.clone()));
        let mut observe = |((drawn, photo), screen): ((Drawn, &Photo<M::Extra>), Tensor<2>)| {
            let (width, height) = (photo.camera.width, photo.camera.height);
            Some(Observation { screen: screen.grad_remove(&mut graph)?, radii: drawn.radii?.inner(), width, height })
        };
        let observations = drawn.into_iter().zip(photos).zip(screens).filter_map(&mut observe).collect();
        let mut gradients = NamedGradients::take(&tracked, &mut graph);
        if let Some(remainder) = remainder {
            remainder(&mut graph, &mut gradients);
        }
        let _stage = profile::stage("check of the gradients");
        let mut checked = vec![loss.inner()];
        checked.extend(gradients.finiteness());
        let numbers = checked.len();
        checked.extend(counts.iter().filter_map(DeviceCount::words));
        // One read for all: a read waits for the device.
        let checked = Tensor::cat(checked, 0).into_data();
        let (numbers, words) = checked.as_slice::<f32>().expect("tensors of this crate hold f32").split_at(numbers);
        let (mut intersections, fit) = fitting(&counts, words);
        let tiles = intersections.split_off(renderings);
        let finite = numbers.iter().all(|value| value.is_finite());
        fit.then(|| Backward {
            images: images.into_iter().map(Tensor::inner).collect(),
            intersections,
            tiles,
            notes,
            observations,
            loss: numbers[0],
            gradients: finite.then_some(gradients),
        })
    }

    /// One Adam update of the Gaussians, then of the method's tensors.
    fn update(&mut self, mut gradients: NamedGradients, at: &Step<M>) {
        let _stage = profile::whole_stage("Adam");
        let rate = gaussian_rates(&at.config.optimiser, at.step, self.means_span(at.config), at.facts);
        self.training.change(|Model { gaussians, correction, cameras, method }, adam| {
            adam.advance();
            let gaussians = adam.update_under("gaussians", gaussians, &mut gradients, rate);
            let correction = correction.map(|it| it.updated(&mut gradients, adam, at.config, at.step));
            let cameras = cameras.map(|it| it.updated(&mut gradients, adam, at.config, at.step));
            let method = method.update(&gaussians, &mut gradients, adam, at);
            Model { gaussians, correction, cameras, method }
        });
    }

    /// The steps after which and up to which the learning rate of the means falls.
    fn means_span(&self, config: &FitConfig<M::Config>) -> [usize; 2] {
        [self.model().method.means_restart(self.step, config), config.steps]
    }

    fn control_density(&mut self, observations: Vec<Observation>, at: &Step<M>) -> Changes {
        let config = at.config;
        let _stage = profile::whole_stage("density control");
        let context = StepContext {
            step: self.step,
            steps: config.steps,
            seed: config.seed,
            extent: self.facts.extent,
            means_lr: means_lr(&config.optimiser, self.step, self.means_span(config))
                * (means_unit(&config.optimiser, &self.facts) / self.facts.extent),
            control: M::control(self.step, config),
        };
        let mut changes = Changes::default();
        self.training.change(|Model { mut gaussians, method, correction, cameras }, adam| {
            let refinement = self.density.after_step(&mut gaussians, adam, observations, &config.density, &context);
            changes = refinement.changes;
            Model { gaussians, correction, cameras, method: follow(method, refinement.rows.as_ref(), adam) }
        });
        changes
    }

    /// Prunes Gaussians if it is time, then changes the model as the method says.
    fn finish_step(&mut self, views: &[View], at: &Step<M>) {
        if at.config.density.prune_share > 0.0 && at.config.density.rests_at(at.step, at.config.steps) {
            self.prune(views, at.config);
        }
        self.training.change(|Model { mut gaussians, method, correction, cameras }, adam| {
            let method = method.after_step(&mut gaussians, adam, views, at);
            Model { gaussians, correction, cameras, method }
        });
    }

    fn prune(&mut self, views: &[View], config: &Config) {
        let _stage = profile::whole_stage("pruning");
        let options = SceneFacts { background: [0.0; 3], ..self.facts }.render_options(&config.render, 0);
        let contributions = contributions(&*self.scene(), views, &options, config.seed);
        let (before, share) = (self.gaussians().len(), config.density.prune_share);
        self.training.change(|Model { mut gaussians, method, correction, cameras }, adam| {
            let rows = prune_by_contribution(&mut gaussians, adam, &contributions, share);
            if rows.is_some() {
                // Its statistics are of the rows before, and are not used any more.
                self.density = Density::new(&config.density, &gaussians);
            }
            Model { gaussians, correction, cameras, method: follow(method, rows.as_ref(), adam) }
        });
        tracing::info!(
            before,
            gaussians = self.gaussians().len(),
            share,
            "Gaussians that contribute next to nothing were pruned"
        );
    }

    /// Stores SH coefficients up to the degree of this step; the new ones are zero. An inactive coefficient would have
    /// stayed zero with zero moments, so storing it earlier would only cost memory and time.
    fn raise_sh_degree(&mut self, config: &Config) {
        let degree = sh_degree(self.step, config.model.sh_interval, config.model.sh_degree, config.steps);
        if degree > self.gaussians().sh_degree() {
            self.change(|Model { mut gaussians, method, correction, cameras }, adam| {
                let columns = Group::Sh.columns(degree);
                let sh = widen(gaussians.group(Group::Sh), columns);
                gaussians.set(Group::Sh, sh);
                adam.widen(Group::Sh.path(), columns);
                Model { gaussians, correction, cameras, method }
            });
        }
    }
}

fn follow<M: Method>(method: M, rows: Option<&RowMap>, adam: &mut Adam) -> M {
    match rows {
        Some(rows) => method.follow(rows, adam),
        None => method,
    }
}

/// The unit of the rates of the means, scene units: the extent (3DGS), or that in which `means_lr` is `means_pixels`.
fn means_unit(config: &OptimiserConfig, facts: &SceneFacts) -> f64 {
    let pixel = facts.pixel.filter(|_| config.means_pixels > 0.0);
    pixel.map_or(facts.extent, |pixel| config.means_pixels / config.means_lr * pixel)
}

/// Learning rate of the means at `step`, which falls from the step after `begun` to the last of `steps`, and no faster
/// than in a run of `decay_steps`, in [`means_unit`]s.
fn means_lr(config: &OptimiserConfig, step: usize, [begun, steps]: [usize; 2]) -> f64 {
    let length = (steps - begun).max(config.decay_steps.saturating_sub(begun));
    let falling = exponential(config.means_lr, config.means_lr_final, step - begun, length);
    falling * rate_factor(config.short_run_factor, steps)
}

/// The rate of the view-dependent colour (SH degrees 1 to 3) is this many times below the base colour's, as in 3DGS.
const REST_SLOWER: f64 = 20.0;

/// The rate of each group of the Gaussians at a step, by path.
fn gaussian_rates(
    config: &OptimiserConfig,
    step: usize,
    span: [usize; 2],
    facts: &SceneFacts,
) -> impl Fn(&str) -> Option<AdamRate> {
    let sh_rest_lr = config.sh_lr / REST_SLOWER;
    let factor = rate_factor(config.short_run_factor, span[1]);
    let rates = Group::ALL.map(|group| match group {
        Group::Means => AdamRate::new(means_lr(config, step, span) * means_unit(config, facts)),
        Group::Quats => AdamRate::new(factor * config.quats_lr),
        Group::LogScales => AdamRate::new(factor * config.scales_lr),
        Group::Opacity => AdamRate::new(factor * config.opacity_lr),
        // The base colour, the first three columns, has a rate of its own.
        Group::Sh => AdamRate { first_columns: Some((3, factor * config.sh_lr)), ..AdamRate::new(factor * sh_rest_lr) },
    });
    move |path| Group::ALL.into_iter().find(|group| group.path() == path).map(|group| rates[group as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rates of the means at the first step, scene units.
    fn first(means_pixels: f64, steps: usize, pixel: Option<f64>) -> f64 {
        let config = OptimiserConfig { means_pixels, ..OptimiserConfig::default() };
        let facts = SceneFacts { extent: 5.0, pixel, ..SceneFacts::unknown(&Config::default()) };
        let rates = gaussian_rates(&config, 1, [0, steps], &facts);
        rates(Group::Means.path()).expect("means have a rate").lr
    }

    #[test]
    fn means_move_by_pixels_where_the_cameras_look_at_one_subject() {
        assert!((first(0.06, 30_000, Some(0.004)) - 0.06 * 0.004).abs() < 1e-15);
        assert!((first(0.06, 300, Some(0.004)) - 2.0 * 0.06 * 0.004).abs() < 1e-15, "a short run has twice the rate");
        assert_eq!(first(0.06, 30_000, None), 1.6e-4 * 5.0);
        assert_eq!(first(0.0, 30_000, Some(0.004)), 1.6e-4 * 5.0);
    }

    #[test]
    fn a_rate_that_starts_anew_begins_and_ends_as_before() {
        let config = OptimiserConfig { short_run_factor: 1.0, ..OptimiserConfig::default() };
        let rate = |step: usize, begun: usize| means_lr(&config, step, [begun, 6000]);
        assert_eq!((rate(1, 0), rate(4561, 4560)), (config.means_lr, config.means_lr));
        assert!(rate(4560, 0) < 0.05 * config.means_lr);
        assert!((rate(6000, 4560) / config.means_lr_final - 1.0).abs() < 1e-9);
    }
}
