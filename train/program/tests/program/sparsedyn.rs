//! SparseDynGS: motion is recovered and the future is predicted; every way of integration trains; a resumed run is the
//! same to the bit.

use std::fs;
use std::path::Path;

use gs_burn::glam::{DQuat, DVec3};
use gs_models::sparsedyn::bodies::BodyPose;
use gs_pipelines::fit::read_model;
use gs_pipelines::sparsedyn::Sparsedyn;
use gs_train::run::checkpoint::Checkpoint;
use gs_train::run::watch::Job;
use gs_worlds::extrapolation::World;

use crate::common::{self, read_json};

fn job(world: &Path, folder: &Path, steps: usize, overrides: &[&str]) -> Job {
    let own = ["pipeline=sparsedyn", "data.background=[1.0,1.0,1.0]", "density.cap=1500"];
    let all: Vec<&str> = own.into_iter().chain(overrides.iter().copied()).collect();
    common::job(world, folder, &common::config(steps, &all))
}

fn model(job: &Job, steps: usize) -> Sparsedyn {
    let file = Checkpoint::load(&job.folder.checkpoint(steps)).expect("loads");
    read_model::<Sparsedyn>(&file, &common::device()).expect("a scene").0.method
}

/// Every way of asking, every integrator, the hybrid and both baselines take steps in every phase, save, and are
/// measured at future times.
#[test]
fn every_way_trains_and_is_measured() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = common::future(folder, World::Duo, (24, 32), 4);
    for (index, keys) in [
        ["dynamics.ask=stage", "dynamics.integrator=rk2", "bodies.mode=field"],
        ["dynamics.ask=step", "dynamics.integrator=rk4", "bodies.nodes=0"],
        ["dynamics.ask=start", "dynamics.integrator=screw", "bodies.mode=bodies"],
        ["dynamics.model=hybrid", "dynamics.ask=start", "moving.select=false"],
        ["dynamics.model=trace", "dynamics.integrator=rk2", "moving.select=false"],
        ["dynamics.model=freegave", "dynamics.ask=stage", "moving.select=false"],
        ["dynamics.model=freegave", "dynamics.lr=1e-8", "moving.select=false"],
    ]
    .iter()
    .enumerate()
    {
        let job = job(&world, &folder.join(index.to_string()), 30, keys);
        let eval = common::finish(&job);
        let measured = &eval.last.measured;
        assert_eq!((measured.split.as_str(), eval.skipped_steps), ("test", 0), "{keys:?}");
        assert!(measured.quality.mean.psnr.is_finite() && measured.quality.mean.psnr > 5.0, "{keys:?}");
        assert!(measured.quality.psnr_of_mean_error <= measured.quality.mean.psnr + 1e-9, "{keys:?}");
        let seen = measured.figures.iter().find(|figure| figure.key == "seen").map(|figure| figure.value);
        assert!(seen.is_some_and(|psnr| psnr > 5.0), "{keys:?}: {seen:?}");
        let frame = model(&job, 30).frame;
        // After the last step FreeGave freezes what hardly moved.
        if keys.contains(&"dynamics.lr=1e-8") {
            assert!(frame.rows.is_empty(), "{} of {} move", frame.rows.len(), measured.size.gaussians);
        } else if keys.contains(&"moving.select=false") {
            assert!(!frame.rows.is_empty(), "{keys:?}: nothing moves");
        }
        if keys.contains(&"bodies.mode=bodies") && !frame.bodies.is_empty() {
            assert!(
                frame.labels.iter().all(|label| *label >= 0),
                "every moving Gaussian is of a body: {:?}",
                frame.labels
            );
        }
    }
}

#[test]
fn it_resumes_to_the_same_bits() {
    const STEPS: usize = 60;
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = common::future(folder, World::Fan, (24, 32), 4);
    let [whole, resumed] = ["whole", "resumed"].map(|name| job(&world, &folder.join(name), STEPS, &[]));
    common::finish(&whole);
    // In the warm-up, while bodies move freely, and after their laws are chosen.
    common::finish_interrupted(&resumed, &[7, 30, 52]);
    let bits = |job: &Job| fs::read(job.folder.checkpoint(STEPS)).expect("saved");
    assert!(bits(&whole) == bits(&resumed), "the resumed run differs");
}

