//! Several runs beside one another: which of their measurements nothing beats at its cost, as charts, table and page.
//!
//! `gather` reads the runs, `budget` says how many Gaussians are enough, `panels` and `table` say what is shown, `page` puts it into HTML.

mod budget;
mod gather;
mod page;
mod panels;
mod table;

pub use budget::enough;
pub use gather::{Gathered, gather};
pub use page::{add_to_report, page, stacked};
pub use panels::Panels;
pub use table::Table;

use std::collections::BTreeMap;

use crate::evaluate::Evaluation;
use crate::run_folder::{EvalFile, RunFolder};

/// A finished run.
#[derive(Debug, Clone)]
pub struct ComparedRun {
    /// Its folder's name, with as much of the path as it takes to tell it from the others.
    pub name: String,
    /// Its folder.
    pub folder: RunFolder,
    /// Every value of its configuration, by key with section.
    pub values: BTreeMap<String, String>,
    /// Its figures.
    pub eval: EvalFile,
}

/// What runs are told apart by before anything else: name in charts, key of the configuration.
pub(crate) const SETTINGS: [(&str, &str); 4] =
    [("blur", "blur.mode"), ("N", "blur.samples"), ("order", "motion.order"), ("cap", "density.cap")];

impl ComparedRun {
    /// The value of one of [`SETTINGS`]; `None` where it means nothing: motion and blur in a static scene, instants without
    /// a blur model.
    pub(crate) fn setting(&self, key: &str) -> Option<&str> {
        let value = |key: &str| self.values.get(key).map(String::as_str);
        let moving = value("pipeline") == Some("taylormode");
        let means_something = match key {
            "density.cap" => true,
            "blur.samples" => moving && value("blur.mode") != Some("none"),
            _ => moving,
        };
        value(key).filter(|_| means_something)
    }

    /// Its measurements in the order they were made.
    pub(crate) fn measurements(&self) -> &[Evaluation] {
        &self.eval.evaluations
    }
}

/// Whether every measurement knows its processor time. Then that is what accuracy costs, because other work on the machine
/// does not change it; otherwise wall-clock time is.
pub(crate) fn by_cpu(runs: &[ComparedRun]) -> bool {
    runs.iter().flat_map(ComparedRun::measurements).all(|e| e.cpu_seconds.is_some())
}

/// What a measurement cost, seconds.
pub(crate) fn seconds(evaluation: &Evaluation, cpu: bool) -> f64 {
    evaluation.cpu_seconds.filter(|_| cpu).unwrap_or(evaluation.seconds)
}

/// For each point (cost, quality) whether no other is at least as cheap and at least as good, and better in one of the two.
/// Points that are not finite are never on the front.
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
