//! Flux4D: a tiny training learns, is resumed to the bit, skips what cannot be used, and reconstructs a log it has
//! not seen.

use std::fs;
use std::path::{Path, PathBuf};

use burn::tensor::Tensor;
use gs_driving::Snippet;
use gs_models::flux4d::channels::{CHANNELS, OPACITY};
use gs_pipelines::flux4d::config::FluxConfig;
use gs_pipelines::flux4d::evaluate::color;
use gs_pipelines::flux4d::host_view::HostView;
use gs_pipelines::flux4d::infer::{Ready, infer};
use gs_pipelines::flux4d::logs::{self, Logs};
use gs_pipelines::flux4d::network::FluxNetwork;
use gs_pipelines::flux4d::polish::polish;
use gs_pipelines::flux4d::prepare::prepare;
use gs_pipelines::flux4d::sample::{camera, photo};
use gs_pipelines::{Reconstruction, networks_of, of_checkpoint};
use gs_splats::ply;
use gs_train::run::checkpoint::Checkpoint;
#[cfg(unix)]
use gs_train::run::folder::RunFolder;
use gs_train::run::metrics::psnr;
use gs_train::run::watch::{Ending, Job};
use gs_worlds::driving::{StreetOptions, write};

use crate::common;

use crate::common::program::{fails, fails_with, says, succeeds};
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

/// The mean PSNR of the frames between the inputs of a street, dB, by the untrained network's Gaussians, whose
/// opacities (logits) are all changed by the best number.
fn best_of_one_opacity(log: &Path, job: &Job) -> f64 {
    let (device, config) = (common::device(), FluxConfig::from_table(&job.config, "the test").expect("valid"));
    let log = logs::open(log, &config.own.logs).expect("a log");
    let host = prepare(&log, &Snippet::new(0, 11), "street", &config.own.lift, config.seed).expect("a snippet");
    let ready = Ready::new(&FluxNetwork::new(&config, &device));
    let inferred = infer(&ready, &host, &log, &config, &device).expect("applied");
    let psnr_with = |change: i32| {
        let (before, after) = (inferred.raw.clone().narrow(1, 0, OPACITY.start), OPACITY.end..CHANNELS);
        let opacity = inferred.raw.clone().narrow(1, OPACITY.start, OPACITY.len()) + 0.5 * f64::from(change);
        let after = inferred.raw.clone().narrow(1, after.start, after.len());
        let raw = Tensor::cat(vec![before, opacity, after], 1);
        let of_view = |view: &HostView| {
            let camera = camera(&log, view, &device);
            psnr(color(&inferred, &raw, &inferred.velocity, (&camera, view.time)), photo(view, &device))
        };
        host.targets.iter().map(of_view).sum::<f64>() / host.targets.len() as f64
    };
    (-4..=16).map(psnr_with).max_by(f64::total_cmp).expect("some numbers")
}

