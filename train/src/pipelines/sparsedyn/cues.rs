//! What is inferred once from the data set: its frames, the depth priors in scene units, the pixels that change.

use std::collections::BTreeMap;

use gs_datasets::{DepthSpace, Scene, View};
use gs_models::sparsedyn::Curriculum;

use super::Config;
use super::clock::Clock;
use super::evidence::{CameraEvidence, changing_pixels};

/// Times closer than this share of the recording are one frame: cameras that are triggered together differ by rounding.
const ONE_FRAME: f64 = 1e-4;

/// Confidence of a prior at which a pixel counts half. VGGT gives `1 + exp(.)`, so 1 says nothing.
const HALF_CONFIDENCE: f32 = 2.0;

/// The cues of a data set.
#[derive(Debug)]
pub struct Cues {
    /// The unit of time of the dynamics.
    pub clock: Clock,
    /// The time of each frame of the training views, ascending, by the clock; the first is the canonical one.
    pub times: Vec<f64>,
    /// The training views of each frame, by index.
    pub by_frame: Vec<Vec<usize>>,
    /// Median time between frames, by the clock; 1 for a single frame.
    pub interval: f64,
    /// The depth priors of the first frame, by index of the training view.
    pub depths: BTreeMap<usize, DepthPrior>,
    /// The pixels of each static camera at which something changes; empty if a camera moves.
    pub evidence: Vec<CameraEvidence>,
}

/// A depth prior in scene units.
#[derive(Debug, Clone)]
pub struct DepthPrior {
    /// `[H, W]` camera z, scene units; 0 where unknown.
    pub depth: Vec<f32>,
    /// `[H, W]` weight, 0 to 1; 0 where unknown.
    pub weights: Vec<f32>,
}

impl Cues {
    /// The cues of `scene`.
    pub fn of(scene: &Scene, config: &Config) -> Self {
        let (written, by_frame) = frames(&scene.train);
        let clock = Clock::of(&written);
        let times: Vec<f64> = written.into_iter().map(|time| clock.inner(time)).collect();
        let mut gaps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        gaps.sort_by(f64::total_cmp);
        let interval = gaps.get(gaps.len() / 2).copied().unwrap_or(1.0);
        let first = by_frame.first().map(Vec::as_slice).unwrap_or_default();
        let depths = first.iter().filter_map(|index| Some((*index, prior_of(&scene.train[*index])?))).collect();
        let evidence = match config.method.moving.select {
            true => changing_pixels(&scene.train, config.method.moving.change),
            false => Vec::new(),
        };
        Self { clock, times, by_frame, interval, depths, evidence }
    }

    /// The canonical time, by the clock.
    pub fn start(&self) -> f64 {
        self.times.first().copied().unwrap_or(0.0)
    }

    /// The schedule of frames for a run.
    pub fn curriculum(&self, config: &Config) -> Curriculum {
        schedule(self.times.len(), config)
    }
}

/// The schedule for a recording of `frames` frames.
pub fn schedule(frames: usize, config: &Config) -> Curriculum {
    let options = &config.method.curriculum;
    let last_frame = frames.saturating_sub(1);
    let physics = config.steps - warmup_steps(config);
    let growths = last_frame.div_ceil(options.growth.max(1)).max(1);
    let interval = match options.interval {
        0 => (options.short * physics as f64 / growths as f64) as usize,
        steps => steps,
    };
    Curriculum {
        last_frame,
        growth: options.growth,
        interval: interval.max(1),
        late_from: (options.late * last_frame as f64).round() as usize,
        replays: options.replays,
        replay_weight: options.replay_weight,
    }
}

/// Steps in which the first frame alone is fitted.
pub fn warmup_steps(config: &Config) -> usize {
    (config.method.warmup.share * config.steps as f64).round() as usize
}

/// The time of each frame as the data set writes it, ascending, and the views of each by index.
pub fn frames(views: &[View]) -> (Vec<f64>, Vec<Vec<usize>>) {
    let time = |index: usize| views[index].time.unwrap_or(0.0);
    let mut order: Vec<usize> = (0..views.len()).collect();
    order.sort_by(|a, b| time(*a).total_cmp(&time(*b)).then(a.cmp(b)));
    let range = order.first().zip(order.last()).map_or(0.0, |(first, last)| time(*last) - time(*first));
    let (mut times, mut by_frame): (Vec<f64>, Vec<Vec<usize>>) = (Vec::new(), Vec::new());
    for index in order {
        match times.last() {
            Some(last) if time(index) - last <= ONE_FRAME * range => {
                by_frame.last_mut().expect("a list for each time").push(index);
            }
            _ => {
                times.push(time(index));
                by_frame.push(vec![index]);
            }
        }
    }
    (times, by_frame)
}

/// The depth prior of a view in scene units, taken as it is; `None` without one.
fn prior_of(view: &View) -> Option<DepthPrior> {
    let prior = view.priors.depth.as_ref()?;
    let depth: Vec<f32> = prior
        .values
        .iter()
        .map(|value| match (prior.space, value.is_finite() && *value > 0.0) {
            (_, false) => 0.0,
            (DepthSpace::Depth, true) => *value,
            (DepthSpace::InverseDepth, true) => value.recip(),
        })
        .collect();
    let mut weights: Vec<f32> = depth.iter().map(|depth| if *depth > 0.0 { 1.0 } else { 0.0 }).collect();
    if let Some(confidence) = &view.priors.confidence {
        for (weight, confidence) in weights.iter_mut().zip(confidence) {
            let above = (confidence - 1.0).max(0.0);
            *weight *= above / (above + HALF_CONFIDENCE - 1.0);
        }
    }
    weights.iter().any(|weight| *weight > 0.0).then_some(DepthPrior { depth, weights })
}
