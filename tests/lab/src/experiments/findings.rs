//! Findings of an experiment: bounds compared with measured values, figures, remarks.

use gsburn::report::charts::{Chart, Series};
use serde::Serialize;

use crate::experiments::Experiment;

/// A bound that was set before measuring, and the measured value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Criterion {
    pub what: String,
    /// The bound, for people.
    pub bound: String,
    /// The value; `None` if nothing could be measured, which misses any bound.
    pub value: Option<f64>,
    pub unit: String,
    /// Whether the bound is kept.
    pub passed: bool,
}

impl Criterion {
    /// "passed" or "missed".
    pub fn verdict(&self) -> &'static str {
        if self.passed { "passed" } else { "missed" }
    }

    /// The value with its unit.
    pub fn shown(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        match self.value {
            None => "not measured".into(),
            Some(0.0) => format!("0{unit}"),
            Some(value) if value.abs() < 1e-3 => format!("{value:.1e}{unit}"),
            Some(value) => format!("{value:.3}{unit}"),
        }
    }
}

/// A bound with as few characters as it needs.
fn short(bound: f64) -> String {
    if bound != 0.0 && bound.abs() < 1e-3 { format!("{bound:e}") } else { bound.to_string() }
}

/// The largest of the values; `None` without values or if one is NaN.
pub fn largest(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    // f64::max would drop NaN, which stands for a value that could not be measured.
    values.into_iter().reduce(|a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) })
}

/// The smallest of the values; `None` without values or if one is NaN.
pub fn smallest(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    largest(values.into_iter().map(|value| -value)).map(|value| -value)
}

/// The findings of an experiment.
#[derive(Debug, Clone, Default)]
pub struct Findings {
    /// Bounds and values.
    pub criteria: Vec<Criterion>,
    /// Figures by name; the name of an only one is empty.
    pub figures: Vec<(&'static str, Chart)>,
    /// Remarks for readers of the figures, in sentences.
    pub notes: Vec<String>,
}

impl Findings {
    /// The value must be `bound` at most.
    pub fn at_most(&mut self, what: impl Into<String>, value: impl Into<Option<f64>>, bound: f64, unit: &str) {
        self.judge(what, value, format!("at most {}", short(bound)), unit, |value| value <= bound);
    }

    /// The value must be `bound` at least.
    pub fn at_least(&mut self, what: impl Into<String>, value: impl Into<Option<f64>>, bound: f64, unit: &str) {
        self.judge(what, value, format!("at least {bound}"), unit, |value| value >= bound);
    }

    /// The value must be above `bound`.
    pub fn above(&mut self, what: impl Into<String>, value: impl Into<Option<f64>>, bound: f64, unit: &str) {
        self.judge(what, value, format!("above {bound}"), unit, |value| value > bound);
    }

    /// The value must be exactly 0.
    pub fn zero(&mut self, what: impl Into<String>, value: impl Into<Option<f64>>, unit: &str) {
        self.judge(what, value, "exactly 0".into(), unit, |value| value == 0.0);
    }

    fn judge(
        &mut self,
        what: impl Into<String>,
        value: impl Into<Option<f64>>,
        bound: String,
        unit: &str,
        keeps: impl Fn(f64) -> bool,
    ) {
        let value = value.into().filter(|value| value.is_finite());
        let passed = value.is_some_and(keeps);
        self.criteria.push(Criterion { what: what.into(), bound, value, unit: unit.into(), passed });
    }

    /// Adds a remark.
    pub fn note(&mut self, note: impl Into<String>) {
        self.notes.push(note.into());
    }

    /// Adds a figure. `name` is empty where it is the only one.
    pub fn chart(
        &mut self,
        name: &'static str,
        title: impl Into<String>,
        [x, y]: [&str; 2],
        series: impl IntoIterator<Item = Series>,
    ) {
        let series = series.into_iter().collect();
        self.figures.push((name, Chart { title: title.into(), x: x.into(), y: y.into(), series }));
    }
}

/// A drawn figure.
#[derive(Debug, Clone, Serialize)]
pub struct Figure {
    /// The file's name in the output folder.
    pub file: String,
    #[serde(skip)]
    pub svg: String,
    /// The chart, with all points.
    #[serde(flatten)]
    pub chart: Chart,
}

/// A finished experiment.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    pub name: String,
    pub question: String,
    /// Whether all bounds are kept.
    pub passed: bool,
    /// Bounds and values.
    pub criteria: Vec<Criterion>,
    pub figures: Vec<Figure>,
    pub notes: Vec<String>,
    /// Wall-clock time, seconds.
    pub seconds: f64,
}

impl Outcome {
    /// Draws the figures; their titles name missed bounds.
    pub fn new(experiment: &Experiment, found: Findings, seconds: f64) -> Self {
        let passed = found.criteria.iter().all(|criterion| criterion.passed);
        let draw = |(name, mut chart): (&str, Chart)| {
            if !passed {
                chart.title += " (a bound is missed)";
            }
            let dash = if name.is_empty() { "" } else { "-" };
            Figure { file: format!("{}{dash}{name}.svg", experiment.name), svg: chart.svg(), chart }
        };
        Self {
            name: experiment.name.into(),
            question: experiment.question.into(),
            passed,
            figures: found.figures.into_iter().map(draw).collect(),
            criteria: found.criteria,
            notes: found.notes,
            seconds,
        }
    }

    /// The outcome in one line.
    pub fn line(&self) -> String {
        let kept = self.criteria.iter().filter(|criterion| criterion.passed).count();
        let verdict = if self.passed { "passed" } else { "missed" };
        format!("{}: {verdict}, {kept} of {} bounds kept, {:.0} s", self.name, self.criteria.len(), self.seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_measured_passes_nothing() {
        let mut found = Findings::default();
        found.at_most("x", None, 1.0, "");
        found.at_least("x", f64::NAN, 0.0, "");
        found.at_most("x", largest([0.5, f64::NAN, 0.1]), 1.0, "");
        assert!(found.criteria.iter().all(|criterion| !criterion.passed));
        found.at_most("x", largest([0.5, 0.1]), 0.5, "");
        assert!(found.criteria[3].passed);
        assert_eq!(smallest([3.0, -1.0, 2.0]), Some(-1.0));
        assert_eq!(largest([]), None);
    }
}
