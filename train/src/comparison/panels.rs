//! What the charts of a comparison show: accuracy against seconds and against count, points told apart by what differs.

use std::collections::BTreeSet;

use super::table::differing_keys;
use super::{ComparedRun, SETTINGS, by_cpu, pareto_front, seconds};
use crate::evaluate::Evaluation;
use crate::report::scatter::{COLORS, Dot, Scatter};

/// Runs up to which every one has its label; of more, those on the front do.
const LABELLED: usize = 24;

/// Counts closer together than this share are one, and a chart over them shows nothing.
const SAME_COUNT: f64 = 0.05;

/// The charts, and what their points and colours mean.
#[derive(Debug)]
pub struct Panels {
    /// The charts.
    pub charts: Vec<Scatter>,
}

type Value<'a> = dyn Fn(&Evaluation) -> Option<f64> + 'a;

impl Panels {
    /// Moving parts first, where they were measured, then whole images; each against seconds, and against the number of
    /// Gaussians where that differs.
    pub fn new(runs: &[ComparedRun]) -> Self {
        let cpu = by_cpu(runs);
        let marks = Marks::new(runs);
        let time = if cpu { "CPU seconds of training, all threads" } else { "wall-clock seconds of training" };
        let (moving, whole): (&Value, &Value) = (&|e| e.moving.as_ref().map(|m| m.psnr), &|e| Some(e.mean.psnr));
        let (cost, count): (&Value, &Value) = (&|e| Some(seconds(e, cpu)), &|e| Some(e.gaussians as f64));
        let measured = runs.iter().flat_map(ComparedRun::measurements).any(|e| e.moving.is_some());
        let (best, best_title, best_axis) = match measured {
            true => (moving, "Moving parts", "held-out PSNR of moving parts, dB"),
            false => (whole, "Whole image", "held-out PSNR, dB"),
        };
        let mut charts =
            vec![marks.chart(runs, &format!("{best_title} against time"), (time, cost), (best_axis, best))];
        if measured {
            charts.push(marks.chart(runs, "Whole image against time", (time, cost), ("held-out PSNR, dB", whole)));
        }
        if counts_differ(runs) {
            let title = format!("{best_title} against size");
            charts.push(marks.chart(runs, &title, ("Gaussians", count), (best_axis, best)));
        }
        Self { charts }
    }
}

fn counts_differ(runs: &[ComparedRun]) -> bool {
    let counts = runs.iter().flat_map(ComparedRun::measurements).map(|e| e.gaussians as f64);
    let [low, high] = counts.fold([f64::INFINITY, 0.0], |[low, high], n| [n.min(low), n.max(high)]);
    high > low * (1.0 + SAME_COUNT)
}

/// How points are told apart.
#[derive(Debug)]
struct Marks {
    /// Index into the colours by run.
    colors: Vec<usize>,
    /// Label by run.
    labels: Vec<String>,
    /// What each colour in use means; empty when there is one.
    legend: Vec<(String, usize)>,
    /// What all runs have in common.
    note: String,
}

impl Marks {
    /// Colour says the first of [`SETTINGS`] in which the runs differ, the label says the others. Where that does not tell
    /// runs apart, their names do.
    fn new(runs: &[ComparedRun]) -> Self {
        let values = |key: &str| {
            let mut values: Vec<&str> =
                runs.iter().filter_map(|run| run.setting(key)).collect::<BTreeSet<_>>().into_iter().collect();
            // Numbers by size, not by spelling.
            values.sort_by_key(|value| value.parse::<usize>().unwrap_or(0));
            values
        };
        let differing: Vec<(&str, &str)> = SETTINGS.into_iter().filter(|(_, key)| values(key).len() > 1).collect();
        let colored = differing.iter().copied().find(|(_, key)| values(key).len() < COLORS.len());
        let colors = runs.iter().map(|run| match colored {
            None => 0,
            // What the setting means nothing to has the last colour, which no value takes.
            Some((_, key)) => run
                .setting(key)
                .and_then(|value| values(key).iter().position(|v| *v == value))
                .unwrap_or(COLORS.len() - 1),
        });
        let labelled: Vec<(&str, &str)> = differing.iter().copied().filter(|s| Some(*s) != colored).collect();
        let parts = |run: &ComparedRun, settings: &[(&str, &str)]| -> String {
            let parts = settings.iter().filter_map(|(name, key)| Some(in_words(name, run.setting(key)?)));
            parts.collect::<Vec<_>>().join(", ")
        };
        let whole: BTreeSet<String> = runs.iter().map(|run| parts(run, &differing)).collect();
        let told_apart = whole.len() == runs.len() && !differing.is_empty();
        let labels = runs.iter().map(|run| match (told_apart, parts(run, &labelled)) {
            (false, _) => run.name.clone(),
            (true, label) if label.is_empty() => parts(run, &differing),
            (true, label) => label,
        });
        let legend = colored.map_or(Vec::new(), |(name, key)| {
            values(key).iter().enumerate().map(|(color, value)| (in_words(name, value), color)).collect()
        });
        Self { colors: colors.collect(), labels: labels.collect(), legend, note: note(runs) }
    }

