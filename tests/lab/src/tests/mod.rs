//! The experiments and the comparisons as they are used.
//!
//! Tests run the small version of each experiment. The full ones take minutes each:
//! `cargo test --release -p gs-lab -- --ignored full`; docs/stability has their figures.

mod comparison;
mod flux4d;
mod misses;
mod sparsedyn;
mod taylormode;

use std::path::{Path, PathBuf};

use burn::tensor::Device;
use gs_burn::device::{BACKENDS, select};
use gs_worlds::still::{self, StillOptions};

use crate::experiments::{Outcome, PIPELINES, Request, run};
use misses::{FULL, QUICK, holds};

/// Names the backend that the tests use; without it they use the first of the build.
const TEST_DEVICE: &str = "GSBURN_TEST_DEVICE";

/// The device of the tests.
fn device() -> Device {
    let first = BACKENDS.into_iter().find(|kind| kind.is_built()).expect("a backend is built").name();
    let name = std::env::var(TEST_DEVICE).unwrap_or_else(|_| first.into());
    select(&name).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// An experiment of a pipeline in a folder.
fn experiment(folder: &Path, (pipeline, name): (&'static str, &str), quick: bool) -> anyhow::Result<Outcome> {
    let experiments = PIPELINES.iter().find(|(known, _)| *known == pipeline).expect("a pipeline").1;
    let request =
        Request { out: folder.into(), only: vec![name.into()], data: None, quick, device: device(), quiet: true };
    Ok(run(pipeline, experiments, &request)?.remove(0))
}

/// A small version, whose files nobody looks at.
fn quick(pipeline: &'static str, name: &str) -> Outcome {
    let folder = tempfile::tempdir().expect("a folder");
    experiment(folder.path(), (pipeline, name), true).expect("the experiment runs")
}

/// The experiments of a pipeline that run without being named, but `own`, which have tests of their own.
fn names(pipeline: &str, own: &[&str]) -> Vec<&'static str> {
    let (_, experiments) = PIPELINES.iter().find(|(known, _)| *known == pipeline).expect("a pipeline");
    let usual = experiments.iter().filter(|experiment| !experiment.on_request);
    usual.map(|experiment| experiment.name).filter(|name| !own.contains(name)).collect()
}

/// Small versions keep every bound but their known misses, and draw something.
fn all_hold(pipeline: &'static str, own: &[&str]) {
    let mut wrong = Vec::new();
    for name in names(pipeline, own) {
        let outcome = quick(pipeline, name);
        wrong.extend(misses::wrong(&outcome, QUICK));
        for figure in &outcome.figures {
            assert!(figure.chart.series.iter().any(|series| series.is_visible()), "{} is empty", figure.file);
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The points of a figure's series.
fn points(outcome: &Outcome, file: &str, series: &str) -> Vec<(f64, f64)> {
    let figure = outcome.figures.iter().find(|figure| figure.file == file).expect("the figure is drawn");
    let found = figure.chart.series.iter().find(|found| found.name() == series);
    found.unwrap_or_else(|| panic!("{file} has no series {series}")).points().to_vec()
}

/// The value of the first criterion whose description contains `part`.
fn value(outcome: &Outcome, part: &str) -> f64 {
    let criterion = outcome.criteria.iter().find(|criterion| criterion.what.contains(part));
    let criterion = criterion.unwrap_or_else(|| panic!("{}: no criterion on {part:?}", outcome.name));
    criterion.value.unwrap_or_else(|| panic!("{}: {part:?} was not measured", outcome.name))
}

#[test]
#[ignore = "trains for an hour"]
fn full_experiments_keep_their_bounds() {
    for (pipeline, _) in PIPELINES {
        for name in names(pipeline, &[]) {
            let folder = tempfile::tempdir().expect("a folder");
            holds(&experiment(folder.path(), (pipeline, name), false).expect("the experiment runs"), FULL);
        }
    }
}

#[test]
fn unknown_names_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for (pipeline, name, known) in
        [("taylormode", "directions", "direction"), ("sparsedyn", "horizons", "horizon, views")]
    {
        let message = experiment(folder.path(), (pipeline, name), true).expect_err("unknown").to_string();
        assert!(message.contains(name) && message.contains(known), "{message}");
    }
}

/// Writes a tiny static scene and returns its path.
pub(crate) fn tiny_scene(folder: &Path) -> PathBuf {
    let path = folder.join("scene");
    let options = StillOptions {
        train_views: 5,
        test_views: 2,
        width: 40,
        height: 30,
        points: 150,
        seed: 1,
        ..StillOptions::default()
    };
    still::write(&path, &options, |_, _| ()).expect("the scene is written");
    path
}
