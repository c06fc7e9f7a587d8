//! The course of a run: first only photos near `t0` are used and bodies move as one, at last all photos and each row.
//!
//! Once its texture is learned at one time, a Gaussian can be tracked to the next; if the whole recording is compared
//! at once, a repetitive texture converges to the wrong repetition.

use gs_datasets::View;
use rand::Rng;

use super::{Config, Step};
use gs_train::fit::random::{Purpose, stream};
use gs_train::fit::sampler::{Sampler, ViewOrder};

/// Share of the run in which the rows of a body follow it. While colours and shapes are still formed, what a single row
/// learns of its path is noise to its texture; a body's path is the mean over its rows. Longer, and an articulated body
/// has learned a texture for the wrong paths: at 0.4 the walker loses 1.1 dB and the monkey gains 0.2.
pub const FOLLOW_UNTIL: f64 = 0.2;

/// Share of the run after which orders are first selected, after the recording is used to its ends
/// (`motion.curriculum`); rows that follow a body are tested from then on.
pub const SELECT_FROM: f64 = 0.5;

/// The share of the recording that photos have opened at a step, 0 to 1; `None` once all of it is open. Orders of paths
/// open with it: with all orders from the start, what the few photos at the middle do not determine carries the paths
/// away elsewhere.
pub fn opening(at: &Step) -> Option<f64> {
    let opened = at.step as f64 / steps_of(at.config).max(1) as f64;
    (opened <= 1.0).then_some(opened)
}

/// The steps over which photos open.
pub fn steps_of(config: &Config) -> usize {
    (config.method.motion.curriculum * config.steps as f64) as usize
}

/// The order of views of a recording whose paths are expanded at its middle.
#[derive(Debug, Clone)]
pub struct Opening {
    curriculum: Option<Curriculum>,
    sampler: Sampler,
}

impl Opening {
    /// The order of `views` that opens around `middle` over the first `steps` steps, then uses every view once an
    /// epoch.
    pub fn new(views: &[View], middle: f64, steps: usize, seed: u64) -> Self {
        Self {
            curriculum: Curriculum::new(views, middle, steps, seed),
            sampler: Sampler::new(Purpose::Views, seed, views.len()),
        }
    }
}

impl ViewOrder for Opening {
    fn views(&mut self, step: usize) -> Vec<usize> {
        let opened = self.curriculum.as_ref().and_then(|curriculum| curriculum.pick(step));
        vec![opened.unwrap_or_else(|| self.sampler.pick(step))]
    }
}

/// The views that a step may use while the range of times grows from the recording's middle to its ends.
#[derive(Debug, Clone)]
pub struct Curriculum {
    /// Indices of views by distance of their time from the middle.
    by_distance: Vec<(f64, usize)>,
    steps: usize,
    seed: u64,
}

impl Curriculum {
    /// Opens `views` around `middle` over the first `steps` steps; `None` if there is nothing to open.
    pub fn new(views: &[View], middle: f64, steps: usize, seed: u64) -> Option<Self> {
        let mut by_distance: Vec<(f64, usize)> =
            views.iter().enumerate().map(|(i, view)| ((view.time.unwrap_or(middle) - middle).abs(), i)).collect();
        by_distance.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let farthest = by_distance.last()?.0;
        (farthest > 0.0 && steps > 0).then_some(Self { by_distance, steps, seed })
    }

    /// The view of `step` (from 1); `None` once the whole recording is open. Each is drawn independently, so that a
    /// resumed run draws the same.
    pub fn pick(&self, step: usize) -> Option<usize> {
        if step > self.steps {
            return None;
        }
        let farthest = self.by_distance.last()?.0;
        let nearest_other = self.by_distance.iter().map(|(distance, _)| *distance).find(|d| *d > 1e-9)?;
        // The middle is never alone: one blurry frame does not determine the direction of its motion.
        let limit = (farthest * step as f64 / self.steps as f64).max(nearest_other * (1.0 + 1e-6));
        let open = self.by_distance.partition_point(|(distance, _)| *distance <= limit);
        let mut rng = stream(self.seed, Purpose::Views, (1 << 40) | step as u64);
        Some(self.by_distance[rng.random_range(0..open)].1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curriculum_opens_from_the_middle() {
        let view = |time: f64| View { time: Some(time), ..View::blank(1, 1) };
        let views: Vec<View> = (0..=10).map(|i| view(f64::from(i) / 10.0)).collect();
        let curriculum = Curriculum::new(&views, 0.5, 100, 1).expect("times differ");
        for step in 1..=100 {
            let distance = views[curriculum.pick(step).expect("open")].time.map_or(0.0, |t| (t - 0.5).abs());
            assert!(distance <= (0.5 * step as f64 / 100.0).max(0.1) + 1e-6, "step {step}: {distance}");
        }
        assert_eq!(curriculum.pick(101), None);
        assert!(Curriculum::new(&views[..1], 0.0, 100, 1).is_none(), "one time has nothing to open");
    }
}
