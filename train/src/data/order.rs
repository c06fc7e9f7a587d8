//! Which view comes next.

use gs_datasets::View;
use rand::Rng;
use rand::seq::SliceRandom;

use crate::experiment::Config;
use crate::random::{Purpose, stream};

/// Which view each step of a run uses.
#[derive(Debug, Clone)]
pub struct Order {
    opening: Option<Curriculum>,
    sampler: Sampler,
}

impl Order {
    /// The order that `config` asks for over `views`; a recording whose paths are expanded at `middle` is opened from there.
    pub fn new(views: &[View], middle: Option<f64>, config: &Config) -> Self {
        let steps = (config.motion.curriculum * config.steps as f64) as usize;
        Self {
            opening: middle.and_then(|middle| Curriculum::new(views, middle, steps, config.seed)),
            sampler: Sampler::new(config.seed, views.len()),
        }
    }

    /// The index of the view of `step` (from 1).
    pub fn pick(&mut self, step: usize) -> usize {
        self.opening.as_ref().and_then(|opening| opening.pick(step)).unwrap_or_else(|| self.sampler.pick(step))
    }
}

/// Which view each step uses: every view once an epoch, in an order drawn from the seed. Step `s` has the same view
/// whether the run was interrupted or not.
#[derive(Debug, Clone)]
pub struct Sampler {
    seed: u64,
    count: usize,
    epoch: Option<u64>,
    order: Vec<usize>,
}

impl Sampler {
    /// A sampler over `count` views, at least one.
    pub fn new(seed: u64, count: usize) -> Self {
        assert!(count > 0, "a scene without training views is refused when it is loaded");
        Self { seed, count, epoch: None, order: (0..count).collect() }
    }

    /// The index of the view of `step` (from 1).
    pub fn pick(&mut self, step: usize) -> usize {
        let epoch = ((step - 1) / self.count) as u64;
        if self.epoch != Some(epoch) {
            self.order = (0..self.count).collect();
            self.order.shuffle(&mut stream(self.seed, Purpose::Views, epoch));
            self.epoch = Some(epoch);
        }
        self.order[(step - 1) % self.count]
    }
}

/// Which views a step may use while the recording is still being opened, from its middle to its ends.
#[derive(Debug, Clone)]
pub struct Curriculum {
    /// Indices of views by distance of their time from the middle.
    by_distance: Vec<(f64, usize)>,
    steps: usize,
    seed: u64,
}

impl Curriculum {
    /// Opens `views` around `middle` over the first `steps` steps; `None` when there is nothing to open.
    pub fn new(views: &[View], middle: f64, steps: usize, seed: u64) -> Option<Self> {
        let mut by_distance: Vec<(f64, usize)> =
            views.iter().enumerate().map(|(i, view)| ((view.time.unwrap_or(middle) - middle).abs(), i)).collect();
        by_distance.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let farthest = by_distance.last()?.0;
        (farthest > 0.0 && steps > 0).then_some(Self { by_distance, steps, seed })
    }

    /// The view of `step` (from 1); `None` once the whole recording is open. Each is drawn by itself, so that a resumed run
    /// draws the same.
    pub fn pick(&self, step: usize) -> Option<usize> {
        if step > self.steps {
            return None;
        }
        let farthest = self.by_distance.last()?.0;
        let nearest_other = self.by_distance.iter().map(|(distance, _)| *distance).find(|d| *d > 1e-9)?;
        // Never the middle alone: one blurry frame does not tell the direction of its motion.
        let limit = (farthest * step as f64 / self.steps as f64).max(nearest_other * (1.0 + 1e-6));
        let open = self.by_distance.partition_point(|(distance, _)| *distance <= limit);
        let mut rng = stream(self.seed, Purpose::Views, (1 << 40) | step as u64);
        Some(self.by_distance[rng.random_range(0..open)].1)
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    #[test]
    fn an_epoch_holds_every_view_once() {
        let mut sampler = Sampler::new(3, 10);
        let first: Vec<usize> = (1..=10).map(|step| sampler.pick(step)).collect();
        let second: Vec<usize> = (11..=20).map(|step| sampler.pick(step)).collect();
        let sorted = |mut order: Vec<usize>| {
            order.sort_unstable();
            order
        };
        assert_eq!(sorted(first.clone()), (0..10).collect::<Vec<_>>());
        assert_eq!(sorted(second.clone()), (0..10).collect::<Vec<_>>());
        assert_ne!(first, second);
    }

    #[test]
    fn a_curriculum_opens_from_the_middle() {
        let view = |time: f64| View {
            name: String::new(),
            image_path: PathBuf::new(),
            c2w: glam::DMat4::IDENTITY,
            intrinsics: gs_datasets::Intrinsics { fx: 1.0, fy: 1.0, cx: 0.5, cy: 0.5 },
            width: 1,
            height: 1,
            time: Some(time),
            camera_id: None,
            image: gs_datasets::RgbImage8 { width: 1, height: 1, data: vec![0; 3] },
            mask: None,
            exposure: None,
            priors: gs_datasets::Priors::default(),
            truth: gs_datasets::Truth::default(),
        };
        let views: Vec<View> = (0..=10).map(|i| view(f64::from(i) / 10.0)).collect();
        let curriculum = Curriculum::new(&views, 0.5, 100, 1).expect("times differ");
        for step in 1..=100 {
            let distance = views[curriculum.pick(step).expect("open")].time.map_or(0.0, |t| (t - 0.5).abs());
            assert!(distance <= (0.5 * step as f64 / 100.0).max(0.1) + 1e-6, "step {step}: {distance}");
        }
        assert_eq!(curriculum.pick(101), None);
        assert!(Curriculum::new(&views[..1], 0.0, 100, 1).is_none(), "one time has nothing to open");
    }

    #[test]
    fn a_resumed_sampler_continues() {
        let mut whole = Sampler::new(3, 7);
        let order: Vec<usize> = (1..=30).map(|step| whole.pick(step)).collect();
        let mut resumed = Sampler::new(3, 7);
        assert_eq!((17..=30).map(|step| resumed.pick(step)).collect::<Vec<_>>(), order[16..]);
    }
}
