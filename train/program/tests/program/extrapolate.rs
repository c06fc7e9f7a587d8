//! `gsburn extrapolate`: its files are whole and repeat to the bit, bad input is a sentence, and its uncertainty
//! behaves as one.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use burn::tensor::Tensor;
use gs_burn::Gaussians;
use gs_burn::glam::{DMat4, DVec3};
use gs_datasets::View;
use gs_models::sparsedyn::bodies::{Bodies, Body, BodyFrame, Law, LawValues, Term};
use gs_pipelines::sparsedyn::Sparsedyn;
use gs_pipelines::sparsedyn::future::RolledFuture;
use gs_pipelines::sparsedyn::model::Frame;
use gs_train::fit::extrapolation::Extrapolation;
use gsburn::report::future::motion::angular_velocities;
use gsburn::report::future::spread::{Spread, moving_rows};

use crate::common;

use crate::common::program::{fails, fails_with, says, succeeds};

/// A tiny world of four cameras, one of them held out, and a run on it of few steps.
fn trained(folder: &Path) {
    let size = ["--size", "24x24", "--cameras", "4", "--held-out", "1", "--frames", "32", "--truth-every", "32"];
    succeeds(folder, &[&["synth", "extrapolation", "fan", "--out", "world"][..], &size].concat());
    let keys = ["pipeline=sparsedyn", "data.background=[1.0,1.0,1.0]", "density.cap=1500", "eval.ms_ssim=false"];
    let keys: Vec<&str> =
        keys.iter().chain(&["eval.lpips=false", "eval.images=1"]).flat_map(|key| ["--set", *key]).collect();
    let train = ["train", "world", "--out", "run", "--steps", "60", "--quiet"];
    succeeds(folder, &[&train[..], &keys].concat());
}

/// All files of a folder with their bytes.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut left = vec![folder.to_path_buf()];
    while let Some(next) = left.pop() {
        for entry in fs::read_dir(next).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                left.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("inside").to_path_buf();
                found.insert(name, fs::read(path).expect("read"));
            }
        }
    }
    found
}

const ASKED: [&str; 12] =
    ["extrapolate", "run", "--to", "1.2", "--frames", "5", "--ply", "--bodies", "--camera", "orbit", "--members", "4"];

#[test]
fn a_run_is_extrapolated_into_whole_files_that_repeat() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    trained(folder);
    let report = fs::read_to_string(folder.join("run/report.html")).expect("read");
    assert!(
        report.contains("<h2>Future</h2>"),
        "the report of a training with photos of later times has their section"
    );

    let said = succeeds(folder, &ASKED);
    assert!(said.contains("gain over held") && said.contains("spread of 4 members"), "{said}");
    let files = contents(&folder.join("run/extrapolate"));
    let count = |part: &str| files.keys().filter(|path| path.starts_with(part)).count();
    // Five frames and an animation.
    assert_eq!((count("frames"), count("ply")), (6, 5), "{:?}", files.keys());
    for (path, bytes) in &files {
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("png") => assert!(image::load_from_memory(bytes).expect("an image").width() >= 24, "{path:?}"),
            Some("gif") => assert!(bytes.starts_with(b"GIF89a") && bytes.ends_with(&[0x3b]), "{path:?}"),
            Some("svg") => assert!(bytes.ends_with(b"</svg>\n"), "{path:?}"),
            Some("ply") => assert!(bytes.starts_with(b"ply"), "{path:?}"),
            Some("json") => drop(serde_json::from_slice::<serde_json::Value>(bytes).expect("JSON")),
            _ => panic!("{path:?}"),
        }
    }
    for name in ["trajectories.png", "speed.png", "velocity.png", "angular_velocity.png", "uncertainty.png"] {
        assert!(files.contains_key(Path::new(name)), "{name}");
    }
    let json: serde_json::Value = serde_json::from_slice(&files[Path::new("extrapolate.json")]).expect("JSON");
    let future = &json["future"][0];
    let number = |key: &str| future["future"][key].as_f64().expect("a number");
    assert_eq!(future["split"], "test");
    assert!((number("psnr") - number("held") - number("gain")).abs() < 1e-9);
    let moments = future["moments"].as_array().expect("times");
    assert!(moments.iter().all(|m| m["held"].is_number() == (m["time"].as_f64() > json["seen"][1].as_f64())));
    let parts = json["parts"].as_array().expect("parts");
    let in_parts: u64 = parts.iter().filter_map(|part| part["gaussians"].as_u64()).sum();
    let whole = gs_splats::ply::read(&folder.join("run/scene.ply")).expect("a scene").splats;
    assert_eq!(in_parts, whole.len() as u64, "each Gaussian is in one part");
    assert_eq!(count("bodies"), parts.len() + 1, "a file for each part and their list");

    // The results are there, whether or not the report of the run can be written.
    let report = fs::read(folder.join("run/report.html")).expect("read");
    fs::write(folder.join("run/report.html"), "another page").expect("written");
    let [_, warned] = says(folder, &[&ASKED[..], &["--out", "again"]].concat());
    assert!(warned.contains("report.html") && warned.contains("the report is left as it is"), "{warned}");
    fs::write(folder.join("run/report.html"), report).expect("written");
    assert!(contents(&folder.join("again")) == files, "another call writes other bytes");
    succeeds(folder, &["extrapolate", "run", "--to", "0.9", "--members", "0", "--out", "again"]);
    let files = contents(&folder.join("again"));
    assert!(files.keys().all(|path| !path.starts_with("ply") && !path.starts_with("bodies")), "{:?}", files.keys());
    let said =
        succeeds(folder, &["extrapolate", "run", "--to", "0.9", "--step", "3.5", "--members", "0", "--out", "steps"]);
    assert!(said.contains("steps of 3.5 frames move a Gaussian by at most"), "{said}");
    refused(folder);
}

