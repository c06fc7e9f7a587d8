//! Snippets in the order of a training, prepared on a thread of their own while the step before computes.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use anyhow::{Result, anyhow};
use rand::seq::SliceRandom;

use super::config::FluxConfig;
use super::logs::{Logs, Place};
use super::prepare::{HostSnippet, prepare};
use super::recolour::recoloured;
use gs_train::fit::random::{Purpose, stream};
use gs_train::sentence::one_sentence;

/// Snippets that wait for the training at most.
const AHEAD: usize = 2;

/// Snippets in memory at once beside those that a [`Library`] keeps, for steps over `accumulate` snippets by `feeds` feeds: those
/// of a step, for each feed those that wait and the one that is being prepared or waits for a place, and the one of a measurement.
pub fn in_flight(accumulate: usize, feeds: usize) -> usize {
    accumulate + feeds * (AHEAD + 1) + 1
}

/// A snippet, or the sentence that says why it cannot be used.
pub type Prepared = Result<Arc<HostSnippet>, String>;

/// A draw of the training with its snippet.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// Number of the draw since the first step, from 0. Every random choice about it depends on the seed and this number alone.
    pub draw: usize,
    /// The snippet.
    pub place: Place,
    /// Its contents.
    pub prepared: Prepared,
}

/// Draws in equal distances: all of them, or those of one device among several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Draws {
    /// The first.
    pub first: usize,
    /// Distance of neighbours.
    pub every: usize,
}

impl Draws {
    /// All draws from `first` on.
    pub fn from(first: usize) -> Self {
        Self { first, every: 1 }
    }
}

/// The snippets of steps to come.
#[derive(Debug)]
pub struct Feed {
    receiver: Receiver<Drawn>,
}

impl Feed {
    /// Starts to prepare the snippets of `draws`.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(library: Arc<Library>, draws: Draws) -> Result<Self> {
        let (sender, receiver) = sync_channel(AHEAD);
        let work = move || {
            let places = &library.logs.train;
            let mut order = Order::new(places.len(), library.config.seed);
            for draw in (draws.first..).step_by(draws.every) {
                let place = places[order.at(draw)].clone();
                let prepared = library.drawn(&place, draw);
                if sender.send(Drawn { draw, place, prepared }).is_err() {
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
    pub fn next(&self) -> Result<Drawn> {
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

/// Prepared snippets under a bound of bytes; the first to come stay. Several feeds may share one.
#[derive(Debug)]
pub struct Library {
    logs: Arc<Logs>,
    config: FluxConfig,
    shelf: Mutex<Shelf>,
}

#[derive(Debug)]
struct Shelf {
    kept: BTreeMap<(usize, usize), Arc<HostSnippet>>,
    room: usize,
}

impl Library {
    /// Nothing is read yet.
    pub fn new(logs: Arc<Logs>, config: &FluxConfig) -> Self {
        let shelf = Mutex::new(Shelf { kept: BTreeMap::new(), room: config.own.logs.cache_mb << 20 });
        Self { logs, config: config.clone(), shelf }
    }

    /// A snippet in the colours of draw `draw`.
    fn drawn(&self, place: &Place, draw: usize) -> Prepared {
        let host = self.get(place)?;
        let strength = self.config.own.learning.recolour;
        Ok(if strength > 0.0 { Arc::new(recoloured(&host, strength, self.config.seed, draw)) } else { host })
    }

    /// A snippet.
    ///
    /// # Errors
    /// Why it cannot be used.
    pub fn get(&self, place: &Place) -> Prepared {
        let key = (place.log, place.snippet.frames[0]);
        let shelf = || self.shelf.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kept) = shelf().kept.get(&key) {
            return Ok(kept.clone());
        }
        // Outside the lock: a snippet takes seconds, and another feed may prepare another one.
        let log = &self.logs.logs[place.log];
        let name = self.logs.name(place);
        let made = prepare(log, &place.snippet, &name, &self.config.own.lift, self.config.seed);
        let made = Arc::new(made.map_err(|error| one_sentence(&error))?);
        let mut shelf = shelf();
        if made.bytes() <= shelf.room && !shelf.kept.contains_key(&key) {
            shelf.room -= made.bytes();
            shelf.kept.insert(key, made.clone());
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
