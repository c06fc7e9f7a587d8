//! Flux4D: a tiny training learns, is resumed to the bit, skips what cannot be used, and reconstructs a log it has
//! not seen.

mod flow;
mod reconstruct;

use std::fs;
use std::path::{Path, PathBuf};

use gs_pipelines::flux4d::config::FluxConfig;
use gs_pipelines::flux4d::logs::Logs;
use gs_pipelines::of_checkpoint;
use gs_train::run::checkpoint::Checkpoint;
#[cfg(unix)]
use gs_train::run::folder::RunFolder;
use gs_train::run::watch::{Ending, Job};
use gs_worlds::driving::{StreetOptions, write};

use self::reconstruct::{best_of_one_opacity, reconstructs};
use crate::common;
use crate::common::program::{fails, says, succeeds};
use crate::common::streets::{SMALL, job, small_street, streets};

fn failure(job: &Job) -> String {
    format!("{:#}", common::train(job).map(|_| ()).expect_err("refused"))
}

/// A short training makes the held-out frames of a street that was never trained on clearer than the lifted points do,
/// whatever opacity these have: a network that learns one opacity for all points gains no more than the best one.
#[test]
fn a_short_training_beats_the_lifted_points_of_an_unseen_street() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 3);
    let run = temporary.path().join("run");
    // Every Gaussian that moves is in an actor, however few they are.
    let actors = ["actors.fewest=1", "actors.radius=2.0"];
    let keys = ["eval.at=[1]", "learning.rate=5e-3", "learning.warm_up=5"];
    let job = job(&data, &run, 40, &[&keys[..], &actors].concat());
    let eval = common::finish(&job);
    let first = eval.evaluations.first().expect("measured after step 1");
    let (begin, end) = (first.mean().psnr, eval.last.mean().psnr);
    assert_eq!(eval.last.measured.split, "validation");
    assert!(end > begin + 0.3, "{begin} dB after one step, {end} dB at the end");
    let opaque = best_of_one_opacity(&data.join("002"), &job);
    assert!(end > opaque + 0.3, "{end} dB, {opaque} dB by the best opacity alone");
    assert!(eval.last.figure("epe3d").is_some_and(f64::is_finite), "the street has labels");
    assert_eq!(eval.skipped_steps, 0);
    let report = fs::read_to_string(job.folder.report()).expect("a report");
    assert!(report.contains("lifted points alone") && report.contains("velocity"));
    reconstructs(&data.join("002"), &job, temporary.path());
}

/// C.1: of the logs 000, 001 and 002 the paper holds out 001; named logs come first, and a folder without any is told.
#[test]
fn the_split_of_the_paper_is_by_name() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 3);
    let of = |overrides: &[&str]| -> FluxConfig {
        let all: Vec<&str> = SMALL.into_iter().chain(["logs.split=paper"]).chain(overrides.iter().copied()).collect();
        FluxConfig::from_table(&common::config(1, &all), "the test").expect("valid")
    };
    let held_out = |config: &FluxConfig| -> Vec<String> {
        let logs = Logs::open(&data, &config.own.logs).expect("logs");
        logs.held_out.iter().map(|place| logs.logs[place.log].name().to_string()).collect()
    };
    assert_eq!(held_out(&of(&[])), ["001"]);
    assert_eq!(held_out(&of(&["logs.validation=[\"002\"]"])), ["002"]);
    fs::remove_dir_all(data.join("001")).expect("removed");
    let error = Logs::open(&data, &of(&[]).own.logs).expect_err("no test log");
    assert!(error.to_string().contains("001, 011"), "{error}");
}