/// Requests that cannot be met, and files of others.
fn refused(folder: &Path) {
    for (code, args, said) in [
        (1, vec!["--to", "0.5"], "expected a time after 0.75"),
        (1, vec!["--to", "1e9"], "expected a time up to"),
        (2, vec!["--to", "nan"], "expected a finite number"),
        (2, vec!["--to", "1", "--frames", "0"], "not in 1..=10000"),
        (1, vec!["--to", "1", "--step", "1000"], "expected a step of 0.01 to 100 frames, found 1000"),
        (2, vec!["--to", "1", "--members", "1"], "expected 0, or 2 to 1000 members"),
        (1, vec!["--to", "1", "--camera", "cam77"], "expected orbit or one of cam00"),
    ] {
        let error = fails_with(code, folder, &[&["extrapolate", "run", "--out", "no"][..], &args].concat());
        assert!(error.contains(said), "{args:?}: {error}");
    }
    let error = fails(folder, &["extrapolate", "run/scene.ply", "--to", "1", "--out", "no"]);
    assert!(error.contains("found a PLY file"), "{error}");
    fs::create_dir_all(folder.join("mine")).expect("made");
    fs::write(folder.join("mine/speed.png"), "a photo").expect("written");
    let error = fails(folder, &["extrapolate", "run", "--to", "1", "--out", "mine"]);
    assert!(error.contains("mine/speed.png") && error.contains("found another"), "{error}");
}

/// The angular velocity of the body, radians per unit of time.
const SPIN: f64 = 6.0;

/// Positions of 40 Gaussians on a disk of radius 1, of which the first ten rest.
fn disk() -> Vec<[f64; 3]> {
    let at = |k: usize| (0.3 + 0.7 * (k % 5) as f64 / 4.0, 0.7 * k as f64);
    (0..40).map(|k| (at(k).0 * at(k).1.cos(), at(k).0 * at(k).1.sin(), 0.0)).map(|(x, y, z)| [x, y, z]).collect()
}

/// A disk seen by one camera from a distance of 4 over 0 to 0.75; all but the first ten Gaussians move.
fn future(body: bool) -> RolledFuture {
    let device = common::device();
    let means: Vec<f32> = disk().into_iter().flatten().map(|x| x as f32).collect();
    let rows = means.len() / 3;
    let quats: Vec<f32> = (0..rows).flat_map(|_| [1.0, 0.0, 0.0, 0.0]).collect();
    let tensor = |values: Vec<f32>, columns: usize| gs_train::fit::parameters::from_host(values, columns, &device);
    let gaussians = Gaussians::from_tensors(
        tensor(means, 3),
        tensor(quats, 4),
        Tensor::full([rows, 3], -3.0, &device),
        Tensor::full([rows], 2.0, &device),
        Tensor::zeros([rows, 1, 3], &device),
    );
    let turning = BodyFrame::of([0.0; 3], Law::of(&[Term::Spin, Term::Pivot]), 0.0);
    let mut values = LawValues::REST;
    values.set(Term::Spin, DVec3::new(0.0, 0.0, SPIN));
    let frame = Frame {
        clock: Default::default(),
        rows: (10..rows as u32).collect(),
        labels: vec![if body { 0 } else { -1 }; rows - 10],
        bodies: if body { vec![turning.clone()] } else { Vec::new() },
        nodes: Vec::new(),
        knots: 0,
        pixel: 0.04,
        start: 0.0,
        span: [0.0, 0.75],
        step: 2.0 / 60.0,
        centre: [0.0; 3],
        length: 0.7,
    };
    let config = common::typed::<Sparsedyn>(&common::config(10, &["pipeline=sparsedyn"]));
    let mut method = Sparsedyn::new(frame, &config.method.dynamics, 3, &device);
    if body {
        let span = method.frame.bodies_span();
        method.bodies = Some(Bodies::new(&[Body::of(turning, values)], span, &device));
    }
    let view = |k: usize| View {
        time: Some(k as f64 / 60.0),
        c2w: DMat4::from_translation(DVec3::new(0.0, 0.0, -4.0)),
        ..View::blank(100, 100)
    };
    RolledFuture::new(&method, &gaussians, &(0..=45).map(view).collect::<Vec<_>>(), &config)
}

