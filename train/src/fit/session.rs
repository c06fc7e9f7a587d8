//! A fit in progress: the scene, its facts and cues, the photos on the device and the trainer. Every driver (a run, an
//! experiment, the benchmark) takes its steps here.

use burn::tensor::{Device, Tensor};
use gs_datasets::{Scene, View};

use super::coarse::Coarse;
use super::facts::SceneFacts;
use super::intake::Intake;
use super::method::{Method, Step};
use super::photos::{Photo, Photos};
use super::sampler::ViewOrder;
use super::trainer::{StepReport, Trainer};
use crate::config::FitConfig;

/// Steps whose photos are decoded ahead of them where they are not in memory. A 12-megapixel JPEG takes 0.1 to 0.2 s on
/// one thread, several steps of a GPU.
pub const AHEAD: usize = 4;

/// A data set with its facts and cues.
#[derive(Debug)]
pub struct Data<M: Method> {
    /// The scene as it was loaded.
    pub scene: Scene,
    /// Values fixed by the data set.
    pub facts: SceneFacts,
    /// The method's cues.
    pub cues: M::Cues,
    /// The training views at reduced widths, for the first steps.
    pub coarse: Coarse,
}

impl<M: Intake> Data<M> {
    /// Derives facts and cues from `scene`, once.
    pub fn new(scene: Scene, config: &FitConfig<M::Config>) -> Self {
        let facts = SceneFacts::of(&scene, config, M::near_share(&scene, config), M::UNSEEN);
        let cues = M::cues(&scene, config);
        let coarse = Self::coarse_of(&scene, config);
        Self { scene, facts, cues, coarse }
    }

    /// The training views of `scene` at reduced widths, as `config` asks for them.
    pub fn coarse_of(scene: &Scene, config: &FitConfig<M::Config>) -> Coarse {
        let share = if M::ANY_WIDTH { config.data.coarse_share } else { 0.0 };
        Coarse::of(&scene.train, share, config.steps)
    }
}

/// A fit in progress.
pub struct Session<'a, M: Method> {
    /// The data set.
    pub data: &'a Data<M>,
    /// The configuration.
    pub config: &'a FitConfig<M::Config>,
    /// The state.
    pub trainer: Trainer<M>,
    photos: Photos<'a, M::Extra>,
    /// How often the width of `photos` is halved.
    halvings: usize,
    device: Device,
    order: Box<dyn ViewOrder>,
}

/// A step's report, and the photos of the step.
pub struct Stepped<X> {
    /// The report.
    pub report: StepReport,
    /// The photos, one for each image of the report.
    pub photos: Vec<Photo<X>>,
}

impl<'a, M: Method> Session<'a, M> {
    /// Continues from `trainer`, or begins at step 0 without one.
    pub fn begin(
        data: &'a Data<M>,
        config: &'a FitConfig<M::Config>,
        trainer: Option<Trainer<M>>,
        device: &Device,
    ) -> Self {
        let trainer = trainer.unwrap_or_else(|| Trainer::begin(&data.scene, &data.cues, config, data.facts, device));
        let order = trainer.method().order(&data.scene.train, config);
        let halvings = data.coarse.halvings(trainer.step + 1);
        let photos = photos_of(data, config, trainer.facts, halvings, device);
        Self { data, config, trainer, photos, halvings, device: device.clone(), order }
    }

    /// One step.
    pub fn step(&mut self) -> Stepped<M::Extra> {
        let views = self.order.views(self.trainer.step + 1);
        let halvings = self.data.coarse.halvings(self.trainer.step + 1);
        if halvings != self.halvings {
            self.photos = photos_of(self.data, self.config, self.trainer.facts, halvings, &self.device);
            self.halvings = halvings;
        }
        let photos = &mut self.photos;
        let taken: Vec<_> =
            gs_burn::profile::timed("photo upload", || views.iter().map(|index| photos.get(*index)).collect());
        if self.photos.are_on_demand() {
            let next = self.trainer.step + 2;
            (next..next + AHEAD).for_each(|step| self.photos.prefetch(self.order.views(step)));
        }
        let report = self.trainer.step(&taken, &self.data.scene.train, &self.data.cues, self.config);
        Stepped { report, photos: taken }
    }

    /// The current step, with everything that the method may read.
    pub fn at(&self) -> Step<'_, M> {
        self.trainer.at(&self.data.cues, self.config)
    }

    /// The state alone; the photos on the device are let go.
    pub fn into_trainer(self) -> Trainer<M> {
        self.trainer
    }

    /// Training photo `index`, and the image that is compared with it now, `[H, W, 3]`, without going on.
    pub fn formed(&mut self, index: usize) -> (Photo<M::Extra>, Tensor<3>) {
        let photo = self.photos.get(index);
        let mut ahead = self.trainer.clone();
        let report = ahead.step(std::slice::from_ref(&photo), &self.data.scene.train, &self.data.cues, self.config);
        let image = report.images.into_iter().next().expect("one image per photo");
        (photo, image)
    }
}

/// The training photos with their width halved `halvings` times.
fn photos_of<'a, M: Method>(
    data: &'a Data<M>,
    config: &'a FitConfig<M::Config>,
    facts: SceneFacts,
    halvings: usize,
    device: &Device,
) -> Photos<'a, M::Extra> {
    let extra = move |view: &View, index, device: &Device| {
        M::extra(view, index, &Step { step: 0, config, facts: &facts, cues: &data.cues, room: None }, device)
    };
    let views = if halvings == 0 { &data.scene.train[..] } else { data.coarse.views(halvings) };
    Photos::new(views, device, config.data.cache_mb << 20, extra)
        .of_width(f64::from(1 << halvings))
        .within(facts.region)
}
