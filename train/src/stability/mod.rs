//! Experiments at the edge of the method: where does it fail, and does it fail as little as it should?
//!
//! Each experiment asks one question, measures on small synthetic worlds or by arithmetic alone, draws a figure and holds what
//! it found against a bound that was set before. A bound that is missed is shown as missed, in the figure's title and in the
//! report. Runs go through the same `Trainer` as `gsburn train`, step by step, so that an experiment can reach into the state
//! between steps (turn the velocities round, say).
//!
//! | file | question |
//! |---|---|
//! | [`direction`] | does blur say which way things went? |
//! | [`exposure`] | can exposure and speed be told apart? |
//! | [`absorb`] | does the blur model eat the scene? |
//! | [`samples`] | how many instants does an exposure need? |
//! | [`divergence`] | where does a Taylor path go outside its window? |
//! | [`depth`] | what does a wrong depth prior cost? |
//! | [`masks`] | what do masks cost that are too wide or too narrow? |
//! | [`speed`] | how much motion per exposure can be undone? |
//! | [`thrown`] | does early training throw Gaussians away? |
//! | [`opacity`] | what do opacity resets cost? |

pub mod absorb;
pub mod depth;
pub mod direction;
pub mod divergence;
pub mod exposure;
pub mod findings;
pub mod lab;
pub mod masks;
pub mod opacity;
mod page;
pub mod samples;
pub mod speed;
mod surface;
pub mod thrown;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Result, bail};
use burn::tensor::Device;
use gs_datasets::image_io::write_atomic;

pub use findings::{Criterion, Figure, Findings, Outcome};
pub use lab::Lab;

/// One experiment.
pub struct Experiment {
    /// Its name on the command line and in file names.
    pub name: &'static str,
    /// What it asks.
    pub question: &'static str,
    /// Training steps it takes, quick or not; for the time left.
    pub steps: fn(quick: bool) -> usize,
    /// Runs it.
    pub run: fn(&Lab) -> Result<Findings>,
}

/// All experiments, cheapest kinds first.
pub const EXPERIMENTS: [&Experiment; 10] = [
    &divergence::EXPERIMENT,
    &thrown::EXPERIMENT,
    &samples::EXPERIMENT,
    &direction::EXPERIMENT,
    &exposure::EXPERIMENT,
    &absorb::EXPERIMENT,
    &depth::EXPERIMENT,
    &masks::EXPERIMENT,
    &speed::EXPERIMENT,
    &opacity::EXPERIMENT,
];

/// What to run, and where.
#[derive(Debug, Clone)]
pub struct Request {
    /// Folder for worlds, figures, results.json and stability.html.
    pub out: PathBuf,
    /// Names of the experiments; empty: all.
    pub only: Vec<String>,
    /// Fewer variants and steps: a look, not a measurement.
    pub quick: bool,
    /// Where to compute (without autodiff).
    pub device: Device,
    /// Show nothing on the terminal.
    pub quiet: bool,
}

/// Runs the experiments; after each, its figures, results.json and stability.html are written with all there is so far.
///
/// # Errors
/// One sentence: a name that is none, a full disk, a request to stop.
pub fn run(request: &Request) -> Result<Vec<Outcome>> {
    let chosen = chosen(&request.only)?;
    let total = chosen.iter().map(|experiment| (experiment.steps)(request.quick)).sum();
    let lab = Lab::new(request, total);
    let mut outcomes = Vec::new();
    for experiment in chosen {
        lab.enter(experiment.name);
        let begun = Instant::now();
        let found = (experiment.run)(&lab)?;
        let outcome = Outcome::new(experiment, found, begun.elapsed().as_secs_f64());
        for figure in &outcome.figures {
            write_atomic(&request.out.join(&figure.file), figure.svg.as_bytes())?;
        }
        lab.say(&outcome.line());
        outcomes.push(outcome);
        write(request, &outcomes)?;
    }
    lab.leave();
    Ok(outcomes)
}

/// The experiments named, or all.
fn chosen(only: &[String]) -> Result<Vec<&'static Experiment>> {
    let names = || EXPERIMENTS.map(|experiment| experiment.name).join(", ");
    if let Some(unknown) = only.iter().find(|name| EXPERIMENTS.iter().all(|experiment| experiment.name != **name)) {
        bail!("--only: expected names from {}, found {unknown:?}", names());
    }
    let wanted = |experiment: &&&Experiment| only.is_empty() || only.iter().any(|name| name == experiment.name);
    Ok(EXPERIMENTS.iter().filter(wanted).copied().collect())
}

fn write(request: &Request, outcomes: &[Outcome]) -> Result<()> {
    let json = serde_json::to_string_pretty(outcomes).expect("figures are JSON") + "\n";
    write_atomic(&request.out.join("results.json"), json.as_bytes())?;
    Ok(write_atomic(&request.out.join("stability.html"), page::html(outcomes, request.quick).as_bytes())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_checked() {
        assert_eq!(chosen(&[]).expect("all").len(), EXPERIMENTS.len());
        assert_eq!(chosen(&["depth".into()]).expect("one").len(), 1);
        let message = chosen(&["deepth".into()]).map(|_| ()).expect_err("unknown").to_string();
        assert!(message.contains("deepth") && message.contains("divergence"), "{message}");
    }
}
