//! The draws of each device, as burn-train's loaders.

use std::sync::Arc;

use burn::data::dataloader::{DataLoader, DataLoaderIterator, Progress};
use burn::data::dataset::DatasetError;
use burn::tensor::Device;

use super::super::feed::{Drawn, Draws, Feed, Library};

/// The snippets of the steps to come, or those of one device.
#[derive(Debug, Clone)]
pub struct Snippets {
    library: Arc<Library>,
    draws: Draws,
    count: usize,
    devices: usize,
}

impl Snippets {
    /// `count` draws after the first `taken`, for some devices.
    pub fn new(library: Arc<Library>, taken: usize, count: usize, devices: usize) -> Self {
        Self { library, draws: Draws::from(taken), count, devices }
    }
}

impl DataLoader<Drawn> for Snippets {
    fn iter<'a>(&'a self) -> Box<dyn DataLoaderIterator<Drawn> + 'a> {
        let feed = Feed::start(self.library.clone(), self.draws);
        Box::new(Iter { feed: feed.map_err(|error| error.to_string()), taken: 0, count: self.count })
    }

    fn num_items(&self) -> usize {
        self.count
    }

    fn to_device(&self, _: &Device) -> Arc<dyn DataLoader<Drawn>> {
        // A snippet is on the host until its step.
        Arc::new(self.clone())
    }

    /// The share of one device. Burn cuts contiguous shares of equal length; device `k` of `n` gets the draws `k`, `k + n`, ...
    /// instead, so that the devices share the snippets of each step and not those of the whole run.
    fn slice(&self, start: usize, end: usize) -> Arc<dyn DataLoader<Drawn>> {
        let share = self.count / self.devices;
        let draws = Draws { first: self.draws.first + start / share, every: self.devices };
        Arc::new(Self { library: self.library.clone(), draws, count: end - start, devices: 1 })
    }
}

struct Iter {
    feed: Result<Feed, String>,
    taken: usize,
    count: usize,
}

impl Iterator for Iter {
    type Item = Result<Drawn, DatasetError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.taken == self.count {
            return None;
        }
        self.taken += 1;
        let drawn = self.feed.as_ref().map_err(Clone::clone);
        let drawn = drawn.and_then(|feed| feed.next().map_err(|error| error.to_string()));
        Some(drawn.map_err(|error| DatasetError::new(std::io::Error::other(error))))
    }
}

impl DataLoaderIterator<Drawn> for Iter {
    fn progress(&self) -> Progress {
        Progress::new(self.taken, self.count, None)
    }
}

/// No items: the run measures held-out snippets itself.
#[derive(Debug, Clone, Copy)]
pub struct Nothing;

impl DataLoader<()> for Nothing {
    fn iter<'a>(&'a self) -> Box<dyn DataLoaderIterator<()> + 'a> {
        Box::new(Self)
    }

    fn num_items(&self) -> usize {
        0
    }

    fn to_device(&self, _: &Device) -> Arc<dyn DataLoader<()>> {
        Arc::new(Self)
    }

    fn slice(&self, _: usize, _: usize) -> Arc<dyn DataLoader<()>> {
        Arc::new(Self)
    }
}

impl Iterator for Nothing {
    type Item = Result<(), DatasetError>;

    fn next(&mut self) -> Option<Self::Item> {
        None
    }
}

impl DataLoaderIterator<()> for Nothing {
    fn progress(&self) -> Progress {
        Progress::new(0, 0, None)
    }
}
