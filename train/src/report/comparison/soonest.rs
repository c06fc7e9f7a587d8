//! The time to a quality: the seconds after which each run reached 24, 27, 30, ... dB on its held-out views.
//!
//! Between two measurements the PSNR is taken to rise evenly with the logarithm of the seconds, as it nearly does. A quality that the first
//! measurement already exceeds was reached before it, by an unknown time.

use super::{ComparedRun, Other, Table, by_cpu, seconds};

/// Qualities of the table are multiples of this, dB.
const EVERY: usize = 3;

/// Time to a quality.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Reached {
    /// Between two measurements, seconds.
    At(f64),
    /// Before the first measurement, seconds.
    Before(f64),
    Never,
}

/// One row a run or other program, one column a quality that any of them reached; `None` where none was measured on the way.
pub fn soonest(runs: &[ComparedRun], others: &[Other]) -> Option<Table> {
    let cpu = by_cpu(runs);
    let curve = |run: &ComparedRun| -> Vec<(f64, f64)> {
        let points = run.measurements().iter().map(|e| (seconds(e, cpu), e.mean().psnr));
        points.filter(|(x, y)| x.is_finite() && y.is_finite() && *x > 0.0).collect()
    };
    let curves: Vec<Vec<(f64, f64)>> =
        runs.iter().map(curve).chain(others.iter().map(|other| other.points.clone())).collect();
    let names = runs.iter().map(|run| &run.name).chain(others.iter().map(|other| &other.name));
    if curves.iter().all(|curve| curve.len() < 2) {
        return None;
    }
    let best = curves.iter().flatten().map(|(_, y)| *y).fold(0.0, f64::max);
    // A quality that every run exceeds from its first measurement on tells nothing.
    let is_told =
        |level: &f64| curves.iter().any(|curve| !matches!(reached(curve, *level), Reached::Before(_) | Reached::Never));
    let levels: Vec<f64> = (1..=best as usize / EVERY).map(|i| (i * EVERY) as f64).filter(is_told).collect();
    let unit = if cpu { "CPU s" } else { "s" };
    let columns = std::iter::once("run".to_string()).chain(levels.iter().map(|level| format!("{unit} to {level} dB")));
    let rows = names.zip(&curves).map(|(name, curve)| {
        let cells = levels.iter().map(|level| match reached(curve, *level) {
            Reached::At(seconds) => format!("{seconds:.1}"),
            Reached::Before(seconds) => format!("< {seconds:.1}"),
            Reached::Never => String::new(),
        });
        std::iter::once(name.clone()).chain(cells).collect()
    });
    Some(Table::of(columns.collect(), rows.collect()))
}

/// When a curve of seconds and PSNR first reaches a level.
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
    use crate::report::comparison::testing;

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

    #[test]
    fn qualities_are_met_between_measurements() {
        let runs = [run("old", &[(10.0, 29.0), (40.0, 31.0), (90.0, 34.0)]), run("new", &[(5.0, 31.0), (20.0, 35.0)])];
        let table = soonest(&runs, &[]).expect("curves");
        // 30 dB: half way between 10 and 40 in the logarithm. 33 dB: two thirds of the way from 40 to 90, and half from 5 to 20.
        assert_eq!(table.columns, ["run", "CPU s to 30 dB", "CPU s to 33 dB"]);
        assert_eq!(table.rows, [["old", "20.0", "68.7"], ["new", "< 5.0", "10.0"]]);
    }

    #[test]
    fn a_quality_that_a_run_never_reached_is_empty() {
        let runs = [run("short", &[(10.0, 20.0), (20.0, 22.0)]), run("long", &[(10.0, 20.0), (20.0, 25.0)])];
        let table = soonest(&runs, &[]).expect("curves");
        assert_eq!(table.rows[0], ["short".to_string(), "14.1".into(), String::new()]);
        assert_eq!(soonest(&[testing::run("once", 30.0, None)], &[]), None);
    }
}