/// The trained network on the street that was held out: images, actors, Gaussians, figures; nothing of the user is
/// written over.
fn reconstructs(log: &Path, job: &Job, folder: &Path) {
    let checkpoint = Checkpoint::load(&job.folder.checkpoint(40)).expect("loads");
    let (out, device) = (folder.join("out"), common::device());
    let times = [0.25, 1.2];
    let request = Reconstruction {
        log,
        set: &[],
        out: &out,
        start: 0,
        full: false,
        future: 0,
        times: &times,
        polish: 0,
        shift: [0.0; 3],
        rest_speed: Some(0.0),
        edit: None,
        page: gsburn::report::viewer::page_of,
        device: &device,
    };
    let networks = networks_of(&checkpoint).expect("a network");
    let lines = networks.reconstruct(&checkpoint, &request).expect("reconstructed");
    assert!(lines.iter().any(|line| line.starts_with("seconds: ")), "{lines:?}");
    let count = |name: &str| fs::read_dir(out.join(name)).map_or(0, Iterator::count);
    assert_eq!([count("input"), count("target"), count("times")], [6, 5, 2]);
    for file in ["actors.json", "reconstruction.json", "002-000.ply"] {
        assert!(out.join(file).is_file(), "{file}");
    }
    assert!(lines.iter().any(|line| line.starts_with("Scene flow, bucketed")), "{lines:?}");
    assert!(json(&out.join("reconstruction.json"))["tables"][0]["rows"].as_array().is_some_and(|rows| rows.len() > 1));
    let actors = json(&out.join("actors.json"))["snippets"][0]["actors"].as_array().expect("a list").clone();
    assert!(!actors.is_empty(), "twelve movers");
    for actor in &actors {
        let path = out.join(format!("actors/002-000-{:02}.ply", actor["actor"].as_u64().expect("a number")));
        let gaussians = ply::read(&path).expect("a PLY file").splats;
        assert_eq!(actor["gaussians"], gaussians.len(), "{}", path.display());
        // In the world of the log, in the middle of the window, when the box was found.
        let means: Vec<f64> = gaussians.means.into_flattened().into_iter().map(f64::from).collect();
        let centre = |axis: usize| actor["centre"][axis].as_f64().expect("metres");
        let size = actor["size"].as_array().expect("metres").iter().filter_map(|x| x.as_f64()).fold(0.0, f64::max);
        assert!(means.chunks(3).all(|mean| (0..2).all(|axis| (mean[axis] - centre(axis)).abs() < size + 0.1)));
    }
    assert_eq!(count("actors"), actors.len());
    // An earlier reconstruction is written over, another folder is not, and a script that names no actor is told.
    networks.reconstruct(&checkpoint, &Reconstruction { full: true, ..request }).expect("again");
    let foreign = folder.join("foreign");
    fs::create_dir(&foreign).expect("made");
    fs::write(foreign.join("mine.txt"), "mine").expect("written");
    let refused =
        |request: Reconstruction| format!("{:#}", networks.reconstruct(&checkpoint, &request).expect_err("refused"));
    assert!(refused(Reconstruction { out: &foreign, ..request }).contains("expected an empty folder"));
    let script = folder.join("edits.toml");
    fs::write(&script, "[[edits]]\ndo = \"remove\"\nactor = 500\n").expect("written");
    assert!(refused(Reconstruction { edit: Some(&script), ..request }).contains("actor 500"));
    fs::write(&script, "[[edits]]\ndo = \"paint\"\n").expect("written");
    assert!(refused(Reconstruction { edit: Some(&script), ..request }).contains("edits.toml"));
    assert!(refused(Reconstruction { start: 9, ..request }).contains("--start 9"));
    let count = || json(&out.join("reconstruction.json"))["gaussians"].as_u64().expect("a number");
    networks.reconstruct(&checkpoint, &request).expect("as before");
    let (before, set) = (count(), ["lift.sky_points=40".to_string()]);
    networks.reconstruct(&checkpoint, &Reconstruction { set: &set, ..request }).expect("with less sky");
    // The training has 100.
    assert_eq!(count(), before - 60);
    let set = ["unet.width=0.5".to_string()];
    assert!(refused(Reconstruction { set: &set, ..request }).contains("those of the network"));
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&fs::read_to_string(path).expect("text")).expect("JSON")
}

/// A log whose second snippet has a broken sweep: what was made before is not taken for a reconstruction, and the same
/// command makes all anew once the sweep is whole. Each time asked for is in the snippet that holds it.
#[test]
fn an_interrupted_reconstruction_is_made_anew() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    write(&folder.join("street"), &small_street(17, 3), |_, _| {}).expect("written");
    let sweep = folder.join("street/lidar/14.pkl.gz");
    let whole = fs::read(&sweep).expect("a sweep");
    fs::write(&sweep, "broken").expect("written");
    let (device, out) = (common::device_name(), folder.join("out"));
    let args = ["reconstruct", "street", "--full", "--times", "0.25,1.35", "--out", "out", "--device", &device];
    assert!(fails(folder, &args).contains("14.pkl.gz"));
    let has = |name: &str| out.join(name).exists();
    assert_eq!(["unfinished", "input", "reconstruction.json"].map(has), [true, false, false]);
    fs::write(&sweep, whole).expect("written");
    let [text, warned] = says(folder, &args);
    assert!(text.contains("2 snippets, 19 images") && !warned.contains("outside"), "{text}\n{warned}");
    // Times and shifts where nothing is, and another result in the place of this one.
    let mut far = args.to_vec();
    far.retain(|arg| *arg != "--full");
    far[3] = "-5,0.1";
    let [_, warned] = says(folder, &far);
    assert!(warned.contains("--times: 1 time lies outside the recording, which is from 0 to 1"), "{warned}");
    let times: Vec<_> =
        fs::read_dir(folder.join("out/times")).expect("a folder").flatten().map(|e| e.file_name()).collect();
    assert_eq!(times.len(), 2, "{times:?}");
    for (flag, value) in [("--times", "1e308"), ("--times", "nan"), ("--shift", "1e308,0,0")] {
        let said = fails_with(2, folder, &["reconstruct", "street", flag, value, "--out", "out"]);
        assert!(said.contains(value), "{said}");
    }
    assert!(succeeds(folder, &args).contains("2 snippets, 19 images"));
    assert_eq!(["unfinished", "input", "reconstruction.json"].map(has), [false, true, true]);
    let times = fs::read_dir(out.join("times")).expect("a folder").count();
    assert_eq!((times, has("street-000.ply"), has("street-006.ply")), (2, true, true));
}

