//! Flux4D trained by burn-train's learner: one device has the bits of the plain steps, and two share a step.
#![cfg(feature = "learner")]
#![recursion_limit = "256"]

use std::fs;
use std::sync::Arc;

use gs_burn::named_parameters;
use gs_train::fit::training::Training;
use gs_train::pipelines::flux4d::config::FluxConfig;
use gs_train::pipelines::flux4d::feed::{Draws, Feed, Library};
use gs_train::pipelines::flux4d::logs::Logs;
use gs_train::pipelines::flux4d::network::FluxNetwork;
use gs_train::pipelines::flux4d::saved::restore;
use gs_train::pipelines::flux4d::trainer::step;
use gs_train::run::checkpoint::Checkpoint;
use gs_train::run::folder::RunFolder;
use gs_train::run::watch::Job;

mod common;

use common::program::{fails, program, succeeds};
use common::streets::{SMALL, job, streets};

/// The run with as many workers on the test's device.
fn on(devices: usize, job: Job) -> Job {
    Job { more_devices: vec![job.device.clone(); devices - 1], ..job }
}

fn bytes(job: &Job, step: usize) -> Vec<u8> {
    fs::read(job.folder.checkpoint(step)).expect("a checkpoint")
}

fn restored(job: &Job, step: usize) -> Training<FluxNetwork> {
    let checkpoint = Checkpoint::load(&job.folder.checkpoint(step)).and_then(Checkpoint::whole).expect("loads");
    restore(&checkpoint, &FluxConfig::from_table(&job.config, "the test").expect("valid"), &job.device).expect("fits")
}

/// The gradient that burn-train hands over is the sum of `1 * gradient` over the same snippets in the same order, so nothing is
/// rounded otherwise.
#[test]
fn one_device_has_the_bits_of_the_plain_steps() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 3);
    let job = job(&data, &temporary.path().join("run"), 3, &["learning.accumulate=2"]);
    common::finish(&job);
    let config = FluxConfig::from_table(&job.config, "the test").expect("valid");
    let logs = Arc::new(Logs::open(&data, &config.own.logs).expect("logs"));
    let feed = Feed::start(Arc::new(Library::new(logs.clone(), &config)), Draws::from(0)).expect("a thread");
    let mut plain = Training::new(FluxNetwork::new(&config, &job.device));
    for _ in 0..3 {
        let snippets = [feed.next().expect("a snippet"), feed.next().expect("a snippet")];
        step(&mut plain, &snippets, (&logs, &config, &job.device), &mut |_| {});
    }
    let learned = restored(&job, 3);
    for (plain, learned) in named_parameters(plain.module()).iter().zip(named_parameters(learned.module())) {
        // Running statistics are not saved.
        if !plain.path.contains("running") {
            assert_eq!(plain.table.to_data(), learned.table.to_data(), "{}", plain.path);
        }
    }
    for (path, moments) in &plain.adam.moments {
        assert_eq!(moments.second.to_data(), learned.adam.moments[path].second.to_data(), "{path}");
    }
}

/// Two snippets on two devices are the two of a step on one: the sum of two gradients does not depend on their order, and each
/// snippet has its own statistics of batch norm in both. So the checkpoints are equal to the byte; a stop in between changes
/// nothing. A street without sweeps is skipped and contributes zeros, on whichever device it comes up.
#[test]
fn two_devices_are_two_snippets_on_one() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 4);
    for frame in 0..11 {
        fs::remove_file(data.join("001/lidar").join(format!("{frame:02}.pkl.gz"))).expect("removed");
    }
    // Three snippets an epoch, one of them without sweeps: of the eight draws of four steps two or three are skipped.
    let at = |name: &str| job(&data, &temporary.path().join(name), 4, &["learning.accumulate=2"]);
    let (one, two, stopped) = (at("one"), on(2, at("two")), on(2, at("stopped")));
    let skipped = common::finish(&one).skipped_steps;
    assert!([2, 3].contains(&skipped), "{skipped}");
    assert_eq!(common::finish(&two).skipped_steps, skipped);
    common::finish_interrupted(&stopped, &[1, 3]);
    assert!(bytes(&one, 4) == bytes(&two, 4), "two devices differ from one");
    assert!(bytes(&two, 4) == bytes(&stopped, 4), "a resumed training differs");
}