const MEMBERS: usize = 16;

#[test]
fn the_spread_of_a_rotating_body_grows_with_the_horizon() {
    let future = future(true);
    let scene = future.scene();
    let rows = moving_rows(&*scene, &[0.0, 0.3, 0.75], 0.01);
    assert_eq!(rows, (10..40).collect::<Vec<u32>>());
    // After whole turns errors of the pivot and of the axis' direction lead back to where they began: the angle's error
    // is left, and it grows in proportion to time.
    let turn = std::f64::consts::TAU / SPIN;
    let times = [0.0, turn, 2.0 * turn, 4.0 * turn, 0.25];
    let spread = Spread::of(&future.members(MEMBERS).expect("members"), &times);
    let medians: Vec<f64> = spread.summary(&rows).iter().map(|at| at.median).collect();
    assert!(medians[0] < 1e-6, "all members begin where the Gaussians are: {medians:?}");
    for pair in medians[1..4].windows(2) {
        // Angles of some 0.05 are bent by less than their cube.
        assert!((pair[1] / pair[0] - 2.0).abs() < 0.1, "{medians:?}");
    }
    // A single pose of one independent in four has a deviation of sqrt(3) times that of a coordinate; a draw is cut at
    // twice the expected.
    assert!(medians[4] < 2.0 * 3.0_f64.sqrt() * 2.0 * future.noise(), "{medians:?} for a noise of {}", future.noise());
    let still = spread.summary(&(0..10).collect::<Vec<u32>>());
    assert!(still.iter().all(|at| at.rms == 0.0), "static Gaussians are in no doubt: {still:?}");
    let again = Spread::of(&future.members(MEMBERS).expect("members"), &times);
    assert_eq!(spread, again);

    let turning = angular_velocities(&*scene, 0.9);
    for (row, w) in turning.iter().enumerate() {
        let truth = if row < 10 { DVec3::ZERO } else { DVec3::Z * SPIN };
        // Quaternions of f32 over 1.5e-3 units of time: 6e-8 x 4 / 1.5e-3, with room for the sine and cosine of the
        // rotation.
        assert!(w.distance(truth) < 5e-3, "Gaussian {row}: {w}");
    }
}

/// The field's last layer is moved until the spread over the seen times is that of the noise.
#[test]
fn the_spread_of_the_field_is_that_of_the_noise_while_it_is_seen() {
    let future = future(false);
    // 0.3 pixels at a distance of 4 with a focal length of 100 pixels.
    assert!((future.noise() - 0.012).abs() < 1e-6);
    let seen: Vec<f64> = (0..=45).map(|k| f64::from(k) / 60.0).collect();
    let spread = Spread::of(&future.members(MEMBERS).expect("members"), &[&seen[..], &[1.5]].concat());
    let rows: Vec<u32> = (10..40).collect();
    let summary = spread.summary(&rows);
    let seen = &summary[..46];
    let rms = (seen.iter().map(|at| at.rms * at.rms).sum::<f64>() / seen.len() as f64).sqrt();
    let expected = 3.0_f64.sqrt() * future.noise();
    // Sixteen members whose scale was found with sixteen others: a deviation of 18 % each, three times both together.
    assert!((rms / expected).ln().abs() < 3.0 * 0.25, "{rms} for {expected}");
    assert!(summary[46].rms > 2.0 * summary[45].rms, "{:?} after {:?}", summary[46], summary[45]);
}

#[test]
fn another_step_changes_what_is_integrated_and_not_what_follows_a_law() {
    let law = future(true);
    let stepped = law.with_step(7.0).expect("a step");
    let [a, b] = [law.scene(), stepped.scene()].map(|scene| scene.at(1.3).means.val().into_data());
    assert_eq!(a, b);
    assert!(law.with_step(0.0).is_err() && law.with_step(f64::NAN).is_err() && law.with_step(101.0).is_err());
    assert!(stepped.last() > law.last(), "longer steps reach farther");
    let parts = law.parts();
    assert_eq!(parts.iter().map(|part| part.rows.len()).collect::<Vec<_>>(), [30, 10]);
    assert_eq!(parts[0].terms[0], ("angular_velocity".to_string(), vec![0.0, 0.0, SPIN]));
}
