//! [`Method`]: what a paper adds to fitting Gaussians to the photos of one scene.
//!
//! Plain 3D Gaussian Splatting is the method with nothing in it. A method is a Burn module (the tensors it learns beside the Gaussians)
//! and says how its step differs: which views, which image is compared with a photo, how its tensors are updated. Everything else (the
//! loop, density control, checkpoints, evaluation, reports) is written once, in terms of this trait.

use std::fmt::Debug;
use std::path::Path;

use burn::module::{Module, ModuleDisplay};
use burn::tensor::{Device, Tensor};
use gs_burn::adam::Adam;
use gs_burn::{Gaussians, NamedGradients, RowMap};
use gs_datasets::{LoadOptions, Scene, View};
use gs_models::{DynamicScene, Static};

use super::facts::SceneFacts;
use super::figure::Figures;
use super::initialise::{InitialGaussians, initial_gaussians};
use super::photos::{Extra, Photo};
use super::sampler::{Sampler, ViewOrder};
use crate::config::{Config, FitConfig, Section};

/// One step, or one measurement, and everything it may look at.
pub struct Step<'a, M: Method> {
    /// The step under way, from 1; after training, the last one.
    pub step: usize,
    /// The configuration.
    pub config: &'a FitConfig<M::Config>,
    /// What the data set settles.
    pub facts: &'a SceneFacts,
    /// What the method found in the data set.
    pub cues: &'a M::Cues,
}

impl<M: Method> Clone for Step<'_, M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M: Method> Copy for Step<'_, M> {}

impl<M: Method> Step<'_, M> {
    /// Share of the run done before this step, 0 to 1.
    pub fn progress(&self) -> f64 {
        (self.step.max(1) - 1) as f64 / self.config.steps as f64
    }
}

/// The images of a step's photos and their loss.
pub struct Forward {
    /// One image per photo, as it is compared with it, `[H, W, 3]`.
    pub images: Vec<Tensor<3>>,
    /// All terms but the shared regularisers, `[1]`.
    pub loss: Tensor<1>,
    /// One per photo.
    pub drawn: Vec<Drawn>,
    /// What went other than asked, to be counted and said.
    pub notes: Vec<Note>,
}

/// A rendering as density control sees it.
pub struct Drawn {
    /// Bounding radius of each Gaussian in the image, `[N]`, pixels; 0 when it was not seen.
    pub radii: Tensor<1>,
    /// Tile intersections.
    pub intersections: usize,
}

/// Something in a step that went other than the configuration asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Note {
    /// A sentence, said once when the note came in more than `often` of the steps; `{count}` and `{steps}` stand for numbers.
    pub sentence: &'static str,
    /// Least share of the steps in per cent.
    pub often_percent: u32,
}

/// Part of a held-out view that is scored on its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Region {
    /// Its name, such as "moving".
    pub name: &'static str,
    /// `[height, width]`: 255 inside.
    pub mask: Vec<u8>,
}

/// The name of the region in which something moves.
pub const MOVING: &str = "moving";

/// With which image a held-out photo was compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compared {
    /// The sharp rendering.
    Sharp,
    /// The blur that the scene forms over the photo's exposure.
    FormedBlur,
}

/// A key of the configuration that charts tell runs apart by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChartKey {
    /// Name in charts.
    pub name: &'static str,
    /// Key of the configuration.
    pub key: &'static str,
    /// Words that stand for name and value: `("none", "no blur model")`; `("*", "")` lets every other value stand alone.
    pub words: &'static [(&'static str, &'static str)],
    /// The key means nothing where another key has this value: `("blur.mode", "none")`.
    pub unless: Option<(&'static str, &'static str)>,
}

impl ChartKey {
    /// The key with a value, as a chart says them: `no blur model`, `N 7`, `cap 20k`.
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

/// The key that every chart of runs looks at.
pub const CAP: ChartKey = ChartKey { name: "cap", key: "density.cap", words: &[], unless: None };

/// What a paper adds to fitting Gaussians to the photos of one scene.
///
/// A type that implements it is a Burn module: its `Param`s are learned, saved under their paths and checked for NaN without a further
/// line. `docs/extend.md` walks through an implementation.
pub trait Method: Module + ModuleDisplay + Debug + Send + 'static {
    /// Its name: `pipeline = "..."`.
    const NAME: &'static str;
    /// Sections that it adds to the configuration.
    type Config: Section;
    /// What it finds in the data set once, before the first step; never saved, never written into the data set.
    type Cues: Debug + Send + Sync;
    /// What it adds to a photo on the device.
    type Extra: Extra;

    /// The configuration that `pipeline = "..."` alone stands for.
    fn defaults() -> FitConfig<Self::Config>;

    /// Changes how the data set is loaded.
    fn loading(_config: &FitConfig<Self::Config>, _options: &mut LoadOptions) {}

    /// Leaves out views that it cannot use, with a warning in `scene.warnings`.
    fn prepare(_scene: &mut Scene) {}

    /// The warning about `without_time` photos that have no time, of a set in which others have one.
    fn leaves_out(_without_time: usize) -> Option<String> {
        None
    }

    /// Whether it can learn from `train` training views, `timed` of which have a time.
    ///
    /// # Errors
    /// A sentence about `dataset`.
    fn suits(_dataset: &Path, _train: usize, _timed: usize) -> Result<(), String> {
        Ok(())
    }

    /// The near plane that it proposes, in distances of the subject; `None`: the renderer's own.
    fn near_share(_scene: &Scene, _config: &FitConfig<Self::Config>) -> Option<f64> {
        None
    }

