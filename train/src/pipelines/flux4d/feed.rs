//! Snippets in the order of a training, prepared on a thread of their own while the step before computes.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread;

use anyhow::{Result, anyhow};
use rand::seq::SliceRandom;

use super::config::FluxConfig;
use super::logs::{Logs, Place};
use super::prepare::{HostSnippet, prepare};
use crate::fit::random::{Purpose, stream};

/// Snippets that wait for the training at most.
const AHEAD: usize = 2;

/// Snippets in memory at once beside those that a [`Library`] keeps, for steps over `accumulate` snippets: those of a step,
/// those that wait, the one that is being prepared or waits for a place, and the one of a measurement.
pub fn in_flight(accumulate: usize) -> usize {
    accumulate + AHEAD + 2
}

/// A snippet, or the sentence that says why it cannot be used.
pub type Prepared = Result<Arc<HostSnippet>, String>;

/// The snippets of steps to come.
#[derive(Debug)]
pub struct Feed {
    receiver: Receiver<(Place, Prepared)>,
}

impl Feed {
    /// Starts to prepare the snippets of the draws from `first` on.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(logs: Arc<Logs>, config: &FluxConfig, first: usize) -> Result<Self> {
        let (sender, receiver) = sync_channel(AHEAD);
        let config = config.clone();
        let work = move || {
            let mut library = Library::new(logs, &config);
            let mut order = Order::new(library.logs.train.len(), config.seed);
            for draw in first.. {
                let place = library.logs.train[order.at(draw)].clone();
                let prepared = library.get(&place);
                if sender.send((place, prepared)).is_err() {
                    break;
                }
            }
        };
        let started = thread::Builder::new().name("snippets".into()).spawn(work);
        started.map_err(|error| anyhow!("cannot start the thread that reads snippets: {error}"))?;
        Ok(Self { receiver })
    }

    /// The next snippet.
    ///
    /// # Errors
    /// When the thread that reads has ended.
    pub fn next(&self) -> Result<(Place, Prepared)> {
        self.receiver.recv().map_err(|_| anyhow!("the thread that reads snippets has ended"))
    }
}

/// Which snippet a draw takes: each once an epoch, in an order of the epoch's own.
#[derive(Debug)]
struct Order {
    seed: u64,
    epoch: Option<usize>,
    order: Vec<usize>,
}

impl Order {
    fn new(count: usize, seed: u64) -> Self {
        Self { seed, epoch: None, order: (0..count).collect() }
    }

    fn at(&mut self, draw: usize) -> usize {
        let count = self.order.len();
        let epoch = draw / count;
        if self.epoch != Some(epoch) {
            self.order = (0..count).collect();
            self.order.shuffle(&mut stream(self.seed, Purpose::Snippets, epoch as u64));
            self.epoch = Some(epoch);
        }
        self.order[draw % count]
    }
}

/// Prepared snippets under a bound of bytes; the first to come stay.
#[derive(Debug)]
pub struct Library {
    logs: Arc<Logs>,
    config: FluxConfig,
    kept: BTreeMap<(usize, usize), Arc<HostSnippet>>,
    room: usize,
}

impl Library {
    /// Nothing is read yet.
    pub fn new(logs: Arc<Logs>, config: &FluxConfig) -> Self {
        let room = config.own.logs.cache_mb << 20;
        Self { logs, config: config.clone(), kept: BTreeMap::new(), room }
    }

    /// A snippet.
    ///
    /// # Errors
    /// Why it cannot be used.
    pub fn get(&mut self, place: &Place) -> Prepared {
        let key = (place.log, place.snippet.frames[0]);
        if let Some(kept) = self.kept.get(&key) {
            return Ok(kept.clone());
        }
        let log = &self.logs.logs[place.log];
        let name = self.logs.name(place);
        let made = prepare(log, &place.snippet, &name, &self.config.own.lift, self.config.seed);
        let made = Arc::new(made.map_err(|error| format!("{error:#}"))?);
        if made.bytes() <= self.room {
            self.room -= made.bytes();
            self.kept.insert(key, made.clone());
        }
        Ok(made)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_epoch_has_each_snippet_once() {
        let mut order = Order::new(7, 3);
        let first: Vec<usize> = (0..7).map(|draw| order.at(draw)).collect();
        let second: Vec<usize> = (7..14).map(|draw| order.at(draw)).collect();
        let sorted = |mut draws: Vec<usize>| {
            draws.sort_unstable();
            draws
        };
        assert_eq!(sorted(first.clone()), sorted(second.clone()));
        assert_ne!(first, second);
        // A resumed training draws the same.
        assert_eq!(Order::new(7, 3).at(9), second[2]);
    }
}