/// A few steps of Adam on the snippet's own input images lower their loss; no step changes nothing, to the bit. What
/// carries no velocity by evidence carries none afterwards.
#[test]
fn a_polish_lowers_the_loss_of_the_inputs() {
    let temporary = tempfile::tempdir().expect("a folder");
    let path = streets(temporary.path(), 1).join("000");
    let (device, config) = (common::device(), common::config(1, &SMALL));
    let config = FluxConfig::from_table(&config, "the test").expect("valid");
    let log = logs::open(&path, &config.own.logs).expect("a log");
    let host = prepare(&log, &Snippet::new(0, 11), "street", &config.own.lift, config.seed).expect("a snippet");
    let ready = Ready::new(&FluxNetwork::new(&config, &device));
    let mut inferred = infer(&ready, &host, &log, &config, &device).expect("applied");
    let before = inferred.clone();
    assert_eq!(polish(&mut inferred, &host, &log, &config, 0, &device), None);
    assert_eq!(inferred.raw.to_data(), before.raw.to_data());
    assert_eq!(inferred.velocity.to_data(), before.velocity.to_data());
    let polished = polish(&mut inferred, &host, &log, &config, 20, &device).expect("twenty steps");
    let [loss, polished_loss] = polished.loss;
    assert!(polished_loss < 0.97 * loss, "{loss} to {polished_loss}");
    assert_eq!((polished.steps, polished.skipped), (20, 0));
    let rows = |velocity: &burn::tensor::Tensor<2>| -> Vec<f64> { velocity.to_data().iter::<f64>().collect() };
    let (old, new) = (rows(&before.velocity), rows(&inferred.velocity));
    let columns = before.velocity.dims()[1];
    let rested = old.chunks(columns).map(|row| row.iter().all(|x| *x == 0.0));
    let rests = new.chunks(columns).map(|row| row.iter().all(|x| *x == 0.0));
    assert!(rested.zip(rests).all(|(before, after)| before == after));
    assert_ne!(old, new);
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

/// Before any training the sweeps alone show most of the motion, and nothing that rests moves: the bounds are half of
/// what no motion at all is off by, and the speed at rest that is asked of the method.
#[test]
fn the_sweeps_show_what_moves() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = streets(temporary.path(), 2);
    // A rate of almost nothing: the measurement is of the start. All points: a merged point beside a car lends its
    // motion to what it was merged over.
    let still = ["learning.rate=1e-9", "learning.last_rate=1e-9", "lift.points=0"];
    let measured = |name: &str, velocity: &str| {
        let job = job(&data, &temporary.path().join(name), 1, &[&still[..], &[velocity]].concat());
        let eval = common::finish(&job);
        let of = |key: &str| eval.last.figure(key).expect("the street has labels");
        [of("epe_moving"), of("speed_at_rest")]
    };
    let [zero, _] = measured("zero", "lift.velocity=zero");
    let [aligned, resting] = measured("aligned", "lift.velocity=aligned");
    assert!(aligned < 0.5 * zero, "{aligned} m of {zero} m");
    assert!(resting < 0.05, "{resting} m/s at rest");
}

