//! A tiny synthetic scene on disk and runs on it.
// Each test file uses its own share of these helpers.
#![allow(dead_code)]

use std::path::{Path, PathBuf};

use burn::tensor::Device;
use gs_burn::device::{BACKENDS, DeviceKind, select};
use gs_datasets::Scene;
use gs_datasets::synthetic::{DemoOptions, demo_scene};
use gs_train::data::{Photo, Photos};
use gs_train::experiment::Config;
use gs_train::run::{Ending, RunRequest, run};
use gs_train::run_folder::RunFolder;
use gs_train::step::Trainer;

/// Points of the tiny scene.
pub const POINTS: usize = 150;

/// Names the backend that the tests use; without it they use the first of the build.
const TEST_DEVICE: &str = "GSBURN_TEST_DEVICE";

/// The device of the tests.
pub fn device() -> Device {
    let first = || backends().next().expect("a backend is built").to_string();
    named(&std::env::var(TEST_DEVICE).unwrap_or_else(|_| first()))
}

/// The backends of this build, those on the CPU first.
pub fn backends() -> impl Iterator<Item = &'static str> {
    BACKENDS.into_iter().filter(|kind| kind.is_built()).map(DeviceKind::name)
}

/// The device of a backend.
pub fn named(backend: &str) -> Device {
    select(backend).unwrap_or_else(|error| panic!("{backend}: {error}"))
}

/// Writes the tiny scene into `folder` and returns its path.
pub fn tiny_scene(folder: &Path) -> PathBuf {
    let path = folder.join("scene");
    let options = DemoOptions { train_views: 5, test_views: 2, width: 40, height: 30, points: POINTS, seed: 1 };
    demo_scene(&path, &options).expect("the scene is written");
    path
}

/// A configuration for a run of `steps`, changed by `overrides`.
pub fn config(steps: usize, overrides: &[&str]) -> Config {
    let common =
        [format!("steps={steps}"), "eval.ms_ssim=false".into(), "eval.lpips=false".into(), "eval.images=1".into()];
    let all: Vec<String> = common.into_iter().chain(overrides.iter().map(|s| s.to_string())).collect();
    Config::resolve(None, &all).expect("a valid configuration")
}

/// The tiny scene, a trainer at the beginning of `config`, and the first training photo.
pub fn begun(config: &Config) -> (Scene, Trainer, Photo) {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = config.load(&tiny_scene(folder.path())).expect("loads");
    let trainer = Trainer::begin(&scene, None, config, &device());
    let photo = Photos::new(&scene.train, &device(), 0).get(0);
    (scene, trainer, photo)
}

/// What to run in `folder` on `dataset`.
pub fn request(dataset: &Path, folder: &Path, config: &Config) -> RunRequest {
    RunRequest {
        dataset: dataset.to_path_buf(),
        config: config.clone(),
        folder: RunFolder::vacant(folder).expect("a new folder"),
        device: device(),
        device_name: "test".into(),
        resume: false,
        stop_at: None,
        quiet: true,
    }
}

/// Runs to the end.
pub fn finish(request: &RunRequest) -> gs_train::run_folder::EvalFile {
    match run(request).expect("the run succeeds") {
        Ending::Finished(eval) => *eval,
        Ending::Interrupted(step) => panic!("interrupted after step {step}"),
    }
}