/// A rotor that turns evenly is one body. At time 1, a quarter of the recording after the last frame that was seen, its
/// angle is right to 3 degrees, and its pivot to 2 % of its size.
#[test]
fn a_rotation_is_found_and_goes_on() {
    const STEPS: usize = 2000;
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = common::future(folder, World::Fan, (80, 60), 7);
    let learned = job(&world, &folder.join("learned"), STEPS, &[]);
    let eval = common::finish(&learned);
    let model = model(&learned, STEPS);
    let bodies = model.bodies.as_ref().expect("bodies");
    let of = |body: usize| model.frame.labels.iter().filter(|label| **label == body as i32).count();
    let body = (0..bodies.len()).max_by_key(|body| of(*body)).expect("a body");
    let json = read_json(&world.join("transforms_train.json"));
    let vector = |key: &str| {
        let numbers = json["movers"][0]["poses"][0][key].as_array().expect("three").iter();
        DVec3::from_slice(&numbers.filter_map(serde_json::Value::as_f64).collect::<Vec<_>>())
    };
    let truth = DQuat::from_scaled_axis(vector("angular_velocity"));
    let pose = bodies.all()[body].pose(&bodies.span, 1.0);
    let words = model.body_lines().join("; ");
    let table = eval.last.measured.tables.iter().find(|table| table.title == "Bodies").expect("a table of the bodies");
    assert!(table.rows[body][2].ends_with("% sure"), "{:?}", table.rows);
    let psnr = eval.last.mean().psnr;
    let angle = pose.rotation.angle_between(truth).to_degrees();
    assert!(angle < 3.0, "{angle} degrees off at time 1: {words}, {psnr} dB");
    // The rotor turns about its own origin, which stays where it is.
    let first = DVec3::from_array(bodies.frames[body].centre);
    let drift = pose.apply(vector("position"), first).distance(vector("position"));
    assert!(drift < 0.02 * ROTOR, "the pivot drifts by {drift}: {words}, {psnr} dB");
}

/// The radius of the rotor, metres.
const ROTOR: f64 = 1.0;

/// The pose at time 1 of the body with most Gaussians, learned from six cameras in 3000 steps, with its centre in the
/// first frame, and words for messages.
fn largest_at_1(world: World) -> (BodyPose, DVec3, String) {
    const STEPS: usize = 3000;
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = common::future(folder, world, (96, 60), 7);
    let learned = job(&world, &folder.join("learned"), STEPS, &[]);
    let psnr = common::finish(&learned).last.mean().psnr;
    let model = model(&learned, STEPS);
    let bodies = model.bodies.as_ref().expect("bodies");
    let of = |body: usize| model.frame.labels.iter().filter(|label| **label == body as i32).count();
    let body = (0..bodies.len()).max_by_key(|body| of(*body)).expect("a body");
    let words = format!("{}, {psnr} dB", model.body_lines().join("; "));
    (bodies.all()[body].pose(&bodies.span, 1.0), DVec3::from_array(bodies.frames[body].centre), words)
}

/// A ball that falls freely is where it should be at time 1, a quarter of the recording after the last frame that was
/// seen, to 3 % of its path.
///
/// `cargo test --release --workspace --test sparsedyn -- --ignored a_fall` takes a minute or two.
#[test]
#[ignore = "takes more than 30 seconds"]
fn a_fall_goes_on() {
    // Metres, and metres per unit of time squared: the world's own numbers.
    let (first, acceleration) = (DVec3::new(-0.42, 0.0, 0.92), DVec3::new(0.0, 0.0, -3.4));
    let (pose, centre, words) = largest_at_1(World::FallingBall);
    let truth = 0.5 * acceleration;
    let off = (pose.apply(first, centre) - first).distance(truth);
    println!("{off} metres off after a path of {}: {words}", truth.length());
    assert!(off < 0.03 * truth.length(), "{off} metres off after a path of {}: {words}", truth.length());
}

