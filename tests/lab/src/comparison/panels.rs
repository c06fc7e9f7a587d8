//! The charts of a comparison: accuracy against seconds (logarithmic) and against count, with labels and colours for
//! the settings that differ.

use std::collections::BTreeSet;

use gs_train::run::measured::Evaluation;
use gsburn::report::comparison::{ComparedRun, by_cpu, differing_keys, pareto_front, seconds, settings};

use super::scatter::{COLORS, Dot, Scatter};
use super::seeds::{Curve, Spread};
use super::star::Star;

/// Largest number of runs that are all labelled; of more, those on the front are.
const LABELLED: usize = 24;

/// Counts that differ by less than this share are equal, and a chart over them would show nothing.
const SAME_COUNT: f64 = 0.05;

/// Measurements of a run from which on they are a curve, whose SSIM is worth a chart beside the PSNR.
const CURVE: usize = 3;

/// The axis of whole images.
const WHOLE: &str = "held-out PSNR, dB";

impl Scatter {
    /// Whether the chart shows the PSNR of whole images against time.
    pub(super) fn is_of_whole_images(&self) -> bool {
        self.log_x && self.y == WHOLE
    }
}

type Value<'a> = dyn Fn(&Evaluation) -> Option<f64> + 'a;

/// Charts of moving parts, if they were measured, then of whole images; each against seconds, and against the
/// number of Gaussians if that differs. Runs that were measured several times on the way also have a chart of SSIM.
///
/// `curves` are those of the runs: a curve of several seeds is drawn by its means, with a bar from the lowest to
/// the highest.
pub fn panels(runs: &[ComparedRun], curves: &[Curve]) -> Vec<Scatter> {
    let cpu = by_cpu(runs);
    let marks = Marks::new(&curves.iter().map(|curve| curve.shown.clone()).collect::<Vec<_>>());
    let time = if cpu { "CPU seconds of training, all threads" } else { "wall-clock seconds of training" };
    let (moving, whole): (&Value, &Value) = (&|e| e.moving().map(|m| m.psnr), &|e| Some(e.mean().psnr));
    let (cost, count): (&Value, &Value) = (&|e| Some(seconds(e, cpu)), &|e| Some(e.measured.size.gaussians as f64));
    let measured = runs.iter().flat_map(ComparedRun::measurements).any(|e| e.moving().is_some());
    let (best, best_title, best_axis) = match measured {
        true => (moving, "Moving parts", "held-out PSNR of moving parts, dB"),
        false => (whole, "Whole image", WHOLE),
    };
    let over_time =
        |title: &str, y, shown| Scatter { log_x: true, ..marks.chart(curves, title, (time, cost), y, shown) };
    let mut charts = vec![over_time(&format!("{best_title} against time"), (best_axis, best), decibels)];
    if measured {
        charts.push(over_time("Whole image against time", (WHOLE, whole), decibels));
    }
    if runs.iter().any(|run| run.measurements().len() >= CURVE) {
        let ssim: &Value = &|e| Some(e.mean().ssim);
        charts.push(over_time("Whole image against time: SSIM", ("held-out SSIM", ssim), plain));
    }
    if counts_differ(runs) {
        let title = format!("{best_title} against size");
        charts.push(marks.chart(curves, &title, ("Gaussians", count), (best_axis, best), decibels));
    }
    charts
}

fn decibels(value: f64) -> String {
    format!("{value:.2} dB")
}

fn plain(value: f64) -> String {
    format!("{value:.4}")
}

fn counts_differ(runs: &[ComparedRun]) -> bool {
    let counts = runs.iter().flat_map(ComparedRun::measurements).map(|e| e.measured.size.gaussians as f64);
    let [low, high] = counts.fold([f64::INFINITY, 0.0], |[low, high], n| [n.min(low), n.max(high)]);
    high > low * (1.0 + SAME_COUNT)
}

/// Colours and labels of the points.
#[derive(Debug)]
struct Marks {
    /// Index into the colours by run.
    colors: Vec<usize>,
    /// Label by run.
    labels: Vec<String>,
    /// The meaning of each colour in use; empty for a single colour.
    legend: Vec<(String, usize)>,
    /// Settings that are equal in all runs.
    note: String,
}

