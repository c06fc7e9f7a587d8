//! [`Method`]: the contribution of a paper to fitting Gaussians to the photos of one scene.
//!
//! Plain 3D Gaussian Splatting is the empty method. A method is a Burn module (the tensors learned beside the Gaussians) and
//! defines how its step differs: the choice of views, the image that is compared with a photo, the update of its tensors.
//! Everything else (the loop, density control, checkpoints, evaluation, reports) is written once, in terms of this trait.

use std::fmt::Debug;
use std::path::Path;

use burn::module::{Module, ModuleDisplay};
use burn::tensor::{Device, Gradients, Tensor};
use gs_burn::adam::Adam;
use gs_burn::ops::intersect::{DeviceCount, Room};
use gs_burn::{Gaussians, NamedGradients, Rendering, RowMap};
use gs_datasets::{LoadOptions, Scene, View};
use gs_models::{DynamicScene, Static};

use super::density::Control;
use super::facts::{SceneFacts, Unseen};
use super::figure::Figures;
use super::foresight::Foresight;
use super::initialise::{InitialGaussians, initial_gaussians};
use super::photos::{Extra, Photo};
use super::sampler::{Sampler, ViewOrder};
use super::timetable::Timetable;
use crate::config::{Config, FitConfig, Section};

/// One step, or one measurement, with everything that a method may read in it.
pub struct Step<'a, M: Method> {
    /// The current step, from 1; after training, the last one.
    pub step: usize,
    /// The configuration.
    pub config: &'a FitConfig<M::Config>,
    /// Values fixed by the data set.
    pub facts: &'a SceneFacts,
    /// The method's cues from the data set.
    pub cues: &'a M::Cues,
    /// Room for the lists of a rendering, if steps before this one tell; see [`gs_burn::Extras::room`].
    pub room: Option<Room>,
}

impl<M: Method> Clone for Step<'_, M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M: Method> Copy for Step<'_, M> {}

impl<M: Method> Step<'_, M> {
    /// Room for the pairs of a rendering.
    pub fn pair_room(&self) -> Option<usize> {
        self.room.map(|room| room.pairs)
    }

    /// Share of the run before this step, 0 to 1.
    pub fn progress(&self) -> f64 {
        (self.step.max(1) - 1) as f64 / self.config.steps as f64
    }
}

/// The images of a step and their loss.
pub struct Forward {
    /// One image per photo, as compared with it, `[H, W, 3]`.
    pub images: Vec<Tensor<3>>,
    /// All terms but the shared regularisers, `[1]`.
    pub loss: Tensor<1>,
    /// One rendering per photo.
    pub drawn: Vec<Drawn>,
    /// Departures from the configuration, to be counted and reported.
    pub notes: Vec<Note>,
    /// The part of the backward pass that is not in the loss's graph, if there is one.
    pub remainder: Option<Remainder>,
}

/// A part of a backward pass that a method computes itself, after that of the loss: it takes the gradients of its leaves out of the finished
/// pass and adds to those of the model, whose paths begin with `gaussians.` and `method.`.
pub type Remainder = Box<dyn FnOnce(&mut Gradients, &mut NamedGradients)>;

impl Forward {
    /// No image, and a loss of zero on `device`.
    pub fn empty(device: &Device) -> Self {
        let loss = Tensor::zeros([1], device);
        Self { images: Vec::new(), loss, drawn: Vec::new(), notes: Vec::new(), remainder: None }
    }
}

/// The quantities of a photo's renderings that density control and the trainer need.
pub struct Drawn {
    /// Rows whose last column is the bounding radius of each Gaussian in the image, `[N, C]`, pixels; 0 if it was not seen. `None` where
    /// the step has no `screens`.
    pub radii: Option<Tensor<2>>,
    /// Tile intersections of each rendering.
    pub intersections: Vec<DeviceCount>,
    /// Tiles of each exposure, which are more than the image's.
    pub tiles: Vec<DeviceCount>,
}

impl Drawn {
    /// Those of one rendering, made with `screen`.
    pub fn of(rendering: &Rendering, screen: Option<&Tensor<2>>) -> Self {
        Self {
            radii: screen.map(|_| rendering.projected.clone()),
            intersections: vec![rendering.intersections.clone()],
            tiles: Vec::new(),
        }
    }
}

/// A departure of one step from the configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Note {
    /// A sentence, shown once if the note came in more than `often_percent` of the steps; `{count}` and `{steps}` are replaced by
    /// numbers.
    pub sentence: &'static str,
    /// Smallest share of the steps for the sentence to be shown, per cent.
    pub often_percent: u32,
}

/// A part of a held-out view that is scored separately.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Region {
    /// Its name, such as "moving".
    pub name: &'static str,
    /// `[height, width]`: 255 inside.
    pub mask: Vec<u8>,
}

/// The name of the region in which something moves.
pub const MOVING: &str = "moving";

/// The image with which a held-out photo was compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compared {
    /// The sharp rendering.
    Sharp,
    /// The blurred image formed over the photo's exposure.
    FormedBlur,
}

