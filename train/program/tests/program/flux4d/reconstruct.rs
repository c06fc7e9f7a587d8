//! Reconstruction: what a network and a polish make of a street.

use std::fs;
use std::path::Path;

use burn::tensor::Tensor;
use gs_driving::Snippet;
use gs_models::flux4d::channels::{CHANNELS, OPACITY};
use gs_pipelines::flux4d::config::FluxConfig;
use gs_pipelines::flux4d::evaluate::color;
use gs_pipelines::flux4d::host_view::HostView;
use gs_pipelines::flux4d::infer::infer;
use gs_pipelines::flux4d::logs;
use gs_pipelines::flux4d::network::FluxNetwork;
use gs_pipelines::flux4d::polish::polish;
use gs_pipelines::flux4d::prepare::prepare;
use gs_pipelines::flux4d::sample::{camera, photo};
use gs_pipelines::{Reconstruction, networks_of};
use gs_splats::ply;
use gs_train::run::checkpoint::Checkpoint;
use gs_train::run::metrics::psnr;
use gs_train::run::watch::Job;
use gs_worlds::driving::write;

use crate::common::program::{fails, fails_with, says, succeeds};
use crate::common::streets::{SMALL, small_street, streets};
use crate::common::{self, read_json};

/// The mean PSNR of the frames between the inputs of a street, dB, by the untrained network's Gaussians, whose
/// opacities (logits) are all changed by the best number.
pub fn best_of_one_opacity(log: &Path, job: &Job) -> f64 {
    let (device, config) = (common::device(), FluxConfig::from_table(&job.config, "the test").expect("valid"));
    let log = logs::open(log, &config.own.logs).expect("a log");
    let host = prepare(&log, &Snippet::new(0, 11), "street", &config.own.lift, config.seed).expect("a snippet");
    let network = FluxNetwork::new(&config, &device);
    let inferred = infer(&network, &host, &log, &config, &device).expect("applied");
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
pub fn reconstructs(log: &Path, job: &Job, folder: &Path) {
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
    assert!(
        read_json(&out.join("reconstruction.json"))["tables"][0]["rows"].as_array().is_some_and(|rows| rows.len() > 1)
    );
    let actors = read_json(&out.join("actors.json"))["snippets"][0]["actors"].as_array().expect("a list").clone();
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
    let count = || read_json(&out.join("reconstruction.json"))["gaussians"].as_u64().expect("a number");
    networks.reconstruct(&checkpoint, &request).expect("as before");
    let (before, set) = (count(), ["lift.sky_points=40".to_string()]);
    networks.reconstruct(&checkpoint, &Reconstruction { set: &set, ..request }).expect("with less sky");
    // The training has 100.
    assert_eq!(count(), before - 60);
    let set = ["unet.width=0.5".to_string()];
    assert!(refused(Reconstruction { set: &set, ..request }).contains("those of the network"));
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
    let network = FluxNetwork::new(&config, &device);
    let mut inferred = infer(&network, &host, &log, &config, &device).expect("applied");
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