impl Marks {
    /// The colour stands for the first of [`settings`] in which the runs differ, the label for the others. If those do
    /// not distinguish the runs, their names do. Of runs that depart from one of them in one setting each, the colour
    /// stands for that setting.
    fn new(runs: &[ComparedRun]) -> Self {
        if let Some(Star { colors, labels, legend }) = Star::of(runs) {
            return Self { colors, labels, legend, note: note(runs) };
        }
        let values = |key: &str| {
            let mut values: Vec<&str> = runs
                .iter()
                .filter_map(|run| Some(run.setting(key)?.value.as_str()))
                .collect::<BTreeSet<_>>()
                .into_iter()
                .collect();
            // Numbers are sorted by value, not by spelling.
            values.sort_by_key(|value| value.parse::<usize>().unwrap_or(0));
            values
        };
        let keys: Vec<&str> = settings(runs).into_iter().map(|(_, key)| key).collect();
        let differing: Vec<&str> = keys.into_iter().filter(|key| values(key).len() > 1).collect();
        let colored = differing.iter().copied().find(|key| values(key).len() < COLORS.len());
        // Without such a setting a few runs have a colour each.
        let each = colored.is_none() && (2..COLORS.len()).contains(&runs.len());
        let colors = runs.iter().enumerate().map(|(i, run)| match colored {
            None => i * usize::from(each),
            // A run for which the setting has no meaning has the last colour, which no value has.
            Some(key) => run
                .setting(key)
                .and_then(|setting| values(key).iter().position(|v| *v == setting.value))
                .unwrap_or(COLORS.len() - 1),
        });
        let labelled: Vec<&str> = differing.iter().copied().filter(|key| Some(*key) != colored).collect();
        let parts = |run: &ComparedRun, keys: &[&str]| -> String {
            let parts = keys.iter().filter_map(|key| Some(run.setting(key)?.label.clone()));
            parts.collect::<Vec<_>>().join(", ")
        };
        let whole: BTreeSet<String> = runs.iter().map(|run| parts(run, &differing)).collect();
        let told_apart = whole.len() == runs.len() && !differing.is_empty();
        let labels = runs.iter().map(|run| match (told_apart, parts(run, &labelled)) {
            (false, _) => run.name.clone(),
            (true, label) if label.is_empty() => parts(run, &differing),
            (true, label) => label,
        });
        let label = |key: &str, value: &str| {
            let settings = runs.iter().filter_map(|run| run.setting(key));
            settings.into_iter().find(|setting| setting.value == value).map(|setting| setting.label.clone())
        };
        let labels: Vec<String> = labels.collect();
        let legend = match colored {
            Some(key) => {
                let values = values(key).into_iter().enumerate();
                values.filter_map(|(color, value)| Some((label(key, value)?, color))).collect()
            }
            None if each => labels.iter().cloned().zip(0..).collect(),
            None => Vec::new(),
        };
        Self { colors: colors.collect(), labels, legend, note: note(runs) }
    }

    fn chart(
        &self,
        curves: &[Curve],
        title: &str,
        (x, x_of): (&str, &Value),
        (y, y_of): (&str, &Value),
        shown: fn(f64) -> String,
    ) -> Scatter {
        let mut dots = Vec::new();
        let mut trails = Vec::new();
        for (i, curve) in curves.iter().enumerate() {
            let spread = |of: &Value, measured: &[&Evaluation]| -> Option<Spread> {
                Spread::of(&measured.iter().map(|e| of(e)).collect::<Option<Vec<_>>>()?)
            };
            let measured: Vec<(usize, Spread, Spread)> = curve
                .measurements()
                .filter_map(|measured| Some((measured[0].step, spread(x_of, &measured)?, spread(y_of, &measured)?)))
                .collect();
            for (k, (step, x, y)) in measured.iter().enumerate() {
                let last = k + 1 == measured.len();
                let label = last.then(|| self.labels[i].clone());
                let range = curve.is_of_seeds().then_some((y.low, y.high));
                let told = range.map_or(String::new(), |(low, high)| format!(" ({} to {})", shown(low), shown(high)));
                let tip = format!("{}, step {step}: {}{told} at {:.1}", curve.shown.name, shown(y.mean), x.mean);
                dots.push(Dot { x: x.mean, y: y.mean, range, color: self.colors[i], label, last, front: false, tip });
            }
            trails.push((self.colors[i], measured.iter().map(|(_, x, y)| (x.mean, y.mean)).collect()));
        }
        let front = pareto_front(&dots.iter().map(|dot| (dot.x, dot.y)).collect::<Vec<_>>());
        let crowded = curves.len() > LABELLED;
        for (dot, front) in dots.iter_mut().zip(front) {
            dot.front = front;
            dot.label = dot.label.take().filter(|_| front || !crowded);
        }
        Scatter {
            title: title.into(),
            note: self.note.clone(),
            x: x.into(),
            y: y.into(),
            dots,
            trails,
            log_x: false,
            legend: self.legend.clone(),
        }
    }
}