/// With several snippets on a device their gradients are added up in the order of arrival. The sum of four numbers in another order
/// differs by some roundings of 6e-8 of the largest partial sum; the bound has room for partial sums a hundred times the largest
/// gradient of the parameter.
#[test]
fn the_mean_is_over_all_snippets_of_all_devices() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 5);
    let at = |name: &str| job(&data, &temporary.path().join(name), 1, &["learning.accumulate=4"]);
    let (one, two) = (at("one"), on(2, at("two")));
    common::finish(&one);
    common::finish(&two);
    let (one, two) = (restored(&one, 1), restored(&two, 1));
    for (path, moments) in &one.adam.moments {
        // After the first step a tenth of the gradient.
        let largest = moments.first.clone().abs().max().into_scalar::<f32>();
        let apart = (moments.first.clone() - two.adam.moments[path].first.clone()).abs().max().into_scalar::<f32>();
        assert!(apart <= 2e-5 * largest, "{path}: {apart} of {largest}");
    }
}

/// Ctrl-C saves before a run on two devices leaves.
#[cfg(unix)]
#[test]
fn an_interrupted_run_on_two_devices_saves() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    streets(folder, 2);
    let arguments = arguments("2", "100000");
    let mut running = program(folder).args(&arguments).spawn().expect("the program starts");
    let lines = || fs::read_to_string(folder.join("run/metrics.jsonl")).unwrap_or_default().lines().count();
    while lines() == 0 {
        std::thread::sleep(std::time::Duration::from_millis(20));
        assert!(running.try_wait().expect("a process").is_none(), "it runs until it is interrupted");
    }
    let id = running.id().to_string();
    assert!(std::process::Command::new("kill").args(["-INT", &id]).status().expect("kill").success());
    assert_eq!(running.wait().expect("ended").code(), Some(130));
    let saved = RunFolder::at(folder.join("run")).saved();
    let (step, path) = saved.last().expect("it saved");
    assert!(*step >= 10, "step {step}");
    assert!(Checkpoint::load(path).and_then(Checkpoint::whole).is_ok());
}

/// What `--devices` refuses, each in one sentence; a run has a report and none of burn-train's files.
#[test]
fn devices_are_asked_for_by_number() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    streets(folder, 2);
    let refused = |devices: &str| fails(folder, &words(&arguments(devices, "2")));
    assert!(refused("3").contains("expected a multiple of it in learning.accumulate"), "{}", refused("3"));
    let auto = ["train", "streets", "--devices", "2", "--set", "pipeline=flux4d"];
    assert!(fails(folder, &auto).contains("expected the name of their kind"));
    let still = ["train", "streets", "--devices", "2", "--device", &common::device_name()];
    assert!(fails(folder, &still).contains("trains on one device"));
    succeeds(folder, &words(&arguments("2", "2")));
    let of_burn = ["experiment.log", "train", "valid", "checkpoint"].map(|name| folder.join("run").join(name));
    assert!(of_burn.iter().all(|path| !path.exists()) && folder.join("run/report.html").is_file());
}

/// A run on several devices with two snippets a step, as typed.
fn arguments(devices: &str, steps: &str) -> Vec<String> {
    let mut typed: Vec<String> =
        ["train", "streets", "--out", "run", "--quiet", "--steps", steps, "--devices", devices, "--device"]
            .map(String::from)
            .to_vec();
    typed.push(common::device_name());
    let keys = SMALL.into_iter().chain(["learning.accumulate=2", "eval.ms_ssim=false"]);
    typed.extend(keys.flat_map(|key| ["--set".to_string(), key.to_string()]));
    typed
}

fn words(arguments: &[String]) -> Vec<&str> {
    arguments.iter().map(String::as_str).collect()
}
