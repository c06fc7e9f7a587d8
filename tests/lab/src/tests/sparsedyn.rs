//! Experiments at the limits of SparseDynGS.

use std::sync::OnceLock;

use super::misses::{QUICK, holds};
use super::{all_hold, experiment, points};
use crate::experiments::Outcome;

#[test]
fn small_versions_keep_their_bounds() {
    all_hold("sparsedyn", &["integrators"]);
}

/// The experiment on integrators, run once for all tests, with the names of its files.
fn integrators() -> &'static (Outcome, Vec<String>) {
    static RUN: OnceLock<(Outcome, Vec<String>)> = OnceLock::new();
    RUN.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let outcome = experiment(folder.path(), ("sparsedyn", "integrators"), true).expect("it runs");
        let entries = std::fs::read_dir(folder.path()).expect("a folder");
        let names = entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
        (outcome, names.collect())
    })
}

#[test]
fn figures_and_report_are_written() {
    let (outcome, names) = integrators();
    holds(outcome, QUICK);
    for file in ["integrators-order.svg", "integrators-drift.svg", "results.json", "stability.html"] {
        assert!(names.iter().any(|name| name == file), "{file} is not among {names:?}");
    }
}

/// The contour by the rollout against the closed form `(8 ln 1.01 / w^4)^(1/3)` over 1 unit of time.
#[test]
fn the_measured_contour_is_the_step_rule() {
    let contour = points(&integrators().0, "integrators-drift.svg", "1 %, measured");
    // Slower turns keep 1 % with the longest step that is measured, the fastest with the shortest.
    assert!(contour.len() >= 5, "{contour:?}");
    for (steps, speed) in contour {
        let rule = (4.0 * speed - (8.0 * 1.01_f64.ln()).log2()) / 3.0;
        // Between two steps a factor of 2 apart the logarithm of the drift bends: some hundredths in the logarithm of
        // the step.
        assert!((steps - rule).abs() < 0.05, "at 2^{speed} rad: 2^{steps} steps by the rollout, 2^{rule} by the rule");
    }
}

/// Halving the step divides the error by `2^order`.
#[test]
fn errors_fall_with_the_order_of_the_method() {
    for (name, order) in [("rk2", 2.0), ("rk4", 4.0), ("screw", 2.0)] {
        let curve = points(&integrators().0, "integrators-order.svg", name);
        // Steps of 1/64 and 1/128, whose errors are far above rounding; a tenth is left for the next order.
        let at = |log2: f64| curve.iter().find(|(step, _)| *step == log2).expect("a step").1;
        let slope = (at(-6.0) - at(-7.0)) / 2.0_f64.log10();
        assert!((slope - order).abs() < 0.1, "{name}: {slope}");
    }
}
