//! [`Taylormode`] as a [`Method`]: each function in one line, from the file of its topic.

use std::path::Path;

use burn::tensor::{Device, Tensor};
use gs_burn::adam::Adam;
use gs_burn::{Gaussians, NamedGradients, RowMap, profile};
use gs_datasets::{Scene, View};
use gs_models::{DynamicScene, Shutter};

use super::config::{BlurMode, Sections};
use super::curriculum::{self, Opening, SELECT_FROM};
use super::model::Frame;
use super::scene::ExposedScene;
use super::{Config, Cues, PhotoPriors, Step, Taylormode, begin, config, cues, figures, likelihood, select};
use gs_train::config::FitConfig;
use gs_train::fit::figure::Figures;
use gs_train::fit::initialise::InitialGaussians;
use gs_train::fit::intake::Intake;
use gs_train::fit::method::{Forward, Method};
use gs_train::fit::photos::Photo;
use gs_train::fit::sampler::ViewOrder;
use gs_train::fit::saved::Saved;
use gs_train::fit::schedule::due;
use gs_train::fit::told::{Blur, CAP, ChartKey, Introduction, Region, Told};
use gs_train::run::memory::{largest_photo, of_rendering, pixels};

/// At most a quarter of the tiles, and of the Gaussians, moved in the scenes tried.
const TILES_PER_MOVING_TILE: u64 = 4;

impl Method for Taylormode {
    const NAME: &'static str = "taylormode";
    type Config = Sections;
    type Cues = Cues;
    type Extra = PhotoPriors;

    fn begin(scene: &Scene, at: &Step, device: &Device) -> (InitialGaussians, Self) {
        begin::begin(scene, at, device)
    }

    fn extra(view: &View, index: usize, at: &Step, device: &Device) -> PhotoPriors {
        PhotoPriors::new(at.cues, index, view, device)
    }

    fn order(&self, views: &[View], config: &Config) -> Box<dyn ViewOrder> {
        Box::new(Opening::new(views, self.motion.window.t0, curriculum::steps_of(config), config.seed))
    }

    fn forward(
        &self,
        gaussians: &Gaussians,
        photos: &[Photo<PhotoPriors>],
        screens: &[Tensor<2>],
        at: &Step,
    ) -> Forward {
        self.formed_and_compared(gaussians, &photos[0], screens.first().cloned(), at)
    }

    fn update(self, gaussians: &Gaussians, gradients: &mut NamedGradients, adam: &mut Adam, at: &Step) -> Self {
        self.updated(gaussians, gradients, adam, at)
    }

    fn follow(self, rows: &RowMap, adam: &mut Adam) -> Self {
        self.followed(rows, adam)
    }

    fn after_step(self, gaussians: &mut Gaussians, adam: &mut Adam, views: &[View], at: &Step) -> Self {
        let (motion, steps) = (&at.config.method.motion, at.config.steps);
        let this = self.tested(gaussians, adam, views.len(), at);
        let begun = at.step as f64 >= SELECT_FROM * steps as f64;
        if !(motion.select && begun && (due(at.step, motion.select_every) || at.step == steps)) {
            return this;
        }
        let _stage = profile::whole_stage("selection of orders");
        let (model, selected) = likelihood::select_with_check(this, gaussians, adam, views, at);
        tracing::debug!(step = at.step, moving = model.motion.len(), ?selected, "motion");
        select::select_bands(gaussians, at.step == steps);
        model
    }

    fn scene(&self, gaussians: Gaussians) -> Box<dyn DynamicScene> {
        Box::new(ExposedScene { scene: self.moving_scene(gaussians), exposure: self.exposure_on_host() })
    }
}

impl Intake for Taylormode {
    fn defaults() -> FitConfig<Sections> {
        config::defaults()
    }

    fn prepare(_dataset: &Path, scene: &mut Scene, _config: &Config) -> Result<(), String> {
        cues::leave_out_timeless(scene);
        Ok(())
    }

    fn leaves_out(without_time: usize) -> Option<String> {
        cues::left_out_warning(without_time)
    }

    fn suits(dataset: &Path, _train: usize, timed: usize) -> Result<(), String> {
        if timed > 0 {
            return Ok(());
        }
        Err(format!(
            "{}: expected a time for each frame, found none; a static scene trains with pipeline = \"static\"",
            dataset.display()
        ))
    }

    fn near_share(scene: &Scene, config: &Config) -> Option<f64> {
        let has_points = scene.points.as_ref().is_some_and(|points| !points.is_empty());
        (!has_points).then_some(config.method.cues.near_share)
    }