    /// Looks at the training views, once for a run.
    fn cues(scene: &Scene, config: &FitConfig<Self::Config>) -> Self::Cues;

    /// The state before the first step, on `device` without autodiff.
    fn begin(scene: &Scene, at: &Step<Self>, device: &Device) -> (InitialGaussians, Self);

    /// What it adds to the `index`-th training view.
    fn extra(view: &View, index: usize, at: &Step<Self>, device: &Device) -> Self::Extra;

    /// Which views each step uses.
    fn order(&self, views: &[View], config: &FitConfig<Self::Config>) -> Box<dyn ViewOrder> {
        Box::new(Sampler::new(config.seed, views.len()))
    }

    /// The images of `photos` and their loss. `self` and `gaussians` are leaves of this step's graph; `screens` has one `[N, 4]` per
    /// photo where density control wants the gradient by the 2D means, and is empty otherwise.
    fn forward(
        &self,
        gaussians: &Gaussians,
        photos: &[Photo<Self::Extra>],
        screens: &[Tensor<2>],
        at: &Step<Self>,
    ) -> Forward;

    /// Updates its own tensors; their paths begin with `method.`. The Gaussians are updated already.
    fn update(
        self,
        _gaussians: &Gaussians,
        _gradients: &mut NamedGradients,
        _adam: &mut Adam,
        _at: &Step<Self>,
    ) -> Self {
        self
    }

    /// Follows a change of the Gaussians' rows.
    fn follow(self, _rows: &RowMap, _adam: &mut Adam) -> Self {
        self
    }

    /// Leaves out what the photos do not ask for; called after every step.
    fn simplify(self, _gaussians: &mut Gaussians, _adam: &mut Adam, _views: &[View], _at: &Step<Self>) -> Self {
        self
    }

    /// The scene at any time, outside autodiff.
    fn scene(&self, gaussians: Gaussians) -> Box<dyn DynamicScene> {
        Box::new(Static::new(gaussians))
    }

    /// The time that a scene is shown at when none is asked for.
    fn middle(&self) -> f64 {
        0.0
    }

    /// Bytes of the finished scene: every number as f32 that it takes to draw it at any time.
    fn bytes(&self, gaussians: &Gaussians, _config: &FitConfig<Self::Config>) -> usize {
        4 * gaussians.len() * (11 + 3 * gaussians.sh.dims()[1])
    }

    /// The regions of each of some held-out views; by default where the data set says that something moves.
    fn regions(views: &[View], _config: &FitConfig<Self::Config>) -> Vec<Vec<Region>> {
        views.iter().map(given_regions).collect()
    }

    /// The image that a held-out photo is compared with where that is not the sharp rendering, `[H, W, 3]` from 0 to 1.
    fn formed(&self, _gaussians: &Gaussians, _view: &View, _at: &Step<Self>) -> Option<Tensor<3>> {
        None
    }

    /// Figures beside image quality, over `views`.
    fn figures(&self, _gaussians: &Gaussians, _scene: &Scene, _views: &[View], _at: &Step<Self>) -> Figures {
        Figures::default()
    }

    /// What a run says of the method before the first step: lines, and warnings.
    fn introduction(&self, _scene: &Scene, _at: &Step<Self>) -> (Vec<String>, Vec<String>) {
        (Vec::new(), Vec::new())
    }

    /// Lines for `gsburn info`: name and value.
    fn described(&self) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// What it learns nothing of and a checkpoint must hold: which rows move, a window of time.
    fn frame(&self) -> serde_json::Value {
        serde_json::Value::Null
    }

    /// A module of the same structure as the one whose [`frame`](Self::frame) this is, on `device`; the numbers of its tensors do not
    /// matter.
    ///
    /// # Errors
    /// A sentence when the frame is damaged.
    fn from_frame(frame: &serde_json::Value, config: &FitConfig<Self::Config>, device: &Device)
    -> Result<Self, String>;

    /// Whether its tensors fit each other and `gaussians`, after they were read from a file.
    ///
    /// # Errors
    /// A sentence about what does not fit.
    fn fits(&self, _gaussians: usize) -> Result<(), String> {
        Ok(())
    }

    /// The module for Gaussians that are known at one time alone, as a PLY file has them.
    ///
    /// # Errors
    /// A sentence where the method is nothing without what it learns.
    fn at_rest(_scene: &Scene, at: &Step<Self>, device: &Device) -> Result<Self, String> {
        Self::from_frame(&serde_json::Value::Null, at.config, device)
    }

    /// The last step in which a [`Note`] may come.
    fn last_note(config: &FitConfig<Self::Config>) -> usize {
        config.steps
    }

    /// Bytes that training with it needs beside what 3D Gaussian Splatting needs, by what they are for.
    fn memory(_scene: &Scene, _config: &FitConfig<Self::Config>) -> Vec<(&'static str, u64)> {
        Vec::new()
    }

    /// Keys of the configuration that charts tell runs apart by.
    fn chart_keys() -> &'static [ChartKey] {
        &[CAP]
    }
}

/// Where the data set says that something moves: by the truth, else by the given masks.
pub fn given_regions(view: &View) -> Vec<Region> {
    let moving = view.truth.moving.as_ref().or(view.priors.moving.as_ref());
    moving.map(|mask| Region { name: MOVING, mask: mask.clone() }).into_iter().collect()
}

/// The Gaussians that a static scene begins with.
pub fn begin_static(scene: &Scene, config: &Config, facts: &SceneFacts) -> InitialGaussians {
    initial_gaussians(scene, &config.init, config.density.cap, facts.extent, config.seed)
}
