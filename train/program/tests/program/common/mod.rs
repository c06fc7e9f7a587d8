//! A tiny synthetic scene on disk and runs on it.
pub mod program;
pub mod streets;

use std::path::{Path, PathBuf};

use burn::tensor::Device;
use gs_burn::device::{BACKENDS, DeviceKind, select};
use gs_pipelines::still::Still;
use gs_pipelines::{Pipeline, Resolved, find, fit, resolve_overrides};
use gs_train::config::FitConfig;
use gs_train::fit::method::Method;
use gs_train::fit::photos::{Photo, Photos};
use gs_train::fit::session::Data;
use gs_train::fit::trainer::{StepReport, Trainer};
use gs_train::run::folder::{EvalFile, RunFolder};
use gs_train::run::watch::{Ending, Job};
use gs_worlds::deblur::{self, DeblurOptions};
use gs_worlds::extrapolation::{self, ExtrapolationOptions};
use gs_worlds::still::{self, StillOptions};
use gsburn::commands::train::train_and_report;
use toml::Table;

/// Points of the tiny scene.
pub const POINTS: usize = 150;

/// Names the backend that the tests use; without it they use the first of the build.
const TEST_DEVICE: &str = "GSBURN_TEST_DEVICE";

/// The device of the tests.
pub fn device() -> Device {
    named(&device_name())
}

/// Its name, for `--device` of a program that is compared with the tests' own process.
pub fn device_name() -> String {
    let first = || backends().next().expect("a backend is built").to_string();
    std::env::var(TEST_DEVICE).unwrap_or_else(|_| first())
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
    still_scene(folder, (40, 30))
}

/// The tiny scene in photos of another size.
pub fn still_scene(folder: &Path, (width, height): (usize, usize)) -> PathBuf {
    let path = folder.join("scene");
    let options = StillOptions {
        train_views: 5,
        test_views: 2,
        width,
        height,
        points: POINTS,
        seed: 1,
        ..StillOptions::default()
    };
    still::write(&path, &options, |_, _| ()).expect("the scene is written");
    path
}

/// A blurry video of six moments by five cameras, one of them held out.
pub fn video(folder: &Path) -> PathBuf {
    let path = folder.join("video");
    let options = DeblurOptions {
        world: deblur::World::Cube,
        width: 64,
        height: 48,
        cameras: 5,
        held_out: 1,
        frames: 6,
        ..DeblurOptions::default()
    };
    deblur::write(&path, &options, |_, _| {}).expect("the world is written");
    path
}

/// A small world with a future, photographed by `cameras`, one of them held out.
pub fn future(folder: &Path, world: extrapolation::World, (size, frames): (usize, usize), cameras: usize) -> PathBuf {
    let path = folder.join(world.name());
    let options = ExtrapolationOptions {
        width: size,
        height: size,
        cameras,
        held_out: 1,
        frames,
        ..ExtrapolationOptions::of(world)
    };
    extrapolation::write(&path, &options, |_, _| {}).expect("the world is written");
    path
}

/// A configuration of any pipeline for a run of `steps`, changed by `overrides`.
pub fn resolved(steps: usize, overrides: &[&str]) -> Resolved {
    let common =
        [format!("steps={steps}"), "eval.ms_ssim=false".into(), "eval.lpips=false".into(), "eval.images=1".into()];
    let all: Vec<String> = common.into_iter().chain(overrides.iter().map(|s| s.to_string())).collect();
    resolve_overrides(&all).unwrap_or_else(|error| panic!("{error}"))
}

/// The same as a table.
pub fn config(steps: usize, overrides: &[&str]) -> Table {
    resolved(steps, overrides).config
}

/// A configuration as the method sees it.
pub fn typed<M: Method>(config: &Table) -> FitConfig<M::Config> {
    FitConfig::from_table(config, "the test").expect("a valid configuration")
}

/// The pipeline that a configuration names.
pub fn pipeline(config: &Table) -> &'static dyn Pipeline {
    let name = config["pipeline"].as_str().expect("a name");
    find(name).expect("one of the list")
}

/// A static fit before its first step, and the first training photo.
pub struct Begun {
    pub config: FitConfig<<Still as Method>::Config>,
    pub data: Data<Still>,
    pub trainer: Trainer<Still>,
    pub photo: Photo<<Still as Method>::Extra>,
}

