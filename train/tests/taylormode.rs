//! The pipeline for blurry video: resumes to the same bits, goes on without priors and says so, and its commands work.

mod common;

use std::path::{Path, PathBuf};

use gs_datasets::synthetic::deblur::{self, DeblurOptions, World};
use gs_train::run::{Ending, RunRequest, run};
use gs_train::run_folder::EvalFile;

const STEPS: usize = 40;

/// A set of four cameras and five frames.
fn tiny_world(folder: &Path) -> PathBuf {
    let path = folder.join("world");
    let options = DeblurOptions {
        world: World::Sphere,
        width: 64,
        height: 48,
        cameras: 5,
        held_out: 1,
        frames: 5,
        ..DeblurOptions::default()
    };
    deblur::write(&path, &options, |_, _| {}).expect("the world is written");
    path
}

const OVERRIDES: [&str; 9] = [
    "pipeline=taylormode",
    "model.sh_degree=1",
    "density.start=4",
    "density.every=10",
    "density.growth=0.2",
    "density.cap=1500",
    "motion.points=200",
    "motion.select_every=10",
    "blur.samples=3",
];

fn request(world: &Path, folder: &Path, more: &[&str]) -> RunRequest {
    let overrides: Vec<&str> = OVERRIDES.iter().chain(more).copied().collect();
    common::request(world, folder, &common::config(STEPS, &overrides))
}

fn finish_in(folder: &Path, world: &Path, name: &str, more: &[&str]) -> EvalFile {
    common::finish(&request(world, &folder.join(name), more))
}

/// Interrupted twice, and on one thread: the same checkpoint.
fn resumes_to_the_same_bits(more: &[&str]) {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = tiny_world(folder);
    let checkpoint =
        |request: &RunRequest| std::fs::read(request.folder.checkpoint(STEPS)).expect("the last checkpoint");
    let whole = request(&world, &folder.join("whole"), more);
    common::finish(&whole);

    let mut resumed = request(&world, &folder.join("resumed"), more);
    for stop in [13, 27] {
        resumed.stop_at = Some(stop);
        assert!(matches!(run(&resumed), Ok(Ending::Interrupted(step)) if step == stop));
        resumed.resume = true;
    }
    resumed.stop_at = None;
    common::finish(&resumed);
    assert!(checkpoint(&whole) == checkpoint(&resumed), "the resumed run differs");

    let one_thread = request(&world, &folder.join("one"), more);
    rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool").install(|| common::finish(&one_thread));
    assert!(checkpoint(&whole) == checkpoint(&one_thread), "one thread gives other bits");
}

#[test]
fn the_exact_formation_resumes_to_the_same_bits() {
    resumes_to_the_same_bits(&["motion.remainder=on"]);
}

#[test]
fn the_warp_resumes_to_the_same_bits() {
    resumes_to_the_same_bits(&["blur.mode=warp", "blur.decouple=true"]);
}

#[test]
fn every_formation_trains_and_is_measured() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = tiny_world(folder);
    let modes: [(&str, &[&str]); 5] = [
        ("integrate", &["blur.mode=integrate"]),
        ("decoupled", &["blur.mode=integrate", "blur.decouple=true"]),
        ("warp", &["blur.mode=warp"]),
        ("network", &["blur.mode=warp", "blur.velocity=network"]),
        ("none", &["blur.mode=none"]),
    ];
    for (name, more) in modes {
        let eval = finish_in(folder, &world, name, more);
        let motion = eval.last.motion.as_ref().expect("a moving scene");
        assert_eq!(eval.skipped_steps, 0, "{name}");
        assert!(eval.last.moving.as_ref().expect("the truth's mask").psnr > 5.0, "{name}");
        assert!(motion.blurry_psnr.expect("the truth's blurry photo") > 5.0, "{name}");
        assert!(motion.velocity_angle.is_some() && motion.cost.moving > 0, "{name}: {motion:?}");
    }
}

#[test]
fn a_set_without_times_is_refused_in_a_sentence() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let still = common::tiny_scene(folder);
    let error = run(&request(&still, &folder.join("run"), &[])).expect_err("no times").to_string();
    assert!(error.contains("expected a time for each frame") && !error.contains('\n'), "{error}");
}

#[test]
fn without_priors_it_goes_on_by_evidence() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let path = folder.join("world");
    let options = DeblurOptions {
        world: World::Cube,
        width: 64,
        height: 48,
        cameras: 5,
        held_out: 1,
        frames: 5,
        points: 0,
        ..DeblurOptions::default()
    };
    deblur::write(&path, &options, |_, _| {}).expect("the world is written");
    for masks in ["auto", "none"] {
        let masks_key = format!("motion.masks={masks}");
        let more = [masks_key.as_str(), "data.priors=[]", "init.random_points=800"];
        let eval = finish_in(folder, &path, masks, &more);
        assert!(eval.last.motion.expect("a moving scene").cost.moving > 0, "{masks}");
    }
}