/// A key of the configuration by which charts distinguish runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChartKey {
    /// Name in charts.
    pub name: &'static str,
    /// Key of the configuration.
    pub key: &'static str,
    /// Label for a name and value: `("none", "no blur model")`; with `("*", "")` every other value is its own label.
    pub words: &'static [(&'static str, &'static str)],
    /// The key has no meaning if another key has this value: `("blur.mode", "none")`.
    pub unless: Option<(&'static str, &'static str)>,
}

impl ChartKey {
    /// The chart label of the key with a value: `no blur model`, `N 7`, `cap 20k`.
    pub fn label(&self, value: &str) -> String {
        if let Some((_, words)) = self.words.iter().find(|(of, _)| *of == value) {
            return (*words).to_string();
        }
        if self.words.iter().any(|(of, _)| *of == "*") {
            return value.to_string();
        }
        match value.parse::<usize>() {
            Ok(number) if number >= 1000 && number.is_multiple_of(100) => {
                format!("{} {}k", self.name, number as f64 / 1000.0)
            }
            _ => format!("{} {value}", self.name),
        }
    }
}

/// The key that is part of every chart of runs.
pub const CAP: ChartKey = ChartKey { name: "cap", key: "density.cap", words: &[], unless: None };

/// The contribution of a paper to fitting Gaussians to the photos of one scene.
///
/// A type that implements it is a Burn module: its `Param`s are learned, saved under their paths and checked for NaN without
/// further code. `docs/extend.md` walks through an implementation.
pub trait Method: Module + ModuleDisplay + Debug + Send + 'static {
    /// The method's name, as in `pipeline = "..."`.
    const NAME: &'static str;
    /// Whether photos may be compared at a reduced width: nothing in [`Extra`](Self::Extra) or [`Cues`](Self::Cues) has their size.
    const ANY_WIDTH: bool = false;
    /// The background where the photos do not tell.
    const UNSEEN: Unseen = Unseen::Black;
    /// The method's sections of the configuration.
    type Config: Section;
    /// Cues inferred once from the data set, before the first step; never saved, never written into the data set.
    type Cues: Debug + Send + Sync;
    /// Device data of a photo, beside its image.
    type Extra: Extra;

    /// The configuration of `pipeline = "..."` alone.
    fn defaults() -> FitConfig<Self::Config>;

    /// Changes how the data set is loaded.
    fn loading(_config: &FitConfig<Self::Config>, _options: &mut LoadOptions) {}

    /// Removes views that the method cannot use, with a warning in `scene.warnings`.
    fn prepare(_scene: &mut Scene) {}

    /// The warning about `without_time` photos without a time, if others have one.
    fn leaves_out(_without_time: usize) -> Option<String> {
        None
    }

    /// Whether the method can learn from `train` training views, `timed` of which have a time.
    ///
    /// # Errors
    /// A sentence about `dataset`.
    fn suits(_dataset: &Path, _train: usize, _timed: usize) -> Result<(), String> {
        Ok(())
    }

    /// Whether every photo's time can be reached under `config`.
    ///
    /// # Errors
    /// A sentence about `dataset` or a key of the configuration.
    fn reaches(_dataset: &Path, _scene: &Scene, _config: &FitConfig<Self::Config>) -> Result<(), String> {
        Ok(())
    }

    /// The method's near plane, as a share of the subject's distance; `None`: the renderer's own.
    fn near_share(_scene: &Scene, _config: &FitConfig<Self::Config>) -> Option<f64> {
        None
    }

    /// Infers the cues from the training views, once per run.
    fn cues(scene: &Scene, config: &FitConfig<Self::Config>) -> Self::Cues;

    /// The state before the first step, on `device` without autodiff.
    fn begin(scene: &Scene, at: &Step<Self>, device: &Device) -> (InitialGaussians, Self);

    /// Device data of the `index`-th training view.
    fn extra(view: &View, index: usize, at: &Step<Self>, device: &Device) -> Self::Extra;

    /// The order in which steps use the views.
    fn order(&self, views: &[View], config: &FitConfig<Self::Config>) -> Box<dyn ViewOrder> {
        Box::new(Sampler::new(config.seed, views.len()))
    }

    /// The images of `photos` and their loss. `self` and `gaussians` are leaves of this step's graph. `screens` has one `[N, 4]`
    /// per photo if density control needs the gradient with respect to the 2D means, and is empty otherwise.
    fn forward(
        &self,
        gaussians: &Gaussians,
        photos: &[Photo<Self::Extra>],
        screens: &[Tensor<2>],
        at: &Step<Self>,
    ) -> Forward;

    /// Updates the method's tensors; their paths begin with `method.`. The Gaussians have been updated before.
    fn update(
        self,
        _gaussians: &Gaussians,
        _gradients: &mut NamedGradients,
        _adam: &mut Adam,
        _at: &Step<Self>,
    ) -> Self {
        self
    }

    /// What is asked of density control at `step`: of refinements and lowered opacities. The pruning at which the count becomes fixed takes place
    /// in any case.
    fn control(_step: usize, _config: &FitConfig<Self::Config>) -> Control {
        Control::Scheduled
    }

    /// Follows a change of the Gaussians' rows.
    fn follow(self, _rows: &RowMap, _adam: &mut Adam) -> Self {
        self
    }

    /// Removes parameters that the photos do not need; called after every step.
    fn simplify(self, _gaussians: &mut Gaussians, _adam: &mut Adam, _views: &[View], _at: &Step<Self>) -> Self {
        self
    }

    /// The scene at any time, outside autodiff.
    fn scene(&self, gaussians: Gaussians) -> Box<dyn DynamicScene> {
        Box::new(Static::new(gaussians))
    }

    /// The default time at which a scene is shown.
    fn middle(&self) -> f64 {
        0.0
    }

    /// Bytes of the finished scene: every number, as f32, that is needed to draw it at any time.
    fn bytes(&self, gaussians: &Gaussians, _config: &FitConfig<Self::Config>) -> usize {
        4 * gaussians.len() * (11 + 3 * gaussians.sh.dims()[1])
    }

    /// The regions of each held-out view; by default the moving part, as given by the data set.
    fn regions(views: &[View], _config: &FitConfig<Self::Config>) -> Vec<Vec<Region>> {
        views.iter().map(given_regions).collect()
    }

    /// The image with which a held-out photo is compared if that is not the sharp rendering, `[H, W, 3]` from 0 to 1.
    fn formed(&self, _gaussians: &Gaussians, _view: &View, _at: &Step<Self>) -> Option<Tensor<3>> {
        None
    }

    /// Figures beside image quality, over `views`.
    fn figures(&self, _gaussians: &Gaussians, _scene: &Scene, _views: &[View], _at: &Step<Self>) -> Figures {
        Figures::default()
    }

    /// Lines and warnings about the method, shown before the first step.
    fn introduction(&self, _scene: &Scene, _at: &Step<Self>) -> (Vec<String>, Vec<String>) {
        (Vec::new(), Vec::new())
    }

    /// The schedule of the training, for a chart; `None`: nothing changes on the way.
    fn timetable(_scene: &Scene, _at: &Step<Self>) -> Option<Timetable> {
        None
    }

    /// Lines for `gsburn info`: name and value.
    fn described(&self) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// What the method knows of the future of `gaussians`, learned from `views`; `None`: the Gaussians at any time alone.
    fn foresight(
        &self,
        _gaussians: &Gaussians,
        _views: &[View],
        _config: &FitConfig<Self::Config>,
    ) -> Option<Box<dyn Foresight>> {
        None
    }

    /// The method's constants, which a checkpoint must hold: which rows move, a window of time.
    fn frame(&self) -> serde_json::Value {
        serde_json::Value::Null
    }

    /// A module with the structure described by [`frame`](Self::frame), on `device`; the values of its tensors are arbitrary.
    ///
    /// # Errors
    /// A sentence when the frame is damaged.
    fn from_frame(frame: &serde_json::Value, config: &FitConfig<Self::Config>, device: &Device)
    -> Result<Self, String>;

    /// Whether its tensors fit each other and `gaussians` rows, after they were read from a file.
    ///
    /// # Errors
    /// A sentence about the mismatch.
    fn fits(&self, _gaussians: usize) -> Result<(), String> {
        Ok(())
    }

    /// The module for Gaussians that are known at one time alone, such as those of a PLY file.
    ///
    /// # Errors
    /// A sentence if the method cannot do without its learned tensors.
    fn at_rest(_scene: &Scene, at: &Step<Self>, device: &Device) -> Result<Self, String> {
        Self::from_frame(&serde_json::Value::Null, at.config, device)
    }

    /// The last step in which a [`Note`] may come.
    fn last_note(config: &FitConfig<Self::Config>) -> usize {
        config.steps
    }

    /// Bytes that training needs beside those of 3D Gaussian Splatting, by purpose.
    fn memory(_scene: &Scene, _config: &FitConfig<Self::Config>) -> Vec<(&'static str, u64)> {
        Vec::new()
    }

    /// Keys of the configuration by which charts distinguish runs.
    fn chart_keys() -> &'static [ChartKey] {
        &[CAP]
    }

    /// Keys that decide how large the model is, each with a few values: what `gsburn sweep --choose smallest` tries by default.
    fn sizes() -> &'static [(&'static str, &'static [&'static str])] {
        &[]
    }
}

/// The moving part of a view, as given by the data set: by the truth, else by the given masks.
pub fn given_regions(view: &View) -> Vec<Region> {
    let moving = view.truth.moving.as_ref().or(view.priors.moving.as_ref());
    moving.map(|mask| Region { name: MOVING, mask: mask.clone() }).into_iter().collect()
}

/// The initial Gaussians of a static scene.
pub fn begin_static(scene: &Scene, config: &Config, facts: &SceneFacts) -> InitialGaussians {
    initial_gaussians(scene, &config.init, config.density.cap, facts.extent, config.seed)
}