impl Begun {
    /// One step on the photo.
    pub fn step(&mut self) -> StepReport {
        let Self { config, data, trainer, photo } = self;
        trainer.step(std::slice::from_ref(photo), &data.scene.train, &data.cues, config)
    }
}

/// A trainer on the tiny scene at the beginning of `config`.
pub fn begun(config: &Table) -> Begun {
    begun_on(config, &device())
}

/// The same on a device.
pub fn begun_on(config: &Table, device: &Device) -> Begun {
    let folder = tempfile::tempdir().expect("a folder");
    let config = typed::<Still>(config);
    let scene = fit::load::<Still>(&tiny_scene(folder.path()), &config).expect("loads");
    let data = Data::new(scene, &config);
    let trainer = Trainer::begin(&data.scene, &data.cues, &config, data.facts, device);
    let photo = Photos::new(&data.scene.train, device, 0, |_, _, _| Default::default()).get(0);
    Begun { config, data, trainer, photo }
}

/// A job in `folder` on `dataset`.
pub fn job(dataset: &Path, folder: &Path, config: &Table) -> Job {
    Job {
        dataset: dataset.to_path_buf(),
        config: config.clone(),
        folder: RunFolder::vacant(folder).expect("a new folder"),
        device: device(),
        more_devices: Vec::new(),
        device_name: "test".into(),
        resume: false,
        stop_at: None,
        quiet: true,
        minutes: None,
        schedule_svg: Some(gsburn::report::schedule_svg),
    }
}

/// Runs.
pub fn train(job: &Job) -> anyhow::Result<Ending<EvalFile>> {
    train_and_report(pipeline(&job.config), job)
}

/// Runs to the end.
pub fn finish(job: &Job) -> EvalFile {
    match train(job).expect("the run succeeds") {
        Ending::Finished(eval) => eval,
        Ending::Interrupted(step) => panic!("interrupted after step {step}"),
    }
}

/// Runs to the end with an interruption after each step of `stops`.
pub fn finish_interrupted(job: &Job, stops: &[usize]) -> EvalFile {
    let mut job = job.clone();
    for stop in stops {
        job.stop_at = Some(*stop);
        assert!(matches!(train(&job), Ok(Ending::Interrupted(step)) if step == *stop));
        job.resume = true;
    }
    job.stop_at = None;
    finish(&job)
}

/// Runs `whole` to the end, and `resumed`, which is the same, interrupted after each step of `stops`. Both have the
/// same bits after the last step, `steps`.
pub fn resumes_to_the_same_bits([whole, resumed]: [Job; 2], stops: &[usize], steps: usize) {
    finish(&whole);
    finish_interrupted(&resumed, stops);
    let bits = |job: &Job| std::fs::read(job.folder.checkpoint(steps)).expect("saved");
    assert!(bits(&whole) == bits(&resumed), "the resumed run differs");
}

/// The page of a finished run `folder/name` has a PSNR as a card, `said` dB, and its checkpoint is the scene that was
/// measured.
pub fn is_reported(folder: &Path, name: &str, job: &Job, (label, said): (&str, f64)) {
    let report = std::fs::read_to_string(job.folder.report()).expect("read");
    assert!(report.contains(&format!("<span>{label}</span><b>{said:.2} dB</b>")), "no card");
    program::succeeds(folder, &["eval", name, "--out", "eval.json", "--device", &device_name()]);
    let (again, first) = (read_json(&folder.join("eval.json")), read_json(&job.folder.eval()));
    for key in ["psnr", "ssim", "views", "figures", "compared", "split"] {
        assert_eq!(again[key], first[key], "{key}");
    }
}

/// Rewrites the frames of a data set's description.
pub fn edit(world: &Path, file: &str, change: impl FnOnce(&mut Vec<serde_json::Value>)) {
    let path = world.join(file);
    let text = std::fs::read_to_string(&path).expect("a file");
    let mut json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    change(json["frames"].as_array_mut().expect("frames"));
    std::fs::write(&path, json.to_string()).expect("written");
}

/// A JSON file.
pub fn read_json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).expect("read")).expect("JSON")
}
