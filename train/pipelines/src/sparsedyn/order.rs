//! The views of a step: those of the first frame in the warm-up, then those of the curriculum's frames (Eq. 8 to 10).

use gs_models::sparsedyn::Curriculum;
use rand::Rng;

use super::cues::{frames, schedule, warmup_steps};
use super::{Config, Step};
use gs_datasets::View;
use gs_train::fit::random::{Purpose, stream};
use gs_train::fit::sampler::ViewOrder;

/// The order of the views of a recording.
#[derive(Debug, Clone)]
pub struct Progressive {
    by_frame: Vec<Vec<usize>>,
    curriculum: Curriculum,
    warmup: usize,
    seed: u64,
}

impl Progressive {
    /// The order of `views`.
    pub fn new(views: &[View], config: &Config) -> Self {
        let (_, by_frame) = frames(views);
        Self { curriculum: schedule(by_frame.len(), config), by_frame, warmup: warmup_steps(config), seed: config.seed }
    }
}

impl ViewOrder for Progressive {
    fn views(&mut self, step: usize) -> Vec<usize> {
        let mut rng = stream(self.seed, Purpose::Views, step as u64);
        let drawn = match step <= self.warmup {
            true => vec![0],
            false => {
                let n = step - self.warmup;
                self.curriculum.frames(n, |below| rng.random_range(0..below)).iter().map(|one| one.frame).collect()
            }
        };
        let mut view = |frame: usize| {
            let views = &self.by_frame[frame.min(self.by_frame.len() - 1)];
            views[rng.random_range(0..views.len())]
        };
        drawn.into_iter().map(&mut view).collect()
    }
}

/// The weight of the loss of the `index`-th of `count` photos of a step.
pub fn weight(index: usize, count: usize, at: &Step) -> f64 {
    if index == 0 { 1.0 } else { at.config.method.curriculum.replay_weight / (count - 1) as f64 }
}
