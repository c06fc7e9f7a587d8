//! [`Sparsedyn`] as a [`Method`]: each function in one line, from the file of its topic.

use std::path::Path;

use burn::tensor::{Device, Tensor};
use gs_burn::adam::Adam;
use gs_burn::{Gaussians, NamedGradients, RowMap};
use gs_datasets::{LoadOptions, PriorUse, Scene, View};
use gs_models::DynamicScene;

use super::config::Sections;
use super::future::RolledFuture;
use super::model::Frame;
use super::order::Progressive;
use super::scene::RolledScene;
use super::{Config, Cues, PhotoCues, Sparsedyn, Step, begin, config, count, cues, discover, figures, timetable};
use gs_train::config::FitConfig;
use gs_train::fit::density::Control;
use gs_train::fit::facts::Unseen;
use gs_train::fit::figure::Figures;
use gs_train::fit::foresight::Foresight;
use gs_train::fit::initialise::{InitialGaussians, NEAR_STATIC_CAMERAS};
use gs_train::fit::method::{CAP, ChartKey, Forward, Method};
use gs_train::fit::photos::Photo;
use gs_train::fit::sampler::ViewOrder;
use gs_train::fit::timetable::Timetable;

impl Method for Sparsedyn {
    const NAME: &'static str = "sparsedyn";
    const UNSEEN: Unseen = Unseen::MeanColor;
    type Config = Sections;
    type Cues = Cues;
    type Extra = PhotoCues;

    fn defaults() -> FitConfig<Sections> {
        config::defaults()
    }

    fn loading(_config: &Config, options: &mut LoadOptions) {
        options.priors = PriorUse { sharp: false, ..options.priors };
        options.predicts = true;
    }

    fn prepare(scene: &mut Scene) {
        let before = scene.train.len();
        scene.train.retain(|view| view.time.is_some());
        let left_out = before - scene.train.len();
        if left_out > 0 && !scene.train.is_empty() {
            scene.warnings.extend(Self::leaves_out(left_out));
        }
    }

    fn leaves_out(without_time: usize) -> Option<String> {
        (without_time > 0).then(|| format!("{without_time} training photos have no time and are left out"))
    }

    fn suits(dataset: &Path, _train: usize, timed: usize) -> Result<(), String> {
        match timed {
            0 => Err(format!(
                "{}: expected a time for each frame, found none; a static scene trains with pipeline = \"static\"",
                dataset.display()
            )),
            1 => Err(format!("{}: expected at least 2 training photos with times, found 1", dataset.display())),
            _ => Ok(()),
        }
    }

    fn reaches(dataset: &Path, scene: &Scene, config: &Config) -> Result<(), String> {
        cues::reaches(dataset, scene, config)
    }

    fn near_share(scene: &Scene, _config: &Config) -> Option<f64> {
        begin::is_photos_alone(scene).then_some(NEAR_STATIC_CAMERAS)
    }

    fn cues(scene: &Scene, config: &Config) -> Cues {
        Cues::of(scene, config)
    }

    fn begin(scene: &Scene, at: &Step, device: &Device) -> (InitialGaussians, Self) {
        begin::begin(scene, at, device)
    }

    fn extra(view: &View, index: usize, at: &Step, device: &Device) -> PhotoCues {
        PhotoCues::new(at.cues, view, index, device)
    }

    fn order(&self, views: &[View], config: &Config) -> Box<dyn ViewOrder> {
        Box::new(Progressive::new(views, config))
    }

    fn forward(&self, gaussians: &Gaussians, photos: &[Photo<PhotoCues>], screens: &[Tensor<2>], at: &Step) -> Forward {
        self.compared(gaussians, photos, screens, at)
    }

    fn update(self, _: &Gaussians, gradients: &mut NamedGradients, adam: &mut Adam, at: &Step) -> Self {
        self.updated(gradients, adam, at)
    }

    fn control(step: usize, config: &Config) -> Control {
        count::control(step, config)
    }

    fn follow(self, rows: &RowMap, _adam: &mut Adam) -> Self {
        self.followed(rows)
    }

