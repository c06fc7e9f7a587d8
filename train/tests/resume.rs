//! A resumed run, and a run on another number of threads, writes the same bits as an uninterrupted one.

mod common;

use std::path::Path;

use gs_train::experiment::Config;
use gs_train::run::{Ending, RunRequest, run};

/// Density changes at 20, 30, 40 and SH degrees at 13, 26, 39 fall before and after the interruptions.
const OVERRIDES: [&str; 5] =
    ["density.start=4", "density.every=10", "density.growth=0.2", "density.cap=260", "optimiser.opacity_lr=0.3"];
const STEPS: usize = 50;

fn last_checkpoint(request: &RunRequest) -> Vec<u8> {
    std::fs::read(request.folder.checkpoint(STEPS)).expect("the last checkpoint")
}

fn interrupted_at(stops: &[usize], scene: &Path, folder: &Path, config: &Config) -> RunRequest {
    let mut request = common::request(scene, folder, config);
    for stop in stops {
        request.stop_at = Some(*stop);
        assert!(matches!(run(&request), Ok(Ending::Interrupted(step)) if step == *stop));
        request.resume = true;
    }
    request.stop_at = None;
    common::finish(&request);
    request
}

fn resumes_to_the_same_bits(more: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = common::tiny_scene(folder.path());
    let overrides: Vec<&str> = OVERRIDES.iter().chain(more).copied().collect();
    let config = common::config(STEPS, &overrides);
    let whole = common::request(&scene, &folder.path().join("whole"), &config);
    common::finish(&whole);
    let resumed = interrupted_at(&[17, 33], &scene, &folder.path().join("resumed"), &config);
    assert!(last_checkpoint(&whole) == last_checkpoint(&resumed), "the resumed run differs");

    let steps = |request: &RunRequest| -> Vec<usize> {
        request.folder.read_metrics(STEPS).expect("metrics").iter().map(|line| line.step()).collect()
    };
    assert_eq!(steps(&whole), steps(&resumed), "metrics are continued without gaps or repetitions");

    let one_thread = common::request(&scene, &folder.path().join("one"), &config);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    pool.install(|| common::finish(&one_thread));
    assert!(last_checkpoint(&whole) == last_checkpoint(&one_thread), "one thread gives other bits");
}

#[test]
fn relocation_resumes_to_the_same_bits() {
    resumes_to_the_same_bits(&["density.strategy=mcmc"]);
}

#[test]
fn adaptive_control_resumes_to_the_same_bits() {
    let reset = ["density.strategy=default", "density.gradient=1e-5", "density.reset_every=25"];
    resumes_to_the_same_bits(&reset);
}

#[test]
fn resuming_without_a_checkpoint_begins_anew() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = common::tiny_scene(folder.path());
    let config = common::config(3, &[]);
    let mut request = common::request(&scene, &folder.path().join("run"), &config);
    request.folder.make().expect("made");
    request.folder.write_config(&config, &scene).expect("written");
    request.resume = true;
    assert_eq!(common::finish(&request).last.step, 3);
}

#[test]
fn seeds_matter() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = common::tiny_scene(folder.path());
    let checkpoint = |seed: &str| {
        let config = common::config(STEPS, &[seed]);
        let request = common::request(&scene, &folder.path().join(seed), &config);
        common::finish(&request);
        last_checkpoint(&request)
    };
    assert!(checkpoint("seed=1") != checkpoint("seed=2"));
}
