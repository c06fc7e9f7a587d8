//! The cues that are inferred once from the data set: its frames, the depth priors in scene units, the pixels that
//! change.

use std::collections::BTreeMap;
use std::path::Path;

use gs_base::median;
use gs_datasets::{DepthSpace, Scene, View};
use gs_models::sparsedyn::Curriculum;
use gs_models::sparsedyn::rollout::STEPS_MAX;
use gs_multiview::foreground_masks;

use super::Config;
use super::clock::Clock;
use super::evidence::{CameraEvidence, changing_pixels};
use super::sources::Source;
use gs_train::config::Strategy;

/// Times closer than this share of the recording are one frame: cameras that are triggered together differ by rounding.
const ONE_FRAME: f64 = 1e-4;

/// Confidence of a prior at which a pixel counts half. VGGT gives `1 + exp(.)`, so 1 says nothing.
const HALF_CONFIDENCE: f32 = 2.0;

/// The cues of a data set.
#[derive(Debug, Default)]
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
    /// For each view of the first frame, by index of the training view, `[H, W]`: 1 inside the outline of what stands
    /// before a plain background, -1 before the background, 0 at the outline itself. Empty without a plain background.
    pub outlines: BTreeMap<usize, Vec<i8>>,
    /// Where the Gaussians of the first frame begin.
    pub source: Source,
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
        let interval = interval(&times);
        let first = by_frame.first().map(Vec::as_slice).unwrap_or_default();
        let depths = depths_of(&scene.train, first);
        let source = Source::of(scene, first, !depths.is_empty());
        let evidence = match config.method.moving.select {
            true => changing_pixels(&scene.train),
            false => Vec::new(),
        };
        let outlines = match config.method.warmup.outline > 0.0 {
            true => outlines_of(&scene.train, first),
            false => BTreeMap::new(),
        };
        Self { clock, times, by_frame, interval, depths, outlines, source, evidence }
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

/// The median time between frames at `times`, ascending; 1 for a single frame.
fn interval(times: &[f64]) -> f64 {
    median(times.windows(2).map(|pair| pair[1] - pair[0]).collect()).unwrap_or(1.0)
}

/// Checks that a rollout from the first frame reaches the time of every photo, of training and held-out views, in fewer
/// than [`STEPS_MAX`] steps.
///
/// # Errors
/// A sentence about `dataset`, with the length of a step that is enough.
pub fn reaches(dataset: &Path, scene: &Scene, config: &Config) -> Result<(), String> {
    let (times, _) = frames(&scene.train);
    let (first, interval) = (times.first().copied().unwrap_or(0.0), interval(&times));
    let held_out = scene.held_out.iter().flat_map(|split| &split.views);
    let away = scene.train.iter().chain(held_out).filter_map(|view| view.time).map(|time| (time - first).abs());
    let (step, needed) = (config.method.dynamics.step_frames, away.fold(0.0, f64::max) / interval / (STEPS_MAX - 1.0));
    match step >= needed {
        true => Ok(()),
        false => Err(format!(
            "dynamics.step_frames: expected at least {needed} for the photos of {}, which {STEPS_MAX} steps must reach, found {step}",
            dataset.display()
        )),
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
        newest: options.newest,
        first: options.first,
        late_from: (options.late * last_frame as f64).round() as usize,
        replays: options.replays,
        replay_weight: options.replay_weight,
    }
}

/// Steps in which the first frame alone is fitted: the share of the run, and where `density.stop` is not above it no
/// fewer than until the count is fixed, which rounding may put one step later.
pub fn warmup_steps(config: &Config) -> usize {
    let (density, share) = (&config.density, config.method.warmup.share);
    let own = (share * config.steps as f64).round() as usize;
    if density.strategy == Strategy::None || density.stop > share {
        return own;
    }
    let fixed = density.first_fixed(config.steps);
    own.max(fixed.min(own + 1)).min(config.steps)
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

/// The outlines of the views at `first`; empty without a plain background.
fn outlines_of(views: &[View], first: &[usize]) -> BTreeMap<usize, Vec<i8>> {
    let chosen: Vec<View> = first.iter().map(|index| views[*index].clone()).collect();
    let masks = foreground_masks(&chosen).unwrap_or_default();
    first.iter().zip(masks).filter_map(|(index, mask)| Some((*index, sides(&mask?, views[*index].width)))).collect()
}

/// 1 where a pixel and its neighbours are marked, -1 where none is, 0 otherwise: pixels at the edge are partly covered.
fn sides(mask: &[u8], width: usize) -> Vec<i8> {
    let height = mask.len() / width.max(1);
    let side = |pixel: usize| {
        let (x, y) = (pixel % width, pixel / width);
        let near = |at: usize, end: usize| at.saturating_sub(1)..=(at + 1).min(end - 1);
        let marked = near(y, height).flat_map(|y| near(x, width).map(move |x| mask[y * width + x] > 0));
        let (count, all) = marked.fold((0, 0), |(count, all), marked| (count + usize::from(marked), all + 1));
        match count {
            0 => -1,
            _ if count == all => 1,
            _ => 0,
        }
    };
    (0..mask.len()).map(side).collect()
}

/// The usable depth priors of the views at `first`.
pub fn depths_of(views: &[View], first: &[usize]) -> BTreeMap<usize, DepthPrior> {
    first.iter().filter_map(|index| Some((*index, prior_of(&views[*index])?))).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_at_the_outline_take_no_side() {
        // A square of 3 x 3 in an image of 7 x 5: its middle is inside, pixels two away from it are outside.
        let mask: Vec<u8> = (0..35)
            .map(|pixel| if (2..5).contains(&(pixel % 7)) && (1..4).contains(&(pixel / 7)) { 255 } else { 0 })
            .collect();
        let sides = sides(&mask, 7);
        assert_eq!(sides[2 * 7 + 3], 1);
        assert_eq!(sides.iter().filter(|side| **side == 1).count(), 1);
        assert!((0..5).all(|y| sides[7 * y] == -1 && sides[7 * y + 6] == -1));
        assert_eq!(sides.iter().filter(|side| **side == -1).count(), 10);
        assert_eq!(super::sides(&[], 0), Vec::<i8>::new());
    }
}
