//! [`Method`]: the contribution of a paper to fitting Gaussians to the photos of one scene.
//!
//! Plain 3D Gaussian Splatting is the empty method. A method is a Burn module (the tensors learned beside the
//! Gaussians) and defines how its step differs: the choice of views, the image that is compared with a photo, the
//! update of its tensors. Everything else (the loop, density control, checkpoints, evaluation, reports) is written
//! once, in terms of this trait.

use std::fmt::Debug;

use burn::module::{Module, ModuleDisplay};
use burn::tensor::{Device, Gradients, Tensor};
use gs_burn::adam::Adam;
use gs_burn::ops::intersect::{DeviceCount, Room};
use gs_burn::{Gaussians, NamedGradients, Rendering, RowMap};
use gs_datasets::{PointCloud, Scene, View};
use gs_models::{DynamicScene, Static};

use super::density::Control;
use super::facts::SceneFacts;
use super::initialise::{InitialGaussians, initial_gaussians};
use super::photos::{Extra, Photo};
use super::random::Purpose;
use super::sampler::{Sampler, ViewOrder};
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

/// A part of a backward pass that a method computes itself, after that of the loss: it takes the gradients of its
/// leaves out of the finished pass and adds to those of the model, whose paths begin with `gaussians.` and `method.`.
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
    /// Rows whose last column is the bounding radius of each Gaussian in the image, `[N, C]`, pixels; 0 if it was not
    /// seen. `None` where the step has no `screens`.
    pub radii: Option<Tensor<2>>,
    /// Tile intersections of each rendering.
    pub intersections: Vec<DeviceCount>,
    /// Tiles of each exposure, which are more than the image's.
    pub tiles: Vec<DeviceCount>,
}

impl Drawn {
    /// The quantities of one rendering, made with `screen`.
    pub fn of(rendering: &Rendering, screen: Option<&Tensor<2>>) -> Self {
        Self::of_all(std::slice::from_ref(rendering), screen)
    }

    /// The quantities of the renderings of one exposure, each made with `screen`: of radii the largest.
    pub fn of_all(renderings: &[Rendering], screen: Option<&Tensor<2>>) -> Self {
        let radius = |rendering: &Rendering| {
            let [_, columns] = rendering.projected.dims();
            rendering.projected.clone().narrow(1, columns - 1, 1)
        };
        let radii = screen.and_then(|_| match renderings {
            [rendering] => Some(rendering.projected.clone()),
            _ => renderings.iter().map(radius).reduce(Tensor::max_pair),
        });
        let intersections = renderings.iter().map(|rendering| rendering.intersections.clone()).collect();
        Self { radii, intersections, tiles: Vec::new() }
    }
}

/// A departure of one step from the configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Note {
    /// A sentence, shown once if the note came in more than `often_percent` of the steps; `{count}` and `{steps}` are
    /// replaced by numbers.
    pub sentence: &'static str,
    /// The last step in which the note may come.
    pub last: usize,
    /// Smallest share of the steps for the sentence to be shown, per cent.
    pub often_percent: u32,
}

/// The contribution of a paper to a step: what is learned, and how.
///
/// A type that implements it is a Burn module: its `Param`s are learned, saved under their paths and checked for NaN
/// without further code. [`Intake`](super::intake::Intake) is what it takes from a data set,
/// [`Saved`](super::saved::Saved) what a file holds of it, [`Told`](super::told::Told) what people see.
/// `docs/extend.md` walks through an implementation.
pub trait Method: Module + ModuleDisplay + Debug + Send + 'static {
    /// The method's name, as in `pipeline = "..."`.
    const NAME: &'static str;
    /// The method's sections of the configuration.
    type Config: Section;
    /// Cues inferred once from the data set, before the first step; never saved, never written into the data set. A
    /// measurement of a saved scene has the default, which is none.
    type Cues: Debug + Default + Send + Sync;
    /// Device data of a photo, beside its image.
    type Extra: Extra;

    /// The state before the first step, on `device` without autodiff.
    fn begin(scene: &Scene, at: &Step<Self>, device: &Device) -> (InitialGaussians, Self);

    /// Device data of the `index`-th training view.
    fn extra(view: &View, index: usize, at: &Step<Self>, device: &Device) -> Self::Extra;

    /// The order in which steps use the views.
    fn order(&self, views: &[View], config: &FitConfig<Self::Config>) -> Box<dyn ViewOrder> {
        Box::new(Sampler::new(Purpose::Views, config.seed, views.len()))
    }

    /// The images of `photos` and their loss. `self` and `gaussians` are leaves of this step's graph. `screens` has one
    /// `[N, 4]` per photo if density control needs the gradient with respect to the 2D means, and is empty otherwise.
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

    /// Whether density control may refine at `step`, and lower opacities. The final pruning is not affected.
    fn control(_step: usize, _config: &FitConfig<Self::Config>) -> Control {
        Control::Scheduled
    }

    /// The step after which the learning rate of the means starts anew; 0: it falls once.
    fn means_restart(&self, _step: usize, _config: &FitConfig<Self::Config>) -> usize {
        0
    }

    /// Follows a change of the Gaussians' rows.
    fn follow(self, _rows: &RowMap, _adam: &mut Adam) -> Self {
        self
    }

    /// Changes the model where the photos ask for it, such as removing parameters that they do not need; called after
    /// every step.
    fn after_step(self, _gaussians: &mut Gaussians, _adam: &mut Adam, _views: &[View], _at: &Step<Self>) -> Self {
        self
    }

    /// The scene at any time, outside autodiff.
    fn scene(&self, gaussians: Gaussians) -> Box<dyn DynamicScene> {
        Box::new(Static::new(gaussians))
    }
}

/// The initial Gaussians of a static scene, of which these points are known.
pub fn begin_static(
    views: &[View],
    points: Option<&PointCloud>,
    config: &Config,
    facts: &SceneFacts,
) -> InitialGaussians {
    initial_gaussians(views, points, &config.init, config.density.cap, facts.extent, facts.region, config.seed)
}
