//! Decoded views of a log, under a bound in bytes: [`LogCache`].

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use crate::error::DatasetError;
use crate::frame::View;
use crate::log::{FrameSource, Log};

/// Keeps the views of a log that were asked for last, and never more than a bound in bytes.
///
/// The bound is on the views that the cache holds, each counted by [`View::bytes`]. Two kinds of views are not in it: a
/// view that the cache has let go of lives on while a caller has its `Arc`, and a view that is being decoded (one a
/// thread) is not yet held. A view larger than the whole bound is decoded and handed out, and not held; a bound of 0
/// holds nothing.
///
/// All methods may be called from several threads. Frames are decoded outside the lock, so that a slow one delays
/// nobody else; two threads that ask for the same frame at once may both decode it, and one of the two views is kept.
#[derive(Debug)]
pub struct LogCache<S = Log> {
    source: S,
    bound: usize,
    held: Mutex<Held>,
}

#[derive(Debug, Default)]
struct Held {
    /// By the frame's index: when it was last asked for, and the view.
    views: HashMap<usize, (u64, Arc<View>)>,
    /// Indices by when they were last asked for.
    order: BTreeMap<u64, usize>,
    /// The sum of [`View::bytes`] over `views`.
    bytes: usize,
    /// The number of requests so far.
    clock: u64,
}

impl<S: FrameSource> LogCache<S> {
    /// Holds nothing yet, and at most `bound` bytes later.
    pub fn new(source: S, bound: usize) -> Self {
        Self { source, bound, held: Mutex::default() }
    }

    /// The log.
    pub fn source(&self) -> &S {
        &self.source
    }

    /// Bytes of the views that are held now; at most the bound.
    pub fn bytes(&self) -> usize {
        self.lock().bytes
    }

    /// The view of the frame at `index`, decoded if it is not held.
    ///
    /// # Errors
    /// As [`FrameSource::decode`]; errors are not held, so the frame is tried again when it is asked for again.
    ///
    /// # Panics
    /// When there is no frame at `index`.
    pub fn get(&self, index: usize) -> Result<Arc<View>, DatasetError> {
        if let Some(view) = self.lock().touch(index) {
            return Ok(view);
        }
        let view = Arc::new(self.source.decode(index)?);
        Ok(self.lock().keep(index, view, self.bound))
    }

    /// Decodes frames that will be asked for, in parallel, as many of the first ones as the bound has room for.
    ///
    /// # Errors
    /// As [`get`](LogCache::get): the error of the first frame in the list that has one. The frames decoded with it are
    /// held.
    ///
    /// # Panics
    /// When there is no frame at an index.
    pub fn prefetch(&self, indices: &[usize]) -> Result<(), DatasetError> {
        let mut room = self.bound;
        // One round a thread: how large views are is known only when they are decoded.
        for round in indices.chunks(rayon::current_num_threads().max(1)) {
            let views: Vec<Result<Arc<View>, DatasetError>> = round.par_iter().map(|index| self.get(*index)).collect();
            for view in views {
                room = room.saturating_sub(view?.bytes());
            }
            if room == 0 {
                break;
            }
        }
        Ok(())
    }

    fn lock(&self) -> MutexGuard<'_, Held> {
        // Nothing below can panic between two of its changes, so a poisoned lock guards a whole state.
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Held {
    /// The view at `index`, if it is held, as the one asked for last.
    fn touch(&mut self, index: usize) -> Option<Arc<View>> {
        self.clock += 1;
        let (last, view) = self.views.get_mut(&index)?;
        self.order.remove(last);
        self.order.insert(self.clock, index);
        *last = self.clock;
        Some(view.clone())
    }

    /// Holds a view if it is within the bound, and lets go of the ones asked for longest ago until there is room for
    /// it. The view that is already held, where another thread was faster.
    fn keep(&mut self, index: usize, view: Arc<View>, bound: usize) -> Arc<View> {
        if let Some(held) = self.touch(index) {
            return held;
        }
        let bytes = view.bytes();
        if bytes > bound {
            return view;
        }
        while self.bytes > bound - bytes {
            let Some((_, oldest)) = self.order.pop_first() else { break };
            self.bytes -= self.views.remove(&oldest).map_or(0, |(_, view)| view.bytes());
        }
        self.bytes += bytes;
        self.order.insert(self.clock, index);
        self.views.insert(index, (self.clock, view.clone()));
        view
    }
}