    fn chart(
        &self,
        runs: &[ComparedRun],
        title: &str,
        (x, x_of): (&str, &Value),
        (y, y_of): (&str, &Value),
    ) -> Scatter {
        let mut dots = Vec::new();
        let mut trails = Vec::new();
        for (i, run) in runs.iter().enumerate() {
            let measured: Vec<(&Evaluation, (f64, f64))> =
                run.measurements().iter().filter_map(|e| Some((e, (x_of(e)?, y_of(e)?)))).collect();
            for (k, (e, (x, y))) in measured.iter().enumerate() {
                let last = k + 1 == measured.len();
                let label = last.then(|| self.labels[i].clone());
                let tip = format!("{}, step {}: {y:.2} dB at {x:.1}", run.name, e.step);
                dots.push(Dot { x: *x, y: *y, color: self.colors[i], label, last, front: false, tip });
            }
            trails.push((self.colors[i], measured.into_iter().map(|(_, point)| point).collect()));
        }
        let front = pareto_front(&dots.iter().map(|dot| (dot.x, dot.y)).collect::<Vec<_>>());
        let crowded = runs.len() > LABELLED;
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
            legend: self.legend.clone(),
        }
    }
}

/// A setting as a chart says it: `integrate`, `no blur model`, `N 7`, `cap 20k`.
fn in_words(name: &str, value: &str) -> String {
    match (name, value.parse::<usize>()) {
        ("blur", _) if value == "none" => "no blur model".into(),
        ("blur", _) => value.into(),
        (_, Ok(number)) if number >= 1000 && number.is_multiple_of(100) => {
            format!("{name} {}k", number as f64 / 1000.0)
        }
        _ => format!("{name} {value}"),
    }
}

/// What all runs have in common of [`SETTINGS`], and in which other keys they differ.
fn note(runs: &[ComparedRun]) -> String {
    let common = SETTINGS.iter().filter_map(|(name, key)| {
        let value = runs.first()?.setting(key)?;
        runs.iter().all(|run| run.setting(key) == Some(value)).then(|| in_words(name, value))
    });
    let common: Vec<String> = common.collect();
    let others = differing_keys(runs).into_iter().filter(|key| SETTINGS.iter().all(|(_, setting)| setting != key));
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
    use crate::comparison::gather::values;
    use crate::evaluate::Scores;
    use crate::experiment::Config;
    use crate::run_folder::{EvalFile, RunFolder};

    fn run(name: &str, psnr: f64, overrides: &[&str]) -> ComparedRun {
        let overrides: Vec<String> = overrides.iter().map(|text| text.to_string()).collect();
        let evaluation: Evaluation = serde_json::from_value(serde_json::json!({
            "step": 10, "split": "test", "psnr": psnr, "ssim": 0.9, "ms_ssim": null, "lpips": null,
            "lpips_network": null, "lpips_reason": null, "ms_ssim_reason": null, "gaussians": 100, "bytes": 4400,
            "seconds": 2.0 * psnr, "cpu_seconds": psnr, "peak_memory_bytes": null, "views": []
        }))
        .expect("an evaluation");
        let moving = Evaluation { moving: Some(Scores { psnr: psnr - 5.0, ..Scores::default() }), ..evaluation };
        ComparedRun {
            name: name.into(),
            folder: RunFolder::at(name),
            values: values(&Config::resolve(None, &overrides).expect("valid")),
            eval: EvalFile {
                name: name.into(),
                dataset: "world".into(),
                device: "flex".into(),
                steps: 10,
                cap: 100,
                skipped_steps: 0,
                predicted_memory_bytes: 0,
                total_seconds: 0.0,
                last: moving.clone(),
                evaluations: vec![moving],
            },
        }
    }

    const MOVING: &str = "pipeline=taylormode";

    #[test]
    fn legend_and_labels_say_only_what_differs() {
        let runs = [
            run("a", 20.0, &[MOVING, "blur.mode=integrate", "blur.samples=15"]),
            run("b", 21.0, &[MOVING, "blur.mode=integrate", "blur.samples=7"]),
            run("c", 22.0, &[MOVING, "blur.mode=none", "blur.samples=7"]),
        ];
        let marks = Marks::new(&runs);
        assert_eq!(marks.legend, [("integrate".to_string(), 0), ("no blur model".to_string(), 1)]);
        // Instants mean nothing without a blur model, so there the colour's own words are the label.
        assert_eq!(marks.labels, ["N 15", "N 7", "no blur model"]);
        assert_eq!(marks.note, "all: order 3, cap 100k");
        let numbers = Marks::new(&runs[..2]);
        assert_eq!(numbers.legend, [("N 7".to_string(), 0), ("N 15".to_string(), 1)], "by size");
        assert_eq!(numbers.colors, [1, 0]);
    }

    #[test]
    fn runs_that_differ_elsewhere_have_their_names() {
        let runs = [run("with", 20.0, &[MOVING]), run("without", 21.0, &[MOVING, "prior.pseudo=false"])];
        let marks = Marks::new(&runs);
        assert_eq!(marks.labels, ["with", "without"]);
        assert!(marks.legend.is_empty() && marks.note.contains("also differing: prior.pseudo"), "{marks:?}");
        let charts = Panels::new(&runs).charts;
        assert_eq!(charts.len(), 2, "moving parts and whole image; the count is the same");
        assert!(charts[0].x.starts_with("CPU seconds"));
    }

    #[test]
    fn a_still_scene_has_no_moving_parts() {
        let mut still = run("still", 30.0, &["density.cap=5000"]);
        still.eval.evaluations[0].moving = None;
        still.eval.evaluations[0].cpu_seconds = None;
        let charts = Panels::new(&[still]).charts;
        assert_eq!(charts.len(), 1);
        assert_eq!((charts[0].y.as_str(), charts[0].dots[0].x), ("held-out PSNR, dB", 60.0));
        assert!(charts[0].x.starts_with("wall-clock") && charts[0].dots[0].front);
    }
}