/// Of its own logs a network is measured on those that it has not seen, also in another folder; of others on all.
#[test]
fn logs_of_another_data_set_are_all_held_out() {
    let temporary = tempfile::tempdir().expect("a folder");
    let (own, other) = (streets(temporary.path(), 3), temporary.path().join("other"));
    write(&other, &small_street(11, 9), |_, _| {}).expect("written");
    let named =
        FluxConfig::from_table(&common::config(1, &["pipeline=flux4d", "logs.validation=[\"001\"]"]), "the test");
    for config in [FluxConfig::default().own.logs, named.expect("valid").own.logs] {
        let trained = Logs::open(&own, &config).expect("logs").fingerprint();
        let of = |path: &Path| Logs::open_to_measure(path, &config, &trained, false).expect("logs");
        let moved = temporary.path().join("moved");
        fs::rename(&own, &moved).expect("renamed");
        let found = of(&moved);
        assert_eq!((found.split, found.held_out.len()), ("validation", 1));
        fs::rename(&moved, &own).expect("renamed");
        let found = of(&other);
        assert_eq!((found.split, found.held_out.len(), found.train.len()), ("unseen", 1, 1));
        // The same name is another street elsewhere.
        let same_name = tempfile::tempdir().expect("a folder");
        write(&same_name.path().join("001"), &small_street(11, 8), |_, _| {}).expect("written");
        assert_eq!(of(same_name.path()).split, "unseen");
        let empty = tempfile::tempdir().expect("a folder");
        let error = Logs::open_to_measure(empty.path(), &config, &trained, false).map(|_| ()).expect_err("no log");
        assert!(error.to_string().contains("expected a driving log"), "{error}");
    }
}

/// A folder of logs is what `train` takes, and `check` too.
#[test]
fn a_folder_of_logs_is_checked_log_by_log() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    streets(folder, 2);
    let [text, warned] = says(folder, &["check", "streets"]);
    assert!(text.contains("streets/000: PandaSet") && text.contains("streets/001: PandaSet"), "{text}");
    assert!(text.contains("Good to load.") && !text.contains("warning") && warned.is_empty(), "{text}\n{warned}");
    let said = fails(folder, &["train", "streets", "--steps", "2"]);
    assert!(said.contains("driving logs, which --set pipeline=flux4d takes"), "{said}");
    fs::remove_file(folder.join("streets/001/lidar/poses.json")).expect("removed");
    let output = common::program::gsburn(folder, &["check", "streets"]);
    assert_eq!(output.status.code(), Some(1));
}

/// The memory told before a run is no less than it takes, also of few points, where the network is most of it. The
/// program with wgpu is larger, and is not the one that is measured here.
#[cfg(all(target_os = "linux", not(feature = "wgpu")))]
#[test]
fn the_memory_of_a_network_is_foretold() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    streets(folder, 2);
    for points in ["300", "3000"] {
        let out = format!("run-{points}");
        let set = format!("lift.points={points}");
        let args = ["train", "streets", "--recipe", "flux4d/base", "--steps", "2", "--set", &set, "--out", &out];
        succeeds(folder, &[&args[..], &["--device", "flex", "--quiet"]].concat());
        let eval = common::read_json(&folder.join(&out).join("eval.json"));
        let [foretold, peak] = ["predicted_memory_bytes", "peak_memory_bytes"].map(|key| {
            let value = eval[key].as_u64().or(eval["cost"][key].as_u64());
            value.unwrap_or_else(|| panic!("{key} in {eval}"))
        });
        assert!(peak <= foretold, "{points} points: {peak} bytes, {foretold} were foretold");
    }
}

/// A network without the state of its optimiser reconstructs as the run does, and the one that ships reconstructs a
/// log.
#[test]
fn a_network_is_passed_on() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let data = streets(folder, 2);
    common::finish(&job(&data, &folder.join("run"), 3, &[]));
    succeeds(folder, &["export", "run", "--out", "network.safetensors"]);
    let reconstruct = |model: &str, out: &str| {
        succeeds(
            folder,
            &["reconstruct", "streets/001", "--model", model, "--out", out, "--device", &common::device_name()],
        );
        let images = fs::read_dir(folder.join(out).join("target")).expect("images");
        let mut files: Vec<PathBuf> = images.flatten().map(|entry| entry.path()).collect();
        files.sort();
        files.iter().map(|path| fs::read(path).expect("an image")).collect::<Vec<_>>()
    };
    assert_eq!(reconstruct("run", "of-run"), reconstruct("network.safetensors", "of-network"));
    let size = |path: &str| fs::metadata(folder.join(path)).expect("a file").len();
    let checkpoint = fs::read_dir(folder.join("run/checkpoints")).expect("a folder").flatten().next().expect("a file");
    assert!(2 * size("network.safetensors") < checkpoint.metadata().expect("a file").len());
    assert!(
        fails(folder, &["export", "run", "--out", "network.safetensors"]).contains("expected the name of a new file")
    );
    assert!(fails(folder, &["export", "run", "--out", "scene.obj"]).contains(".safetensors"));
    let device = common::device_name();
    let shipped = ["reconstruct", "streets/001", "--polish", "2", "--out", "shipped", "--device", &device];
    let text = succeeds(folder, &shipped);
    assert!(text.contains("PSNR") && text.contains("polish: 2 steps"), "{text}");
}

