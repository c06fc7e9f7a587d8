//! Experiments at the edge of SparseDynGS: arithmetic in every run of the tests, training on request.
//!
//! The trained ones take a quarter of an hour on two cores:
//! `cargo test --release -p gs-train --test sparsedyn_stability -- --ignored`; docs/stability has their figures and misses.

use std::path::Path;
use std::sync::OnceLock;

use super::device;
use crate::experiments::sparsedyn::EXPERIMENTS;
use crate::experiments::{Outcome, Request, run};

fn experiments(folder: &Path, names: &[&str], quick: bool) -> Vec<Outcome> {
    let only = names.iter().map(|name| name.to_string()).collect();
    let request = Request { out: folder.into(), only, data: None, quick, device: device(), quiet: true };
    run("sparsedyn", &EXPERIMENTS, &request).expect("the experiments run")
}

/// Both experiments without training, run once for all tests, with the names of their files.
fn analytic() -> &'static (Vec<Outcome>, Vec<String>) {
    static RUN: OnceLock<(Vec<Outcome>, Vec<String>)> = OnceLock::new();
    RUN.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let outcomes = experiments(folder.path(), &["integrators", "reversal"], true);
        let entries = std::fs::read_dir(folder.path()).expect("a folder");
        let names = entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
        (outcomes, names.collect())
    })
}

/// The points of a series of a figure.
fn points(outcome: &Outcome, file: &str, series: &str) -> Vec<(f64, f64)> {
    let figure = outcome.figures.iter().find(|figure| figure.file == file).expect("the figure is drawn");
    let found = figure.chart.series.iter().find(|found| found.name() == series);
    found.unwrap_or_else(|| panic!("{file} has no series {series}")).points().to_vec()
}

#[test]
fn known_motions_keep_every_bound() {
    let (outcomes, _) = analytic();
    assert_eq!(outcomes.iter().map(|outcome| outcome.criteria.len()).collect::<Vec<_>>(), [6, 5]);
    for criterion in outcomes.iter().flat_map(|outcome| &outcome.criteria) {
        assert!(criterion.passed, "{}: expected {}, found {}", criterion.what, criterion.bound, criterion.shown());
    }
}

#[test]
fn figures_and_report_are_written() {
    let (_, names) = analytic();
    let expected = ["integrators-order.svg", "integrators-drift.svg", "reversal.svg", "results.json", "stability.html"];
    for file in expected {
        assert!(names.iter().any(|name| name == file), "{file} is not among {names:?}");
    }
}

/// The contour by the rollout against the closed form `(8 ln 1.01 / w^4)^(1/3)` over 1 unit of time.
#[test]
fn the_measured_contour_is_the_step_rule() {
    let contour = points(&analytic().0[0], "integrators-drift.svg", "1 %, measured");
    // Slower turns keep 1 % with the longest step that is measured, the fastest with the shortest.
    assert!(contour.len() >= 5, "{contour:?}");
    for (steps, speed) in contour {
        let rule = (4.0 * speed - (8.0 * 1.01_f64.ln()).log2()) / 3.0;
        // Between two steps a factor of 2 apart the logarithm of the drift bends: some hundredths in the logarithm of the step.
        assert!((steps - rule).abs() < 0.05, "at 2^{speed} rad: 2^{steps} steps by the rollout, 2^{rule} by the rule");
    }
}

/// Halving the step divides the error by `2^order`.
#[test]
fn errors_fall_with_the_order_of_the_method() {
    for (name, order) in [("rk2", 2.0), ("rk4", 4.0), ("screw", 2.0)] {
        let curve = points(&analytic().0[0], "integrators-order.svg", name);
        // Steps of 1/64 and 1/128, whose errors are far above rounding; a tenth is left for the next order.
        let at = |log2: f64| curve.iter().find(|(step, _)| *step == log2).expect("a step").1;
        let slope = (at(-6.0) - at(-7.0)) / 2.0_f64.log10();
        assert!((slope - order).abs() < 0.1, "{name}: {slope}");
    }
}

#[test]
fn a_name_that_is_none_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let only = vec!["horizons".into()];
    let request = Request { out: folder.path().into(), only, data: None, quick: true, device: device(), quiet: true };
    let message = run("sparsedyn", &EXPERIMENTS, &request).expect_err("unknown").to_string();
    assert!(message.contains("horizons") && message.contains("horizon, views"), "{message}");
}

/// The small version of every experiment draws its figures and measures each of its values. Bounds are for full runs.
/// `cargo test --release -p gs-train --test sparsedyn_stability -- --ignored every_experiment`
#[test]
#[ignore = "trains twenty times: a minute or two"]
fn every_experiment_measures_what_it_asks() {
    let folder = tempfile::tempdir().expect("a folder");
    let outcomes = experiments(folder.path(), &[], true);
    assert_eq!(outcomes.len(), EXPERIMENTS.len());
    for outcome in &outcomes {
        assert!(!outcome.figures.is_empty(), "{} has no figure", outcome.name);
        for criterion in &outcome.criteria {
            assert!(criterion.value.is_some(), "{}: {} was not measured", outcome.name, criterion.what);
        }
        for figure in &outcome.figures {
            assert!(figure.chart.series.iter().any(|series| series.is_visible()), "{} is empty", figure.file);
        }
    }
}

/// Over four times the time that was seen no position is lost, and bodies are better than what stops.
/// `cargo test --release -p gs-train --test sparsedyn_stability -- --ignored four_times`
#[test]
#[ignore = "trains six times: minutes"]
fn four_times_the_time_seen_stays_finite() {
    let folder = tempfile::tempdir().expect("a folder");
    let outcome = experiments(folder.path(), &["horizon"], false).remove(0);
    let finite = outcome.criteria.iter().find(|criterion| criterion.what.contains("not finite")).expect("it is asked");
    assert!(finite.passed, "{} positions are not finite", finite.shown());
    let slider = outcome.criteria.iter().find(|criterion| criterion.what.contains("slider, bodies")).expect("likewise");
    assert!(slider.passed, "a sliding box: {} against a scene that stops", slider.shown());
}
