//! Runs that differ in nothing but their seed: one curve of their means, with the range over the seeds.

use gs_train::run::measured::Evaluation;
use gsburn::report::comparison::{ComparedRun, Table, by_cpu, seconds};

/// The key of the configuration by which such runs differ.
const SEED: &str = "seed";

/// Longest list of names in the name of a curve.
const NAMED: usize = 3;

/// A run, or several that differ in their seed alone.
#[derive(Debug, Clone)]
pub struct Curve {
    /// The first run, under the name of all.
    pub shown: ComparedRun,
    /// All of them.
    pub runs: Vec<ComparedRun>,
}

/// Mean and range over the runs of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Lowest.
    pub low: f64,
    /// Highest.
    pub high: f64,
}

impl Spread {
    /// The spread of these values; `None` without any.
    pub fn of(values: &[f64]) -> Option<Self> {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        (!values.is_empty()).then_some(Self { mean, low, high })
    }

    /// The mean, of several values with their range.
    pub fn shown(&self, is_several: bool, digits: usize) -> String {
        let Self { mean, low, high } = self;
        let range = || format!(" ({low:.digits$} to {high:.digits$})");
        format!("{mean:.digits$}{}", if is_several { range() } else { String::new() })
    }
}

impl Curve {
    /// The measurements of all runs at one step, step by step.
    pub fn measurements(&self) -> impl Iterator<Item = Vec<&Evaluation>> {
        (0..self.shown.measurements().len()).map(|k| self.runs.iter().map(|run| &run.measurements()[k]).collect())
    }

    /// Whether there are several seeds.
    pub fn is_of_seeds(&self) -> bool {
        self.runs.len() > 1
    }
}

/// The runs as curves, in the order of their first run. Runs of one folder whose configurations differ in the seed
/// alone, and which were measured at the same steps, are one curve. (Another folder may hold runs of another version of
/// the program.)
pub fn curves(runs: &[ComparedRun]) -> Vec<Curve> {
    let mut curves: Vec<Vec<ComparedRun>> = Vec::new();
    for run in runs {
        let joins = |curve: &&mut Vec<ComparedRun>| {
            curve.iter().all(|other| other.values.get(SEED) != run.values.get(SEED)) && alike(&curve[0], run)
        };
        match curves.iter_mut().find(joins) {
            Some(curve) => curve.push(run.clone()),
            None => curves.push(vec![run.clone()]),
        }
    }
    curves.into_iter().map(|runs| Curve { shown: ComparedRun { name: name(&runs), ..runs[0].clone() }, runs }).collect()
}

/// Whether two runs differ in nothing but their seed.
fn alike(a: &ComparedRun, b: &ComparedRun) -> bool {
    let steps = |run: &ComparedRun| run.measurements().iter().map(|e| e.step).collect::<Vec<_>>();
    let values = |run: &ComparedRun| run.values.clone().into_iter().filter(|(key, _)| key != SEED).collect::<Vec<_>>();
    a.folder.path().parent() == b.folder.path().parent()
        && (&a.eval.pipeline, &a.eval.device) == (&b.eval.pipeline, &b.eval.device)
        && steps(a) == steps(b)
        && values(a) == values(b)
}

/// The name of the runs: that of the first without its seed, and their number.
fn name(runs: &[ComparedRun]) -> String {
    let first = &runs[0];
    if runs.len() == 1 {
        return first.name.clone();
    }
    let without = |run: &ComparedRun| -> Option<String> {
        let seed = run.values.get(SEED)?;
        let at = run.name.rfind(seed.as_str())?;
        let (before, after) = (&run.name[..at], &run.name[at + seed.len()..]);
        let trim = |text: &str| text.trim_matches(['-', '_', '=', ' ', '.', ',', '/']).to_string();
        let before = trim(before);
        let parts = [trim(before.strip_suffix(SEED).unwrap_or(&before)), trim(after)];
        Some(parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("_"))
    };
    let seeds = format!("{} seeds", runs.len());
    match without(first) {
        Some(name) if runs.iter().all(|run| without(run).as_ref() == Some(&name)) => match name.is_empty() {
            true => seeds,
            false => format!("{name}, {seeds}"),
        },
        _ if runs.len() <= NAMED => runs.iter().map(|run| run.name.as_str()).collect::<Vec<_>>().join(", "),
        _ => format!("{} and {} more", first.name, runs.len() - 1),
    }
}

