//! The order in which steps use the views.

use rand::seq::SliceRandom;

use super::random::{Purpose, stream};

/// The choice of views of each step. It depends on the seed and the step alone, so that a resumed run uses the same
/// views.
pub trait ViewOrder {
    /// Indices of the training views of `step` (from 1), at least one.
    fn views(&mut self, step: usize) -> Vec<usize>;
}

/// One item a step, of views or snippets: every one once an epoch, in an order drawn from the seed.
#[derive(Debug, Clone)]
pub struct Sampler {
    purpose: Purpose,
    seed: u64,
    count: usize,
    epoch: Option<u64>,
    order: Vec<usize>,
}

impl Sampler {
    /// A sampler over `count` items, at least one, by the streams of `purpose`.
    pub fn new(purpose: Purpose, seed: u64, count: usize) -> Self {
        assert!(count > 0, "there is something to draw from");
        Self { purpose, seed, count, epoch: None, order: (0..count).collect() }
    }

    /// The index of the item of `step` (from 1).
    pub fn pick(&mut self, step: usize) -> usize {
        let epoch = ((step - 1) / self.count) as u64;
        if self.epoch != Some(epoch) {
            self.order = (0..self.count).collect();
            self.order.shuffle(&mut stream(self.seed, self.purpose, epoch));
            self.epoch = Some(epoch);
        }
        self.order[(step - 1) % self.count]
    }
}

impl ViewOrder for Sampler {
    fn views(&mut self, step: usize) -> Vec<usize> {
        vec![self.pick(step)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_epoch_holds_every_view_once() {
        let mut sampler = Sampler::new(Purpose::Views, 3, 10);
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
    fn a_resumed_sampler_continues() {
        let mut whole = Sampler::new(Purpose::Views, 3, 7);
        let order: Vec<usize> = (1..=30).map(|step| whole.pick(step)).collect();
        let mut resumed = Sampler::new(Purpose::Views, 3, 7);
        assert_eq!((17..=30).map(|step| resumed.pick(step)).collect::<Vec<_>>(), order[16..]);
    }
}
