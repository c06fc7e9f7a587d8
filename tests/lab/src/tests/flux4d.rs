//! Experiments at the edge of Flux4D, by the network that ships: small versions of those that train nothing.
//!
//! docs/stability has the figures and misses of the full ones.

use super::device;
use crate::experiments::flux4d::EXPERIMENTS;
use crate::experiments::{Outcome, Request, run};

fn experiments(names: &[&str]) -> Vec<Outcome> {
    let folder = tempfile::tempdir().expect("a folder");
    let only = names.iter().map(|name| name.to_string()).collect();
    let request = Request { out: folder.path().into(), only, data: None, quick: true, device: device(), quiet: true };
    let outcomes = run("flux4d", &EXPERIMENTS, &request).expect("the experiments run");
    assert!(folder.path().join("stability.html").is_file());
    outcomes
}

/// What is missing costs little, and wrong poses change no motion, because motion is read off the LiDAR alone. The bounds are
/// those of the experiments.
#[test]
fn holes_and_wrong_poses_are_borne() {
    for criterion in experiments(&["holes", "calibration"]).iter().flat_map(|outcome| &outcome.criteria) {
        assert!(criterion.passed, "{}: expected {}, found {}", criterion.what, criterion.bound, criterion.shown());
    }
}

/// More points cost more and show more; every bin of distance is measured.
#[test]
fn cost_and_bins_are_measured() {
    let outcomes = experiments(&["cost", "bins"]);
    let series = |outcome: &Outcome, name: &str| {
        let figure = outcome.figures.iter().find(|figure| figure.file.contains(name)).expect("a figure");
        figure.chart.series[0].points().to_vec()
    };
    let psnr = series(&outcomes[1], "psnr");
    assert!(psnr.len() == 2 && psnr[1].0 > psnr[0].0 && psnr[1].1 > psnr[0].1, "{psnr:?}");
    assert_eq!(series(&outcomes[0], "bins").len(), 5);
}

/// A car beside the ego vehicle moves as it does; how much of its motion a bus before it takes is measured. Refinements help.
#[test]
fn an_encounter_and_refinements_are_measured() {
    let outcomes = experiments(&["occlusion", "passes"]);
    let [alone, hidden] = [&outcomes[0].notes[0], &outcomes[0].notes[1]];
    assert!(alone.contains("alone") && hidden.contains("behind the bus"), "{alone} {hidden}");
    // A tenth of its motion of 0.9 m; five streets had 0.04 to 0.06 m.
    let epe =
        alone.rsplit("EPE ").next().and_then(|text| text.split(' ').next()).and_then(|text| text.parse::<f64>().ok());
    assert!(epe.is_some_and(|epe| epe <= 0.09), "{alone}");
    assert!(outcomes[1].criteria.iter().all(|criterion| criterion.passed), "{:?}", outcomes[1].notes);
}