#[test]
fn a_resumed_training_is_the_same_to_the_bit() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 2);
    let at =
        |name: &str| job(&data, &temporary.path().join(name), 4, &["learning.accumulate=2", "learning.recolour=0.3"]);
    let (whole, stopped) = (at("whole"), at("stopped"));
    common::finish(&whole);
    common::finish_interrupted(&stopped, &[1, 3]);
    let bytes = |job: &Job| fs::read(job.folder.checkpoint(4)).expect("a checkpoint");
    assert!(bytes(&whole) == bytes(&stopped), "the checkpoints differ");
}

/// Snippets on several devices are those of a step on one, and their gradients are added up in the order of the draws.
/// So the checkpoints are equal to the byte; a stop in between changes nothing. A street without sweeps is skipped and
/// contributes zeros, on whichever device it comes up.
#[test]
fn devices_share_the_snippets_of_a_step() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 4);
    for frame in 0..11 {
        fs::remove_file(data.join("001/lidar").join(format!("{frame:02}.pkl.gz"))).expect("removed");
    }
    // Three snippets an epoch, one of them without sweeps: of the twelve draws of three steps four are skipped.
    let on = |devices: usize, name: &str| {
        let mut job = job(&data, &temporary.path().join(name), 3, &["learning.accumulate=4"]);
        job.more_devices = vec![job.device.clone(); devices - 1];
        job
    };
    let (one, two, stopped) = (on(1, "one"), on(2, "two"), on(2, "stopped"));
    assert_eq!(common::finish(&one).skipped_steps, 4);
    assert_eq!(common::finish(&two).skipped_steps, 4);
    common::finish_interrupted(&stopped, &[1, 2]);
    let bytes = |job: &Job| fs::read(job.folder.checkpoint(3)).expect("a checkpoint");
    assert!(bytes(&one) == bytes(&two), "two devices differ from one");
    assert!(bytes(&two) == bytes(&stopped), "a resumed training differs");
}

/// Refusals of `--devices`, each in one sentence; Ctrl-C saves before a run on two devices leaves.
#[test]
fn devices_are_asked_for_by_number() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    streets(folder, 2);
    let device = common::device_name();
    let arguments = |devices: &str| -> Vec<String> {
        let run = ["train", "streets", "--out", "run", "--quiet", "--steps", "100000", "--devices", devices];
        let keys = SMALL.into_iter().chain(["learning.accumulate=2", "eval.ms_ssim=false"]);
        let words = run.into_iter().chain(["--device", &device]).map(String::from);
        words.chain(keys.flat_map(|key| ["--set".into(), key.into()])).collect()
    };
    let three = arguments("3");
    let three = fails(folder, &three.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(three.contains("expected a multiple of it in learning.accumulate"), "{three}");
    let auto = ["train", "streets", "--devices", "2", "--set", "pipeline=flux4d"];
    assert!(fails(folder, &auto).contains("expected the name of their kind"));
    let still = ["train", "streets", "--devices", "2", "--device", &device];
    assert!(fails(folder, &still).contains("trains on one device"));
    #[cfg(unix)]
    interrupted(folder, &arguments("2"));
}

#[cfg(unix)]
fn interrupted(folder: &Path, arguments: &[String]) {
    let mut running = common::program::program(folder).args(arguments).spawn().expect("the program starts");
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

/// Sky points in the convolutions are voxels of their own and rest, whatever the velocities begin at.
#[test]
fn far_points_may_be_voxels() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 2);
    let voxels = |name: &str, keys: &[&str]| {
        let all = [&["lift.sky_points=50", "lift.velocity=zero"], keys].concat();
        let job = job(&data, &temporary.path().join(name), 2, &all);
        let eval = common::finish(&job);
        assert!(eval.skipped_steps == 0 && eval.last.mean().psnr.is_finite());
        let text = fs::read_to_string(job.folder.metrics()).expect("metrics");
        let lines = text.lines().filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok());
        lines.filter_map(|line| line["counts"]["voxels"].as_f64()).next_back().expect("voxels")
    };
    let (apart, inside) = (voxels("apart", &[]), voxels("inside", &["unet.far=voxels"]));
    assert!(inside > apart + 40.0, "{inside} voxels, {apart} without 50 points of the sky");
}

