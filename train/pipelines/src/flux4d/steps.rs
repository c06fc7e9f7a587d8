//! Steps one after another on one device, without burn-train.

use std::sync::Arc;

use anyhow::Result;

use super::feed::{Draws, Feed, Library};
use super::observer::Observer;
use super::trainer::Trainer;

/// Takes steps until the training is over; the run observes.
///
/// # Errors
/// When the thread that reads snippets ends, or a measurement fails.
pub fn advance(mut trainer: Trainer, mut observer: Observer) -> Result<(Trainer, Observer)> {
    let (logs, config, device) = (observer.logs.clone(), observer.config.clone(), observer.device.clone());
    let accumulate = config.own.learning.accumulate;
    let library = Arc::new(Library::new(logs.clone(), &config));
    let feed = Feed::start(library, Draws::from(trainer.step * accumulate))?;
    while !observer.is_over(trainer.step) {
        let snippets = (0..accumulate).map(|_| feed.next()).collect::<Result<Vec<_>>>()?;
        let mut reasons = Vec::new();
        let report = observer.run.timed(|| {
            trainer.step(&snippets, (&logs, &config, &device), &mut |reason| reasons.push(reason.to_string()))
        });
        observer.observe(&trainer, report, &reasons)?;
    }
    Ok((trainer, observer))
}
