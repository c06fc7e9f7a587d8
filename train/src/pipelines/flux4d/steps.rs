//! Steps one after another on one device, without burn-train.

use std::sync::Arc;

use anyhow::Result;

use super::feed::{Draws, Feed, Library};
use super::network::FluxNetwork;
use super::observer::Observer;
use super::trainer::step;
use crate::fit::training::Training;

/// Takes steps until the training is over; the run observes.
///
/// # Errors
/// When the thread that reads snippets ends, or a measurement fails.
pub fn advance(
    mut training: Training<FluxNetwork>,
    mut observer: Observer,
) -> Result<(Training<FluxNetwork>, Observer)> {
    let (logs, config, device) = (observer.logs.clone(), observer.config.clone(), observer.device.clone());
    let accumulate = config.own.learning.accumulate;
    let library = Arc::new(Library::new(logs.clone(), &config));
    let feed = Feed::start(library, Draws::from(training.step * accumulate))?;
    while !observer.is_over(training.step) {
        let snippets = (0..accumulate).map(|_| feed.next()).collect::<Result<Vec<_>>>()?;
        let mut reasons = Vec::new();
        let report = observer.run.timed(|| {
            step(&mut training, &snippets, (&logs, &config, &device), &mut |reason| reasons.push(reason.to_string()))
        });
        observer.observe(&training, report, &reasons)?;
    }
    Ok((training, observer))
}