    fn cues(scene: &Scene, config: &Config) -> Cues {
        cues::find_cues(scene, config)
    }
}

impl Saved for Taylormode {
    fn frame(&self) -> serde_json::Value {
        serde_json::to_value(self.frame_data()).expect("a frame is JSON")
    }

    fn from_frame(frame: &serde_json::Value, config: &Config, device: &Device) -> Result<Self, String> {
        let frame: Frame = serde_json::from_value(frame.clone()).map_err(|error| error.to_string())?;
        frame.check()?;
        Ok(Self::of_frame(&frame, config.seed, device))
    }

    fn fits(&self, gaussians: usize) -> Result<(), String> {
        self.check_shapes(gaussians)
    }

    fn at_rest(_scene: &Scene, at: &Step, device: &Device) -> Result<Self, String> {
        Ok(Self::at_rest(at, device))
    }

    fn bytes(&self, gaussians: &Gaussians, config: &Config) -> usize {
        figures::cost(self, gaussians, config).summary.bytes
    }
}

impl Told for Taylormode {
    fn middle(&self) -> f64 {
        self.motion.window.t0
    }

    fn figures(&self, gaussians: &Gaussians, scene: &Scene, views: &[View], at: &Step) -> Figures {
        figures::figures(self, gaussians, scene, views, at)
    }

    fn introduction(&self, scene: &Scene, at: &Step) -> Introduction {
        let (exposure, warning) = cues::first_exposure(scene, at.config);
        let line = format!(
            "{} Gaussians may move, by {}; exposure {exposure:.4} to begin with{}",
            self.motion.len(),
            at.cues.describe_masks(),
            at.cues.describe_path(&self.motion)
        );
        let single = match cues::frame_interval(&scene.train) {
            Some(_) => None,
            None => Some("all frames have one time: blur alone does not tell a motion from its reverse".to_string()),
        };
        let warnings = at.cues.warnings.iter().cloned().chain(warning).chain(single).collect();
        Introduction { lines: vec![line], warnings, schedule: None }
    }

    fn described(&self) -> Vec<(&'static str, String)> {
        let [first, last] = self.motion.recording;
        vec![
            ("moving", self.motion.len().to_string()),
            ("recording", format!("{first} to {last}")),
            ("exposure", format!("{:.6}", self.exposure_on_host())),
        ]
    }

    fn chart_keys() -> &'static [ChartKey] {
        const KEYS: [ChartKey; 4] = [
            ChartKey { name: "blur", key: "blur.mode", words: &[("none", "no blur model"), ("*", "")], unless: None },
            ChartKey { name: "N", key: "blur.samples", words: &[], unless: Some(("blur.mode", "none")) },
            ChartKey { name: "order", key: "motion.order", words: &[], unless: None },
            CAP,
        ];
        &KEYS
    }

    fn blur() -> Option<&'static dyn Blur<Self>> {
        Some(&Exposures)
    }
}

/// The measurements over the exposures of photos.
struct Exposures;

impl Blur<Taylormode> for Exposures {
    fn regions(&self, views: &[View]) -> Vec<Vec<Region>> {
        cues::regions(views)
    }

    fn formed(&self, method: &Taylormode, gaussians: &Gaussians, view: &View, at: &Step) -> Option<Tensor<3>> {
        figures::is_blurry(view, at.config).then(|| figures::form_blur(method, gaussians, view, at))
    }

    fn shutter(&self, scene: &dyn DynamicScene, config: &Config) -> Option<Shutter> {
        let blur = &config.method.blur;
        let exposure = scene.exposure().filter(|_| blur.mode != BlurMode::None)?;
        Some(Shutter { exposure, linear: blur.linear })
    }

    fn memory(&self, scene: &Scene, config: &Config) -> Vec<(&'static str, u64)> {
        let masks = scene.train.iter().map(pixels).sum();
        let (cap, motion) = (config.density.cap as u64, &config.method.motion);
        // Values, gradients and two moments, if all that may be there moves; sums, squares and their gradients of the
        // score test.
        let paths = 8 * 4 * 3 * (motion.order_max + motion.rotation_order) as u64 * cap;
        // A measured exposure has more instants than a training step, whose buffers have been released then.
        let instant = of_rendering(cap, largest_photo(scene));
        let exposure = figures::MEASURE_SAMPLES as u64 * instant / TILES_PER_MOVING_TILE;
        vec![("moving masks", masks), ("motion", paths), ("exposure", exposure)]
    }
}