/// `gsburn flow` needs no image: an array for every sweep, figures where there are labels, and the same by a fit of
/// every pair.
#[test]
fn the_flow_of_sweeps_is_written_and_scored() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let log = streets(folder, 1).join("000");
    fs::remove_dir_all(log.join("camera/front_camera")).expect("a folder");
    let text = succeeds(folder, &["flow", "streets/000", "--out", "flow", "--window", "4"]);
    assert!(text.contains("11 sweeps") && text.contains("EPE3D, moving"), "{text}");
    let arrays = fs::read_dir(folder.join("flow")).expect("a folder").flatten();
    let sizes: Vec<u64> = arrays
        .filter(|entry| entry.path().extension().is_some_and(|extension| extension == "npy"))
        .map(|entry| entry.metadata().expect("a file").len())
        .collect();
    // A header of 128 bytes at most (NumPy's alignment), then three floats a point.
    assert_eq!(sizes.len(), 11);
    assert!(sizes.iter().all(|size| size % 4 == 0 && *size > 12 * 100), "{sizes:?}");
    let figures = fs::read_to_string(folder.join("flow/flow.json")).expect("written");
    let figures: serde_json::Value = serde_json::from_str(&figures).expect("JSON");
    assert_eq!(figures["sweeps"], 11);
    // Again into the folder of an earlier flow, and not into another.
    succeeds(folder, &["flow", "streets/000", "--out", "flow"]);
    fs::create_dir(folder.join("mine")).expect("made");
    fs::write(folder.join("mine/00.npy"), "mine").expect("written");
    assert!(fails(folder, &["flow", "streets/000", "--out", "mine"]).contains("expected an empty folder"));
    assert_eq!(fs::read_to_string(folder.join("mine/00.npy")).expect("text"), "mine");
    // Of another log, which is shorter: nothing of the first is left.
    let other = folder.join("other");
    write(&other, &small_street(4, 7), |_, _| {}).expect("written");
    succeeds(folder, &["flow", "other", "--out", "flow"]);
    assert_eq!(arrays_in(&folder.join("flow")), ["00.npy", "01.npy", "02.npy", "03.npy"]);
    let fitted = succeeds(folder, &["flow", "streets/000", "--window", "2", "--fit", "2"]);
    assert!(fitted.contains("a fit of each pair") && fitted.contains("EPE3D, moving"), "{fitted}");
    fs::remove_dir_all(&log).expect("a folder");
    assert!(fails(folder, &["flow", "streets/000"]).contains("streets/000"));
}

fn arrays_in(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).expect("a folder").flatten().map(|entry| entry.file_name());
    let mut names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    names.retain(|name| name.ends_with(".npy"));
    names.sort();
    names
}

/// A clock that jumps by 20 s is a gap, on both sides of which motion is looked for; a first time of 0 leaves one sweep
/// without another.
#[test]
fn the_flow_of_a_log_with_a_gap_stays_on_its_sides() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let log = streets(folder, 1).join("000");
    let path = log.join("lidar/timestamps.json");
    let times: Vec<f64> = serde_json::from_str(&fs::read_to_string(&path).expect("read")).expect("seconds");
    let jumping: Vec<f64> = (0..11).map(|i| times[i] + if i >= 6 { 20.0 } else { 0.0 }).collect();
    let alone: Vec<f64> = (0..11).map(|i| if i == 0 { 0.0 } else { times[i] }).collect();
    for (times, sweeps, said) in [
        (jumping, 11, "1 gap (20.1 s after frame 05), over which no motion is looked for"),
        (alone, 10, "1 sweep has no other without a gap before or after and is left out"),
    ] {
        fs::write(&path, serde_json::to_string(&times).expect("JSON")).expect("written");
        for fit in [&[][..], &["--fit", "2"]] {
            let [text, warned] = says(folder, &[&["flow", "streets/000"], fit].concat());
            assert!(text.contains(&format!("{sweeps} sweeps")), "{text}");
            assert!(warned.contains(said), "{warned}");
        }
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
        let eval = json(&folder.join(&out).join("eval.json"));
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
