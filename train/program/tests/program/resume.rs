//! A resumed run, and a run on another number of threads, writes the same bits as an uninterrupted one.

use crate::common;

use std::path::Path;

use gs_train::run::watch::Job;

/// Density changes at 20, 30, 40 and SH degrees at 13, 26, 39 fall before and after the interruptions.
const OVERRIDES: [&str; 6] = [
    "density.start=4",
    "density.every=10",
    "density.mcmc.growth=0.2",
    "density.mcmc.full=0",
    "density.cap=260",
    "optimiser.opacity_lr=0.3",
];
const STEPS: usize = 50;

fn last_checkpoint(job: &Job) -> Vec<u8> {
    std::fs::read(job.folder.checkpoint(STEPS)).expect("the last checkpoint")
}

fn resumes_to_the_same_bits(more: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = common::tiny_scene(folder.path());
    resumes_on(folder.path(), &scene, more, &[17, 33]);
}

/// A run on `scene`, one that is interrupted after `stops`, and one with a single thread.
fn resumes_on(folder: &Path, scene: &Path, more: &[&str], stops: &[usize]) {
    let overrides: Vec<&str> = OVERRIDES.iter().chain(more).copied().collect();
    let config = common::config(STEPS, &overrides);
    let whole = common::job(scene, &folder.join("whole"), &config);
    common::finish(&whole);
    let resumed = common::job(scene, &folder.join("resumed"), &config);
    common::finish_interrupted(&resumed, stops);
    assert!(last_checkpoint(&whole) == last_checkpoint(&resumed), "the resumed run differs");

    let steps = |job: &Job| -> Vec<usize> {
        job.folder.read_metrics(STEPS).expect("metrics").iter().map(|line| line.step()).collect()
    };
    assert_eq!(steps(&whole), steps(&resumed), "metrics are continued without gaps or repetitions");

    let one_thread = common::job(scene, &folder.join("one"), &config);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    pool.install(|| common::finish(&one_thread));
    assert!(last_checkpoint(&whole) == last_checkpoint(&one_thread), "one thread gives other bits");
}

#[test]
fn relocation_resumes_to_the_same_bits() {
    resumes_to_the_same_bits(&["density.strategy=mcmc"]);
}

/// Photos of half their width up to step 25, growth that follows the run (20 refinements, the cap at 45 %), rates of a
/// short run and points on which photos agree: interrupted before the switch of the width, at it, right after it, and
/// after a growth step.
#[test]
fn measures_that_follow_the_run_resume_to_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = common::still_scene(folder.path(), (400, 60));
    let keys = ["data.coarse_share=0.5", "density.mcmc.full=0.45", "density.mcmc.growth=0.5", "init.dense_share=0.9"];
    resumes_on(folder.path(), &scene, &keys, &[11, 25, 26, 31]);
}

#[test]
fn a_region_resumes_to_the_same_bits() {
    resumes_to_the_same_bits(&["data.region=[-0.6, -0.6, -0.2, 0.6, 0.6, 0.8]"]);
}

#[test]
fn adaptive_control_resumes_to_the_same_bits() {
    let reset = ["density.strategy=default", "density.default.gradient=1e-5", "density.default.reset_every=25"];
    resumes_to_the_same_bits(&reset);
}

#[test]
fn resuming_without_a_checkpoint_begins_anew() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = common::tiny_scene(folder.path());
    let resolved = common::resolved(3, &[]);
    let mut job = common::job(&scene, &folder.path().join("run"), &resolved.config);
    job.folder.make().expect("made");
    job.folder.write_config(&resolved.text, &scene).expect("written");
    job.resume = true;
    assert_eq!(common::finish(&job).last.step, 3);
}

#[test]
fn seeds_matter() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = common::tiny_scene(folder.path());
    let checkpoint = |seed: &str| {
        let job = common::job(&scene, &folder.path().join(seed), &common::config(STEPS, &[seed]));
        common::finish(&job);
        last_checkpoint(&job)
    };
    assert!(checkpoint("seed=1") != checkpoint("seed=2"));
}