/// Means and ranges of every measurement, if there are curves of several seeds.
pub fn spreads(curves: &[Curve]) -> Option<Table> {
    if !curves.iter().any(Curve::is_of_seeds) {
        return None;
    }
    let cpu = curves.iter().all(|curve| by_cpu(&curve.runs));
    let mut rows = Vec::new();
    for curve in curves {
        for measured in curve.measurements() {
            let spread = |of: &dyn Fn(&Evaluation) -> Option<f64>| {
                Spread::of(&measured.iter().filter_map(|e| of(e)).collect::<Vec<_>>())
            };
            let shown = |of: &dyn Fn(&Evaluation) -> Option<f64>, digits: usize| {
                spread(of).map_or(String::new(), |spread| spread.shown(curve.is_of_seeds(), digits))
            };
            rows.push(vec![
                curve.shown.name.clone(),
                measured[0].step.to_string(),
                shown(&|e| Some(e.mean().psnr), 2),
                shown(&|e| e.moving().map(|scores| scores.psnr), 2),
                shown(&|e| Some(e.mean().ssim), 4),
                shown(&|e| Some(seconds(e, cpu)), 1),
                shown(&|e| Some(e.measured.size.gaussians as f64), 0),
            ]);
        }
    }
    let time = if cpu { "CPU s" } else { "wall s" };
    let columns = ["run", "step", "PSNR dB", "moving dB", "SSIM", time, "Gaussians"];
    Some(Table::of(columns.map(String::from).to_vec(), rows))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::testing;
    use gs_train::run::folder::RunFolder;

    fn run(path: &str, psnr: f64, values: &[(&str, &str)]) -> ComparedRun {
        let mut run = testing::run(path.rsplit('/').next().expect("a name"), psnr, None);
        run.folder = RunFolder::at(path);
        run.values = values.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect();
        run
    }

    #[test]
    fn runs_of_several_seeds_are_one_curve() {
        let runs = [
            run("sweep/cap-5_seed-1", 30.0, &[("cap", "5"), ("seed", "1")]),
            run("sweep/cap-5_seed-2", 32.0, &[("cap", "5"), ("seed", "2")]),
            run("sweep/cap-9_seed-1", 40.0, &[("cap", "9"), ("seed", "1")]),
            run("elsewhere/cap-5_seed-3", 50.0, &[("cap", "5"), ("seed", "3")]),
            run("sweep/again", 60.0, &[("cap", "5"), ("seed", "1")]),
        ];
        let curves = curves(&runs);
        let names: Vec<&str> = curves.iter().map(|curve| curve.shown.name.as_str()).collect();
        assert_eq!(names, ["cap-5, 2 seeds", "cap-9_seed-1", "cap-5_seed-3", "again"]);
        let table = spreads(&curves).expect("there are seeds");
        // The runs of `testing` take as many seconds as they have dB.
        let cells = ["cap-5, 2 seeds", "10", "31.00 (30.00 to 32.00)", "0.9000 (0.9000 to 0.9000)"];
        assert_eq!(table.rows[0][..4], cells);
        assert_eq!(table.rows[0][4..], ["31.0 (30.0 to 32.0)", "100 (100 to 100)"]);
        assert_eq!(table.rows[1][2], "40.00");
    }

    #[test]
    fn runs_measured_at_other_steps_stand_alone() {
        let mut runs = [run("a/1", 30.0, &[("seed", "1")]), run("a/2", 32.0, &[("seed", "2")])];
        assert_eq!(curves(&runs)[0].shown.name, "2 seeds");
        runs[1].eval.evaluations[0].step = 20;
        let curves = curves(&runs);
        assert_eq!(curves.len(), 2);
        assert!(spreads(&curves).is_none());
    }

    #[test]
    fn names_without_a_seed_are_listed() {
        let runs = [run("a/left", 30.0, &[("seed", "1")]), run("a/right", 32.0, &[("seed", "2")])];
        assert_eq!(curves(&runs)[0].shown.name, "left, right");
    }
}
