//! The cost of a quality: the seconds after which each run reached 24, 27, 30, ... dB on its held-out views, and the
//! Gaussians it had then.
//!
//! Between two measurements the PSNR is taken to rise evenly with the logarithm of the cost, as it nearly does. A
//! quality that the first measurement already exceeds was reached before it, at an unknown cost.

use gs_train::run::measured::Evaluation;
use gsburn::report::comparison::{ComparedRun, Table, seconds};

use super::Other;
use super::seeds::{Curve, Spread};

/// Qualities of the table are multiples of this, dB.
const EVERY: usize = 3;

/// Cost and PSNR, measurement by measurement.
type Points = Vec<(f64, f64)>;

/// Name and runs of a row.
type Row = (String, Vec<Points>);

/// The cost of a quality.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Reached {
    /// Between two measurements.
    At(f64),
    /// Before the first measurement, whose cost is given.
    Before(f64),
    Never,
}

impl Reached {
    /// The cost, or a bound of it.
    fn cost(self) -> Option<f64> {
        match self {
            Self::At(cost) | Self::Before(cost) => Some(cost),
            Self::Never => None,
        }
    }
}

/// A cost of a quality: its name, its value at a measurement, and digits behind the point.
type Measure<'a> = (&'a str, &'a dyn Fn(&Evaluation) -> f64, usize);

/// Seconds and Gaussians at which qualities of moving parts, if they were measured, and of whole images were first
/// reached. A row is a curve, or among the seconds of whole images another program; a column is a quality that any of
/// them reached. Of several seeds it is the mean, with the range. There is no table where nothing was measured on the
/// way.
pub fn soonest(curves: &[Curve], others: &[Other], cpu: bool) -> Vec<Table> {
    let time: Measure = (if cpu { "CPU s" } else { "s" }, &|e| seconds(e, cpu), 1);
    let count: Measure = ("Gaussians", &|e| e.measured.size.gaussians as f64, 0);
    let rows = |cost: &Measure, psnr: fn(&Evaluation) -> Option<f64>| -> Vec<Row> {
        let points_of = |run: &ComparedRun| -> Points {
            let points = run.measurements().iter().filter_map(|e| Some((cost.1(e), psnr(e)?)));
            points.filter(|(x, y)| x.is_finite() && y.is_finite() && *x > 0.0).collect()
        };
        curves.iter().map(|curve| (curve.shown.name.clone(), curve.runs.iter().map(points_of).collect())).collect()
    };
    let mut tables = Vec::new();
    for measure in [&time, &count] {
        let mut whole = rows(measure, |e| Some(e.mean().psnr));
        if measure.0 == time.0 {
            whole.extend(others.iter().map(|other| (other.name.clone(), vec![other.points.clone()])));
        }
        let moving = rows(measure, |e| e.moving().map(|scores| scores.psnr));
        tables.extend([(moving, ", moving"), (whole, "")].iter().filter_map(|(rows, of)| costs(rows, measure, of)));
    }
    tables
}

/// The costs of the qualities, one table.
fn costs(rows: &[Row], (unit, _, digits): &Measure, of: &str) -> Option<Table> {
    let all = || rows.iter().flat_map(|(_, runs)| runs);
    if all().all(|points| points.len() < 2) {
        return None;
    }
    let best = all().flatten().map(|(_, y)| *y).fold(0.0, f64::max);
    // A quality that every run exceeds from its first measurement on tells nothing.
    let is_told = |level: &f64| all().any(|points| matches!(reached(points, *level), Reached::At(_)));
    let levels: Vec<f64> = (1..=best as usize / EVERY).map(|i| (i * EVERY) as f64).filter(is_told).collect();
    let columns =
        std::iter::once("run".to_string()).chain(levels.iter().map(|level| format!("{unit} to {level} dB{of}")));
    let rows = rows.iter().map(|(name, runs)| {
        let cell_at = |level: &f64| cell(&runs.iter().map(|run| reached(run, *level)).collect::<Vec<_>>(), *digits);
        std::iter::once(name.clone()).chain(levels.iter().map(cell_at)).collect()
    });
    Some(Table::of(columns.collect(), rows.collect()))
}