/// The [`settings`] that all runs share, and the other keys in which they differ.
fn note(runs: &[ComparedRun]) -> String {
    let settings = settings(runs);
    let common = settings.iter().filter_map(|(_, key)| {
        let setting = runs.first()?.setting(key)?;
        runs.iter().all(|run| run.setting(key) == Some(setting)).then(|| setting.label.clone())
    });
    let common: Vec<String> = common.collect();
    let others = differing_keys(runs).into_iter().filter(|key| settings.iter().all(|(_, setting)| setting != key));
    let others: Vec<String> = others.collect();
    let mut parts = Vec::new();
    if runs.len() > 1 && !common.is_empty() {
        parts.push(format!("all: {}", common.join(", ")));
    }
    match others.len() {
        0 => {}
        1..=3 => parts.push(format!("also differing: {}", others.join(", "))),
        n => parts.push(format!("{n} other values differ too")),
    }
    parts.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::seeds::curves;
    use crate::comparison::testing::{run, setting};

    fn of(name: &str, psnr: f64, settings: &[(&str, &str, &str, &str)], values: &[(&str, &str)]) -> ComparedRun {
        let mut run = run(name, psnr, Some(psnr - 5.0));
        run.eval.settings = settings.iter().map(|(n, key, value, label)| setting(n, key, value, label)).collect();
        let all = settings.iter().map(|(_, key, value, _)| (*key, *value)).chain(values.iter().copied());
        run.values = all.map(|(key, value)| (key.to_string(), value.to_string())).collect();
        run
    }

    const CAP: (&str, &str, &str, &str) = ("cap", "density.cap", "100000", "cap 100k");
    const INTEGRATE: (&str, &str, &str, &str) = ("blur", "blur.mode", "integrate", "integrate");

    #[test]
    fn legend_and_labels_say_only_what_differs() {
        let runs = [
            of("a", 20.0, &[INTEGRATE, ("N", "blur.samples", "15", "N 15"), CAP], &[]),
            of("b", 21.0, &[INTEGRATE, ("N", "blur.samples", "7", "N 7"), CAP], &[]),
            of("c", 22.0, &[("blur", "blur.mode", "none", "no blur model"), CAP], &[]),
        ];
        let marks = Marks::new(&runs);
        assert_eq!(marks.legend, [("integrate".to_string(), 0), ("no blur model".to_string(), 1)]);
        // The number of instants has no meaning without a blur model, so the colour's own label is used.
        assert_eq!(marks.labels, ["N 15", "N 7", "no blur model"]);
        assert_eq!(marks.note, "all: cap 100k");
        let numbers = Marks::new(&runs[..2]);
        assert_eq!(numbers.legend, [("N 7".to_string(), 0), ("N 15".to_string(), 1)], "by size");
        assert_eq!(numbers.colors, [1, 0]);
    }

    #[test]
    fn runs_that_differ_elsewhere_have_their_names() {
        let pseudo = |value| [("prior.pseudo", value)];
        let runs = [of("with", 20.0, &[CAP], &pseudo("true")), of("without", 21.0, &[CAP], &pseudo("false"))];
        let marks = Marks::new(&runs);
        assert_eq!(marks.labels, ["with", "without"]);
        assert_eq!(marks.legend, [("with".to_string(), 0), ("without".to_string(), 1)]);
        assert!(marks.note.contains("also differing: prior.pseudo"), "{marks:?}");
        let charts = panels(&runs, &curves(&runs));
        assert_eq!(charts.len(), 2, "moving parts and whole image; the count is the same");
        assert!(charts[0].x.starts_with("CPU seconds"));
    }

    #[test]
    fn a_static_scene_has_no_moving_parts() {
        let mut still = run("still", 30.0, None);
        still.eval.evaluations[0].cost.cpu_seconds = None;
        let still = [still];
        let charts = panels(&still, &curves(&still));
        assert_eq!(charts.len(), 1);
        assert_eq!((charts[0].y.as_str(), charts[0].dots[0].x), ("held-out PSNR, dB", 60.0));
        assert!(charts[0].x.starts_with("wall-clock") && charts[0].dots[0].front);
    }
}
