//! Runs beside each other: what a sweep needs to choose among its own, and what comparisons of many runs begin with.
//!
//! `gather` reads the runs, `table` has a row for each measurement, `chart` shows quality over cost, `budget` finds the
//! smallest sufficient cap, `choice` the smallest sufficient model.

mod budget;
mod chart;
mod choice;
mod gather;
mod table;

pub use budget::enough;
pub use chart::chart;
pub use choice::{Candidate, Choice};
pub use gather::{Gathered, gather};
pub use table::{Table, differing_keys};

use std::collections::BTreeMap;

use gs_train::run::folder::{EvalFile, RunFolder, Setting};
use gs_train::run::measured::Evaluation;

/// A finished run.
#[derive(Debug, Clone)]
pub struct ComparedRun {
    /// Its folder's name, with as much of the path as distinguishes it from the others.
    pub name: String,
    /// Its folder.
    pub folder: RunFolder,
    /// Every value of its configuration, by key with section.
    pub values: BTreeMap<String, String>,
    /// Its figures.
    pub eval: EvalFile,
}

/// The settings by which the pipelines of the runs distinguish them, as name and key, in the order of their first run.
pub fn settings(runs: &[ComparedRun]) -> Vec<(&str, &str)> {
    let mut found: Vec<(&str, &str)> = Vec::new();
    for setting in runs.iter().flat_map(|run| &run.eval.settings) {
        if found.iter().all(|(_, key)| *key != setting.key) {
            found.push((&setting.name, &setting.key));
        }
    }
    found
}

impl ComparedRun {
    /// One of [`settings`]; `None` if it has no meaning for the run.
    pub fn setting(&self, key: &str) -> Option<&Setting> {
        self.eval.settings.iter().find(|setting| setting.key == key)
    }

    /// Its measurements, in order.
    pub fn measurements(&self) -> &[Evaluation] {
        &self.eval.evaluations
    }
}

/// Whether every measurement has its processor time. Then that is the cost, because other work on the machine does not
/// change it; otherwise wall-clock time is.
pub fn by_cpu(runs: &[ComparedRun]) -> bool {
    runs.iter().flat_map(ComparedRun::measurements).all(|e| e.cost.cpu_seconds.is_some())
}

/// The cost of a measurement, seconds.
pub fn seconds(evaluation: &Evaluation, cpu: bool) -> f64 {
    evaluation.cost.cpu_seconds.filter(|_| cpu).unwrap_or(evaluation.cost.seconds)
}

/// For each point (cost, quality), whether no other is at least as cheap and at least as good, and better in one of the
/// two. Points that are not finite are never on the front.
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<bool> {
    let finite = |(x, y): (f64, f64)| x.is_finite() && y.is_finite();
    let beats = |a: (f64, f64), b: (f64, f64)| finite(a) && a.0 <= b.0 && a.1 >= b.1 && a != b;
    points.iter().map(|point| finite(*point) && !points.iter().any(|other| beats(*other, *point))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let points = [(3.0, 30.0), (1.0, 20.0), (2.0, 19.0), (4.0, 29.0), (1.0, 18.0), (5.0, 31.0)];
        assert_eq!(pareto_front(&points), [true, true, false, false, false, true]);
        assert!(pareto_front(&[]).is_empty());
    }

    #[test]
    fn equals_share_the_front_and_what_is_not_finite_is_off_it() {
        assert_eq!(pareto_front(&[(1.0, 2.0), (1.0, 2.0), (1.0, 1.0), (2.0, 2.0)]), [true, true, false, false]);
        assert_eq!(pareto_front(&[(f64::NAN, 90.0), (1.0, f64::INFINITY), (1.0, 5.0)]), [false, false, true]);
    }
}
