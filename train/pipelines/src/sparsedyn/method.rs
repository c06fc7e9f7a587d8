//! [`Sparsedyn`] as a [`Method`]: each function in one line, from the file of its topic.

use std::path::Path;

use burn::tensor::{Device, Tensor};
use gs_burn::adam::Adam;
use gs_burn::{Gaussians, NamedGradients, RowMap};
use gs_datasets::{LoadOptions, PriorUse, Scene, View};
use gs_models::DynamicScene;

use super::config::Sections;
use super::model::Frame;
use super::order::Progressive;
use super::scene::RolledScene;
use super::{Config, Cues, PhotoCues, Sparsedyn, Step, begin, config, count, cues, discover, figures, timetable};
use gs_train::config::FitConfig;
use gs_train::fit::density::Control;
use gs_train::fit::facts::Unseen;
use gs_train::fit::figure::Figures;
use gs_train::fit::initialise::{InitialGaussians, NEAR_STATIC_CAMERAS};
use gs_train::fit::intake::Intake;
use gs_train::fit::method::{Forward, Method};
use gs_train::fit::photos::Photo;
use gs_train::fit::sampler::ViewOrder;
use gs_train::fit::saved::Saved;
use gs_train::fit::told::{CAP, ChartKey, Introduction, Told};

impl Method for Sparsedyn {
    const NAME: &'static str = super::NAME;
    type Config = Sections;
    type Cues = Cues;
    type Extra = PhotoCues;

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

    fn means_restart(&self, step: usize, config: &Config) -> usize {
        if self.bodies.is_some() { count::means_restart(step, config) } else { 0 }
    }

    fn follow(self, rows: &RowMap, _adam: &mut Adam) -> Self {
        self.followed(rows)
    }

    fn after_step(self, gaussians: &mut Gaussians, adam: &mut Adam, views: &[View], at: &Step) -> Self {
        discover::evolved(self, gaussians, adam, views, at)
    }

    fn scene(&self, gaussians: Gaussians) -> Box<dyn DynamicScene> {
        Box::new(RolledScene { gaussians, method: self.clone() })
    }
}

impl Intake for Sparsedyn {
    const UNSEEN: Unseen = Unseen::MeanColor;

    fn defaults() -> FitConfig<Sections> {
        config::defaults()
    }

    fn loading(_config: &Config, options: &mut LoadOptions) {
        options.priors = PriorUse { sharp: false, ..options.priors };
        options.predicts = true;
    }

    fn prepare(dataset: &Path, scene: &mut Scene, config: &Config) -> Result<(), String> {
        let before = scene.train.len();
        scene.train.retain(|view| view.time.is_some());
        let left_out = before - scene.train.len();
        if left_out > 0 && !scene.train.is_empty() {
            scene.warnings.extend(Self::leaves_out(left_out));
        }
        cues::reaches(dataset, scene, config)
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

    fn near_share(scene: &Scene, _config: &Config) -> Option<f64> {
        begin::is_photos_alone(scene).then_some(NEAR_STATIC_CAMERAS)
    }

    fn cues(scene: &Scene, config: &Config) -> Cues {
        Cues::of(scene, config)
    }
}

impl Saved for Sparsedyn {
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

    fn bytes(&self, gaussians: &Gaussians, config: &Config) -> usize {
        figures::bytes(self, gaussians, config)
    }
}

impl Told for Sparsedyn {
    fn middle(&self) -> f64 {
        self.frame.clock.outer(self.frame.start)
    }

    fn figures(&self, gaussians: &Gaussians, scene: &Scene, views: &[View], at: &Step) -> Figures {
        figures::figures(self, gaussians, scene, views, at)
    }

    fn introduction(&self, scene: &Scene, at: &Step) -> Introduction {
        let cues = at.cues;
        let lines = timetable::lines(&self.frame, at);
        let single = (cues.times.len() < 2).then(|| "all photos have one time: no motion can be learned".to_string());
        let alone = cues.by_frame.first().is_some_and(|views| views.len() < 2).then(|| {
            "the first frame has 1 photo, expected 2 or more: without a depth prior nothing says how far away anything is".to_string()
        });
        let warnings = single.into_iter().chain(alone).collect();
        Introduction { lines, warnings, schedule: Some(timetable::curves(scene, at)) }
    }

    fn described(&self) -> Vec<(&'static str, String)> {
        let [first, last] = self.frame.span.map(|time| self.frame.clock.outer(time));
        let mut lines = vec![("moving", self.frame.rows.len().to_string()), ("seen", format!("{first} to {last}"))];
        lines.extend(self.body_lines().into_iter().map(|line| ("body", line)));
        lines
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
}