    fn simplify(self, gaussians: &mut Gaussians, adam: &mut Adam, views: &[View], at: &Step) -> Self {
        discover::simplified(self, gaussians, adam, views, at)
    }

    fn scene(&self, gaussians: Gaussians) -> Box<dyn DynamicScene> {
        Box::new(RolledScene { gaussians, method: self.clone() })
    }

    fn middle(&self) -> f64 {
        self.frame.clock.outer(self.frame.start)
    }

    fn bytes(&self, gaussians: &Gaussians, config: &Config) -> usize {
        figures::bytes(self, gaussians, config)
    }

    fn figures(&self, gaussians: &Gaussians, scene: &Scene, views: &[View], at: &Step) -> Figures {
        figures::figures(self, gaussians, scene, views, at)
    }

    fn introduction(&self, _scene: &Scene, at: &Step) -> (Vec<String>, Vec<String>) {
        let cues = at.cues;
        let lines = timetable::lines(&self.frame, at);
        let single = (cues.times.len() < 2).then(|| "all photos have one time: no motion can be learned".to_string());
        let alone = cues.by_frame.first().is_some_and(|views| views.len() < 2).then(|| {
            "the first frame has 1 photo, expected 2 or more: without a depth prior nothing says how far away anything is".to_string()
        });
        (lines, single.into_iter().chain(alone).collect())
    }

    fn timetable(scene: &Scene, at: &Step) -> Option<Timetable> {
        Some(timetable::curves(scene, at))
    }

    fn described(&self) -> Vec<(&'static str, String)> {
        let [first, last] = self.frame.span.map(|time| self.frame.clock.outer(time));
        let mut lines = vec![("moving", self.frame.rows.len().to_string()), ("seen", format!("{first} to {last}"))];
        lines.extend(self.body_lines().into_iter().map(|line| ("body", line)));
        lines
    }

    fn foresight(&self, gaussians: &Gaussians, views: &[View], config: &Config) -> Option<Box<dyn Foresight>> {
        Some(Box::new(RolledFuture::new(self, gaussians, views, config)))
    }

    fn frame(&self) -> serde_json::Value {
        serde_json::to_value(&self.frame).expect("a frame is JSON")
    }

    fn from_frame(frame: &serde_json::Value, config: &Config, device: &Device) -> Result<Self, String> {
        let frame: Frame = serde_json::from_value(frame.clone()).map_err(|error| error.to_string())?;
        frame.check()?;
        Ok(Self::new(frame, &config.method.dynamics, config.seed, device))
    }

    fn fits(&self, gaussians: usize) -> Result<(), String> {
        match self.frame.rows.last() {
            Some(row) if *row as usize >= gaussians => Err("the dynamics do not fit the Gaussians".into()),
            _ => Ok(()),
        }
    }

    fn at_rest(_scene: &Scene, at: &Step, device: &Device) -> Result<Self, String> {
        Ok(begin::at_rest(at.config, device))
    }

    fn chart_keys() -> &'static [ChartKey] {
        const KEYS: [ChartKey; 6] = [
            ChartKey {
                name: "bodies",
                key: "bodies.mode",
                words: &[("field", "field alone"), ("bodies", "bodies alone")],
                unless: None,
            },
            ChartKey { name: "asked", key: "dynamics.ask", words: &[], unless: None },
            ChartKey { name: "step", key: "dynamics.step_frames", words: &[], unless: None },
            ChartKey { name: "", key: "dynamics.integrator", words: &[("*", "")], unless: None },
            ChartKey { name: "width", key: "dynamics.width", words: &[], unless: None },
            CAP,
        ];
        &KEYS
    }

    fn sizes() -> &'static [(&'static str, &'static [&'static str])] {
        // Eight runs: half the width, a third of the bands and a count that few objects exceed, each with and without.
        &[("dynamics.width", &["32", "64"]), ("dynamics.bands", &["1", "3"]), ("density.cap", &["1500", "20000"])]
    }
}
