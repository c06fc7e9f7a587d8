//! A resumed run, and a run on another number of threads, writes the same bits as an uninterrupted one.

mod common;

use gs_train::run::watch::Job;

/// Density changes at 20, 30, 40 and SH degrees at 13, 26, 39 fall before and after the interruptions.
const OVERRIDES: [&str; 5] =
    ["density.start=4", "density.every=10", "density.growth=0.2", "density.cap=260", "optimiser.opacity_lr=0.3"];
const STEPS: usize = 50;

fn last_checkpoint(job: &Job) -> Vec<u8> {
    std::fs::read(job.folder.checkpoint(STEPS)).expect("the last checkpoint")
}

fn resumes_to_the_same_bits(more: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = common::tiny_scene(folder.path());
    let overrides: Vec<&str> = OVERRIDES.iter().chain(more).copied().collect();
    let config = common::config(STEPS, &overrides);
    let whole = common::job(&scene, &folder.path().join("whole"), &config);
    common::finish(&whole);
    let resumed = common::job(&scene, &folder.path().join("resumed"), &config);
    common::finish_interrupted(&resumed, &[17, 33]);
    assert!(last_checkpoint(&whole) == last_checkpoint(&resumed), "the resumed run differs");

    let steps = |job: &Job| -> Vec<usize> {
        job.folder.read_metrics(STEPS).expect("metrics").iter().map(|line| line.step()).collect()
    };
    assert_eq!(steps(&whole), steps(&resumed), "metrics are continued without gaps or repetitions");

    let one_thread = common::job(&scene, &folder.path().join("one"), &config);
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