/// A stop saves; what a run of another pipeline saved is refused.
#[test]
fn a_stop_saves() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 2);
    let mut job = job(&data, &temporary.path().join("run"), 5, &[]);
    job.stop_at = Some(2);
    assert!(matches!(common::train(&job), Ok(Ending::Interrupted(2))));
    let saved = Checkpoint::load(&job.folder.checkpoint(2)).expect("saved");
    let shown = of_checkpoint(&saved).expect("known").open(&saved, None, &common::device()).map(|_| ());
    assert!(format!("{:#}", shown.expect_err("no scene")).contains("gsburn reconstruct"));
    // Trained further on other logs, it says so.
    (job.resume, job.stop_at, job.dataset) = (true, None, data.join("001"));
    assert!(failure(&job).contains("expected the"), "{}", failure(&job));
}

#[test]
fn bad_input_is_one_sentence() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let data = streets(folder, 2);
    let told = |data: &Path, overrides: &[&str]| failure(&job(data, &folder.join("run"), 2, overrides));
    let empty = folder.join("empty");
    fs::create_dir(&empty).expect("made");
    assert!(told(&empty, &[]).contains("expected a driving log or a folder of driving logs"));
    assert!(told(&folder.join("nowhere"), &[]).contains("found no folder"));
    assert!(told(&data, &["logs.validation=[\"017\"]"]).contains("017"));
    assert!(told(&data, &["logs.validation=[\"000\",\"001\"]"]).contains("all are held out"));
    let single = folder.join("single");
    let options = StreetOptions { frames: 1, cameras: 1, width: 32, height: 32, ..StreetOptions::default() };
    write(&single, &options, |_, _| {}).expect("written");
    assert!(told(&single, &[]).contains("at least 3 frames, found 1"), "{}", told(&single, &[]));
    let blind = folder.join("blind");
    write(&blind, &StreetOptions { frames: 4, ..options }, |_, _| {}).expect("written");
    fs::remove_dir_all(blind.join("camera")).expect("removed");
    let message = told(&blind, &[]);
    assert!(message.contains("camera"), "{message}");
    assert!(!folder.join("run").join("config.toml").exists(), "nothing is half-written");
}

/// A street whose images are black and one whose sweeps are missing contribute nothing: their snippets are skipped
/// and counted, the others train on.
#[test]
fn what_cannot_be_used_is_skipped_and_counted() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 4);
    let images = data.join("000").join("camera").join("front_camera");
    for frame in 0..11 {
        image::RgbImage::new(64, 36).save(images.join(format!("{frame:02}.jpg"))).expect("written");
    }
    for frame in 0..11 {
        fs::remove_file(data.join("001").join("lidar").join(format!("{frame:02}.pkl.gz"))).expect("removed");
    }
    // Three snippets an epoch, of which one can be used.
    let job = job(&data, &temporary.path().join("run"), 6, &[]);
    let eval = common::finish(&job);
    assert_eq!(eval.skipped_steps, 4);
    assert!(eval.last.mean().psnr.is_finite());
}

/// A weight so large that the loss is infinite: every step is skipped, and the network stays what it was.
#[test]
fn a_step_that_is_not_finite_changes_nothing() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 2);
    // Without the velocities of the sweeps, which an untrained network would show.
    let keys = ["refinement.passes=1", "supervision.depth=3e38", "lift.velocity=zero"];
    let job = job(&data, &temporary.path().join("run"), 2, &keys);
    let eval = common::finish(&job);
    assert_eq!(eval.skipped_steps, 2);
    // An untrained network changes no Gaussian.
    assert!(eval.last.figure("gain").is_some_and(|gain| gain.abs() < 1e-3));
}
