//! Experiments at the limits of Flux4D, most by the network that ships.

use super::misses::{QUICK, holds};
use super::{all_hold, quick};
use crate::experiments::Outcome;

/// Experiments with tests of their own.
const OWN: [&str; 3] = ["cost", "bins", "occlusion"];

#[test]
fn small_versions_keep_their_bounds() {
    all_hold("flux4d", &OWN);
}

/// A small version, which keeps every bound but its known misses.
fn kept(name: &str) -> Outcome {
    let outcome = quick("flux4d", name);
    holds(&outcome, QUICK);
    outcome
}

/// More points cost more and show more; every bin of distance is measured.
#[test]
fn cost_and_bins_are_measured() {
    let outcomes = ["cost", "bins"].map(kept);
    let series = |outcome: &Outcome, name: &str| {
        let figure = outcome.figures.iter().find(|figure| figure.file.contains(name)).expect("a figure");
        figure.chart.series[0].points().to_vec()
    };
    let psnr = series(&outcomes[0], "psnr");
    assert!(psnr.len() == 2 && psnr[1].0 > psnr[0].0 && psnr[1].1 > psnr[0].1, "{psnr:?}");
    assert_eq!(series(&outcomes[1], "bins").len(), 5);
}

/// A car beside the ego vehicle moves as it does; how much of its motion a bus before it takes is measured.
#[test]
fn an_encounter_is_measured() {
    let outcome = kept("occlusion");
    let [alone, hidden] = [&outcome.notes[0], &outcome.notes[1]];
    assert!(alone.contains("alone") && hidden.contains("behind the bus"), "{alone} {hidden}");
    // A tenth of its motion of 0.9 m; five streets had 0.04 to 0.06 m.
    let epe =
        alone.rsplit("EPE ").next().and_then(|text| text.split(' ').next()).and_then(|text| text.parse::<f64>().ok());
    assert!(epe.is_some_and(|epe| epe <= 0.09), "{alone}");
}