/// A pendulum of 0.6 radians has turned at time 1 by what it should, to 5 % of that angle.
///
/// `cargo test --release --workspace --test sparsedyn -- --ignored a_swing` takes a minute or two.
#[test]
#[ignore = "takes more than 30 seconds"]
fn a_swing_goes_on() {
    // Radians and units of time: the world's own numbers.
    let (amplitude, period) = (0.6, 1.3);
    let angle = amplitude * ((std::f64::consts::TAU / period).cos() - 1.0);
    let (pose, _, words) = largest_at_1(World::Pendulum);
    let off = pose.rotation.angle_between(DQuat::from_axis_angle(DVec3::Y, angle));
    println!("{off} of {angle} radians off: {words}");
    assert!(off < 0.05 * angle.abs(), "{off} of {angle} radians off: {words}");
}

/// Largest difference between backends, dB. Sums in another order differ in the seventh digit, and Adam's first steps
/// have full length whatever the gradient.
const BACKENDS_APART: f64 = 0.05;

/// The pipeline without bodies, whose choice is discrete, on each backend of the build and on the device that the tests
/// were asked for: the same scene as on the first, but for rounding.
#[test]
fn every_backend_trains_the_same_scene() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = common::future(folder, World::Duo, (24, 32), 4);
    let mut names: Vec<String> = common::backends().map(String::from).collect();
    if !names.contains(&common::device_name()) {
        names.push(common::device_name());
    }
    let trained: Vec<(&String, f64)> = names
        .iter()
        .map(|name| {
            let keys = ["bodies.mode=field", "dynamics.ask=step"];
            let run =
                Job { device: common::named(name), ..job(&world, &folder.join(name.replace(':', "_")), 40, &keys) };
            (name, common::finish(&run).last.mean().psnr)
        })
        .collect();
    println!("{trained:?}");
    for (name, psnr) in &trained {
        let apart = (psnr - trained[0].1).abs();
        assert!(apart <= BACKENDS_APART, "{name}: {psnr} dB, {}: {} dB", trained[0].0, trained[0].1);
    }
}

/// Without points and priors, Gaussians begin on the hull of the outlines: none lies far from the objects, as random
/// ones in the cameras' view would.
#[test]
fn photos_alone_begin_on_the_hull_of_the_outlines() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = common::future(folder, World::Duo, (48, 8), 6);
    fs::remove_file(world.join("points3d.ply")).expect("removed");
    let mut reach = f64::INFINITY;
    for split in ["train", "val", "test"] {
        let path = world.join(format!("transforms_{split}.json"));
        let mut json = read_json(&path);
        json.as_object_mut().expect("an object").remove("ply_file_path");
        for frame in json["frames"].as_array_mut().expect("frames") {
            let frame = frame.as_object_mut().expect("a frame");
            frame.retain(|key, _| !key.starts_with("depth") && !key.starts_with("confidence"));
            let position = |row: usize| frame["transform_matrix"][row][3].as_f64().expect("a number");
            reach = reach.min(DVec3::new(position(0), position(1), position(2)).length());
        }
        fs::write(&path, json.to_string()).expect("written");
    }
    let job = job(&world, &folder.join("run"), 1, &["eval.lpips=false"]);
    common::finish(&job);
    let means = gs_splats::ply::read(&job.folder.ply()).expect("a scene").splats.means.into_flattened();
    // Objects fill about half of the way from the middle to the cameras at most; random points lie from 0.3 to 3 of it
    // before them.
    let far =
        means.chunks_exact(3).filter(|x| DVec3::new(x[0].into(), x[1].into(), x[2].into()).length() > 0.6 * reach);
    let count = means.len() / 3;
    assert!(count > 100, "{count} Gaussians");
    assert_eq!(far.count(), 0, "of {count} Gaussians, cameras from {reach} on");
}

#[test]
fn a_set_with_one_photo_of_a_time_is_refused_in_a_sentence() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let world = common::future(folder, World::Fan, (16, 32), 3);
    common::edit(&world, "transforms_train.json", |frames| frames.truncate(1));
    let error = common::train(&job(&world, &folder.join("run"), 4, &[])).expect_err("one photo").to_string();
    assert!(error.contains("at least 2 training photos with times"), "{error}");
    assert!(
        !folder.join("run/checkpoints").exists()
            || fs::read_dir(folder.join("run/checkpoints")).expect("read").count() == 0
    );
}
