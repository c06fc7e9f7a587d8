//! What a run says in words: what it begins with, and what its data leave to be desired.

use gs_datasets::Scene;

use super::Run;
use crate::experiment::Pipeline;
use crate::step::StepReport;
use crate::taylormode::hints::{self, Found};

/// Share of steps whose depth prior fits nothing from which on the user hears of it: the first renderings of a scene are hardly any.
const MISFITS_NOTED: f64 = 0.1;

impl Run<'_> {
    /// Says what is about to happen.
    pub(super) fn introduce(&self, scene: &Scene) {
        let config = &self.request.config;
        let size = scene.train.first().map_or((0, 0), |view| (view.width, view.height));
        self.progress.say(&format!(
            "{} ({}): {} training and {} held-out views of {} x {} pixels, {} Gaussians to begin with, at most {}",
            self.request.dataset.display(),
            scene.format,
            scene.train.len(),
            scene.test.len(),
            size.0,
            size.1,
            self.trainer.parameters.len(),
            config.density.cap
        ));
        self.progress.say(&format!(
            "device {}; run folder {}; memory expected: {}",
            self.request.device_name,
            self.request.folder.path().display(),
            self.prediction
        ));
        if config.pipeline == Pipeline::Static && scene.time_range.is_some_and(|(low, high)| low < high) {
            self.progress.say(
                "warning: the photos have times, but this recipe takes the scene to stand still; for what moves: \
                 --config configs/taylormode/base.toml",
            );
        }
        if self.trainer.step > 0 {
            self.progress.say(&format!("resuming after step {}", self.trainer.step));
        }
    }

    /// Says what the photos say about motion.
    pub(super) fn introduce_motion(&self, scene: &Scene, found: &Found) {
        let (exposure, warning) = hints::first_exposure(scene, &self.request.config);
        let moving = self.trainer.motion.as_ref().map_or(0, |state| state.rows.len());
        let path = self.trainer.motion.as_ref().map_or(String::new(), |state| found.path_in_words(state));
        self.progress.say(&format!(
            "{moving} Gaussians may move, by {}; exposure {exposure:.4} to begin with{path}",
            found.origin()
        ));
        let single = match hints::frame_interval(&scene.train) {
            Some(_) => None,
            None => Some("all frames have one time: blur alone does not tell a motion from its reverse".to_string()),
        };
        for warning in found.warnings.iter().chain(&warning).chain(&single) {
            self.progress.say(&format!("warning: {warning}"));
        }
    }

    /// Says once that depth priors fit nothing, when they have been compared for the last time.
    pub(super) fn watch_depth(&mut self, report: &StepReport) {
        self.depth_misfits += usize::from(report.depth_misfit);
        let config = &self.request.config;
        let compared = ((config.prior.until * config.steps as f64) as usize).clamp(1, config.steps);
        if self.trainer.step == compared && self.depth_misfits as f64 > MISFITS_NOTED * compared as f64 {
            self.progress.say(&format!(
                "warning: in {} of {compared} steps the photo's depth prior fitted nothing that was rendered, and the depth term (Eq. 16) \
                 was left out; is it depth, or its inverse (depth_kind)?",
                self.depth_misfits
            ));
        }
    }
}
