//! Snippets in the order of a training, prepared on threads of their own while the step before computes.
//!
//! Burn's loader is left aside: its threads queue a hundred items whatever their size, which are gigabytes of snippets,
//! and it begins with the first item of an epoch, where a resumed training goes on in the middle of one.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use anyhow::{Result, anyhow};

use super::config::FluxConfig;
use super::logs::{Logs, Place};
use super::prepare::{HostSnippet, prepare};
use super::recolour::recoloured;
use gs_train::fit::random::Purpose;
use gs_train::fit::sampler::Sampler;
use gs_train::sentence::one_sentence;

/// Snippets that wait for the training at most, for each thread.
const AHEAD: usize = 2;

/// Snippets in memory at once beside those that a [`SnippetCache`] keeps, for steps over `accumulate` snippets that
/// some threads prepare: those of a step, for each thread those that wait and the one that is being prepared or waits
/// for a place, and the one of a measurement.
pub fn in_flight(accumulate: usize, threads: usize) -> usize {
    accumulate + threads * (AHEAD + 1) + 1
}

/// A snippet, or the sentence that says why it cannot be used.
pub type Prepared = Result<Arc<HostSnippet>, String>;

/// A draw of the training with its snippet.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// Number of the draw since the first step, from 0. Every random choice about it depends on the seed and this
    /// number alone.
    pub draw: usize,
    /// The snippet.
    pub place: Place,
    /// Its contents.
    pub prepared: Prepared,
}

/// The snippets of steps to come.
#[derive(Debug)]
pub struct Feed {
    /// One for each thread; they are read in turn.
    receivers: Vec<Receiver<Drawn>>,
    next: usize,
}

impl Feed {
    /// Starts to prepare the snippets of the draws from `first` on, with some threads.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(cache: &Arc<SnippetCache>, first: usize, threads: usize) -> Result<Self> {
        let receivers = (0..threads).map(|thread| prepared_draws(cache.clone(), first + thread, threads));
        Ok(Self { receivers: receivers.collect::<Result<_>>()?, next: 0 })
    }

    /// The next snippet.
    ///
    /// # Errors
    /// When a thread that reads has ended.
    pub fn take(&mut self) -> Result<Drawn> {
        let receiver = &self.receivers[self.next];
        self.next = (self.next + 1) % self.receivers.len();
        receiver.recv().map_err(|_| anyhow!("the thread that reads snippets has ended"))
    }
}

/// The snippets of the draws `first`, `first + every`, ..., prepared on a thread.
fn prepared_draws(cache: Arc<SnippetCache>, first: usize, every: usize) -> Result<Receiver<Drawn>> {
    let (sender, receiver) = sync_channel(AHEAD);
    let work = move || {
        let places = &cache.logs.train;
        let mut order = Sampler::new(Purpose::Snippets, cache.config.seed, places.len());
        for draw in (first..).step_by(every) {
            let place = places[order.pick(draw + 1)].clone();
            let prepared = cache.drawn(&place, draw);
            if sender.send(Drawn { draw, place, prepared }).is_err() {
                break;
            }
        }
    };
    let started = thread::Builder::new().name("snippets".into()).spawn(work);
    started.map_err(|error| anyhow!("cannot start the thread that reads snippets: {error}"))?;
    Ok(receiver)
}

/// Prepared snippets under a bound of bytes; the first to come stay.
#[derive(Debug)]
pub struct SnippetCache {
    logs: Arc<Logs>,
    config: FluxConfig,
    kept: Mutex<Kept>,
}

#[derive(Debug)]
struct Kept {
    /// By log and first frame.
    snippets: BTreeMap<(usize, usize), Arc<HostSnippet>>,
    /// Bytes that are left.
    room: usize,
}

impl SnippetCache {
    /// Nothing is read yet.
    pub fn new(logs: Arc<Logs>, config: &FluxConfig) -> Self {
        let kept = Mutex::new(Kept { snippets: BTreeMap::new(), room: config.own.logs.cache_mb << 20 });
        Self { logs, config: config.clone(), kept }
    }

    /// A snippet in the colours of draw `draw`.
    fn drawn(&self, place: &Place, draw: usize) -> Prepared {
        let host = self.get(place)?;
        let strength = self.config.own.learning.recolour;
        Ok(if strength > 0.0 { Arc::new(recoloured(&host, strength, self.config.seed, draw)) } else { host })
    }

    fn get(&self, place: &Place) -> Prepared {
        let key = (place.log, place.snippet.frames[0]);
        let kept = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = kept().snippets.get(&key) {
            return Ok(found.clone());
        }
        // Outside the lock: a snippet takes seconds, and another thread may prepare another one.
        let made = Arc::new(prepared(&self.logs, place, &self.config)?);
        let mut kept = kept();
        if made.bytes() <= kept.room && !kept.snippets.contains_key(&key) {
            kept.room -= made.bytes();
            kept.snippets.insert(key, made.clone());
        }
        Ok(made)
    }
}

/// A snippet, read anew.
///
/// # Errors
/// Why it cannot be used.
pub fn prepared(logs: &Logs, place: &Place, config: &FluxConfig) -> Result<HostSnippet, String> {
    let (log, name) = (&logs.logs[place.log], logs.name(place));
    prepare(log, &place.snippet, &name, &config.own.lift, config.seed).map_err(|error| one_sentence(&error))
}