/// The cell of a quality, from the runs of a row: the mean with its range, or a bound, or how many of the runs reached
/// it.
fn cell(reached: &[Reached], digits: usize) -> String {
    let costs: Vec<f64> = reached.iter().filter_map(|reached| reached.cost()).collect();
    let Some(spread) = Spread::of(&costs) else { return String::new() };
    if costs.len() < reached.len() {
        return format!("{} of {}", costs.len(), reached.len());
    }
    match reached.iter().any(|reached| matches!(reached, Reached::Before(_))) {
        true => format!("< {:.digits$}", spread.high),
        false => spread.shown(reached.len() > 1, digits),
    }
}

/// Where a curve of cost and PSNR first reaches a level.
fn reached(curve: &[(f64, f64)], level: f64) -> Reached {
    match curve.iter().position(|(_, psnr)| *psnr >= level) {
        None => Reached::Never,
        Some(0) => Reached::Before(curve[0].0),
        Some(i) => {
            let ((before, low), (after, high)) = (curve[i - 1], curve[i]);
            Reached::At(before * (after / before).powf((level - low) / (high - low)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::seeds::curves;
    use crate::comparison::testing;

    /// A run with these seconds and PSNR.
    fn run(name: &str, points: &[(f64, f64)]) -> ComparedRun {
        let mut run = testing::run(name, 1.0, None);
        let first = run.eval.evaluations[0].clone();
        let measured = points.iter().map(|(seconds, psnr)| {
            let mut evaluation = first.clone();
            evaluation.cost.cpu_seconds = Some(*seconds);
            evaluation.measured.quality.mean.psnr = *psnr;
            evaluation
        });
        run.eval.evaluations = measured.collect();
        run
    }

    fn whole(runs: &[ComparedRun]) -> Table {
        soonest(&curves(runs), &[], true).swap_remove(0)
    }

    #[test]
    fn qualities_are_met_between_measurements() {
        let runs = [run("old", &[(10.0, 29.0), (40.0, 31.0), (90.0, 34.0)]), run("new", &[(5.0, 31.0), (20.0, 35.0)])];
        let table = whole(&runs);
        // 30 dB: half way between 10 and 40 in the logarithm. 33 dB: two thirds of the way from 40 to 90, and half from
        // 5 to 20.
        assert_eq!(table.columns, ["run", "CPU s to 30 dB", "CPU s to 33 dB"]);
        assert_eq!(table.rows, [["old", "20.0", "68.7"], ["new", "< 5.0", "10.0"]]);
    }

    #[test]
    fn a_quality_that_a_run_never_reached_is_empty() {
        let runs = [run("short", &[(10.0, 20.0), (20.0, 22.0)]), run("long", &[(10.0, 20.0), (20.0, 25.0)])];
        let table = whole(&runs);
        assert_eq!(table.rows[0], ["short".to_string(), "14.1".into(), String::new()]);
        assert!(soonest(&curves(&[testing::run("once", 30.0, None)]), &[], true).is_empty());
    }

    #[test]
    fn seeds_have_a_mean_and_a_range() {
        let mut runs = [run("seed-1", &[(10.0, 20.0), (40.0, 22.0)]), run("seed-2", &[(20.0, 20.0), (80.0, 22.0)])];
        for (run, seed) in runs.iter_mut().zip(["1", "2"]) {
            run.values.insert("seed".into(), seed.into());
        }
        // 21 dB: after 20 and after 40 seconds.
        assert_eq!(whole(&runs).rows, [["2 seeds", "30.0 (20.0 to 40.0)"]]);
        runs[1].eval.evaluations[1].measured.quality.mean.psnr = 20.5;
        assert_eq!(whole(&runs).rows, [["2 seeds", "1 of 2"]]);
    }

    #[test]
    fn moving_parts_have_times_of_their_own() {
        let mut moving = run("moving", &[(10.0, 20.0), (40.0, 22.0)]);
        for (evaluation, psnr) in moving.eval.evaluations.iter_mut().zip([17.0, 19.0]) {
            let scores = gs_train::run::measured::Scores { psnr, ..evaluation.measured.quality.mean.clone() };
            evaluation.measured.quality.regions.insert(gs_train::fit::told::MOVING.into(), scores);
        }
        let tables = soonest(&curves(&[moving]), &[], true);
        assert_eq!(tables[0].columns, ["run", "CPU s to 18 dB, moving"]);
        assert_eq!(tables[1].rows, [["moving", "20.0"]]);
    }
}
