//! Through the program: the schedule is shown, a model is chosen, and unusual input gives a stated result or one
//! sentence.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::common::program::{fails, says, succeeds};
use crate::common::read_json;

/// Keys of every run: small, and without measures that take longer than the training.
const KEYS: [&str; 6] = [
    "pipeline=sparsedyn",
    "data.background=[1.0,1.0,1.0]",
    "density.cap=600",
    "eval.ms_ssim=false",
    "eval.lpips=false",
    "eval.images=1",
];

/// A rotor before four cameras, one of them held out: 24 of 32 frames are seen.
fn world(folder: &Path) {
    let size = ["--size", "24x24", "--cameras", "4", "--held-out", "1", "--frames", "32", "--truth-every", "32"];
    says(folder, &[&["synth", "extrapolation", "fan", "--out", "world"][..], &size].concat());
}

/// Trains on `world` into `run`.
fn trains(folder: &Path, run: &str, steps: &str, keys: &[&str]) -> String {
    let set: Vec<&str> = KEYS.iter().chain(keys).flat_map(|key| ["--set", *key]).collect();
    says(folder, &[&["train", "world", "--out", run, "--steps", steps][..], &set].concat()).join("\n")
}

/// Changes the description of every split.
fn edit(folder: &Path, change: impl Fn(&mut Value)) {
    for split in ["train", "val", "test"] {
        let path = folder.join(format!("world/transforms_{split}.json"));
        let mut json = read_json(&path);
        change(&mut json);
        fs::write(&path, json.to_string()).expect("written");
    }
}

/// Changes every frame of every split.
fn edit_frames(folder: &Path, change: impl Fn(&mut Value)) {
    edit(folder, |json| json["frames"].as_array_mut().expect("frames").iter_mut().for_each(&change));
}

/// The figures of a run: PSNR, and the mean speed at the first frame.
fn figures(folder: &Path, run: &str) -> (f64, f64) {
    let json = read_json(&folder.join(run).join("eval.json"));
    let speed = json["figures"].as_array().expect("figures").iter().find(|figure| figure["key"] == "mean_speed");
    (json["psnr"].as_f64().expect("a number"), speed.expect("a speed")["value"].as_f64().expect("a number"))
}

#[test]
fn the_schedule_is_printed_and_plotted() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    world(folder);
    let said = trains(folder, "run", "40", &[]);
    // A fifth of 40 steps is the warm-up, half of the others grow the window.
    for line in [
        "schedule: steps 1 to 8: the first frame alone",
        "schedule: steps 9 to ",
        "a window of 1 frame that grows by 1 every ",
        " to 40: a frame from number ",
        "and 4 earlier ones at a weight of 0.5 together",
        "schedule: bodies are looked for ",
        "schedule plotted in ",
    ] {
        assert!(said.contains(line), "{line}: {said}");
    }
    let plot = fs::read_to_string(folder.join("run/plots/schedule.svg")).expect("a plot");
    for name in ["motion begins", "bodies are looked for", "laws are chosen", "end of the window", "times replayed"] {
        assert!(plot.contains(name), "{name}");
    }
    assert!(plot.matches("<circle").count() > 40, "a dot for each step, and for replays");
    assert!(fs::read_to_string(folder.join("run/report.html")).expect("read").contains("end of the window"));

    let said = trains(folder, "field", "20", &["bodies.mode=field", "curriculum.growth=0"]);
    assert!(!said.contains("bodies are looked for") && !said.contains("a window of"), "{said}");
}

/// A sweep over `world` of runs of six steps, without the cap of [`KEYS`].
fn sweep<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let keys = KEYS.into_iter().filter(|key| !key.starts_with("density")).chain(["steps=6"]);
    let set = keys.flat_map(|key| ["--set", key]);
    ["sweep", "world"].into_iter().chain(set).chain(more.iter().copied()).collect()
}

#[test]
fn a_model_is_chosen_by_validation_and_not_by_the_reported_split() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    world(folder);
    let error = fails(folder, &sweep(&["--out", "swept", "--choose", "smallest", "--choose-by", "test"]));
    assert!(error.contains("not the reported one"), "{error}");
    let error = fails(folder, &sweep(&["--out", "swept", "--choose", "smallest", "--choose-by", "nowhere"]));
    assert!(error.contains("\"nowhere\"") && error.contains("validation"), "{error}");
    assert!(!folder.join("swept").exists(), "nothing was trained for a choice that cannot be made");

    let said = says(folder, &sweep(&["--out", "swept", "--choose", "smallest"])).join("\n");
    assert!(said.contains("run 8 of 8: width-64_bands-3_cap-20000") && said.contains("chosen: width-"), "{said}");
    let table = fs::read_to_string(folder.join("swept/choice.md")).expect("a table");
    assert_eq!(table.lines().filter(|line| line.starts_with("| width-")).count(), 8, "{table}");
    assert!(table.contains("images of validation") && table.contains("| chosen"), "{table}");
    assert!(table.contains("reported dB"), "{table}");
    // Finished runs are not trained again, and the choice is the same.
    let again = says(folder, &sweep(&["--out", "swept", "--choose", "smallest"])).join("\n");
    assert_eq!(again.matches("finished already").count(), 8);
    assert_eq!(fs::read_to_string(folder.join("swept/choice.md")).expect("a table"), table);

    let around =
        ["--one-at-a-time", "--over", "dynamics.step_frames=1,2.0", "--over", "dynamics.ask=step", "--out", "star"];
    let said = says(folder, &sweep(&around)).join("\n");
    assert!(said.contains("step_frames-2.0: has the configuration of base; left out"), "{said}");
    assert!(said.contains("run 3 of 3: ask-step"), "{said}");
    let chart = fs::read_to_string(folder.join("star/chart.svg")).expect("a chart");
    assert!(chart.contains("best at its cost"), "{chart}");
    let table = fs::read_to_string(folder.join("star/chart.md")).expect("a table");
    assert!(table.contains("| base |") && table.contains("| ask-step |"), "{table}");
}

/// The same recording with times in another unit and from another origin: learned the same, answered in its own unit.
#[test]
fn times_outside_0_to_1_are_learned_the_same() {
    const UNIT: f64 = 250.0;
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    world(folder);
    // So short a run says nothing of bodies, and all would rest.
    let plain = trains(folder, "plain", "60", &["bodies.mode=field"]);
    assert!(!plain.contains("times are learned in units"), "{plain}");
    edit(folder, |json| {
        json.as_object_mut().expect("an object").remove("movers");
        for frame in json["frames"].as_array_mut().expect("frames") {
            frame["time"] = json!(100.0 + UNIT * frame["time"].as_f64().expect("a time"));
        }
    });
    let said = trains(folder, "scaled", "60", &["bodies.mode=field"]);
    assert!(said.contains("times are learned in units of 250,"), "{said}");
    let ((psnr, speed), (scaled_psnr, scaled_speed)) = (figures(folder, "plain"), figures(folder, "scaled"));
    println!("{psnr} and {scaled_psnr} dB, {speed} and {scaled_speed} units/time");
    // Times differ by the rounding of f64; sixty steps of f32 do not make more of it than these.
    assert!((psnr - scaled_psnr).abs() < 0.2, "{psnr} and {scaled_psnr}");
    assert!((scaled_speed * UNIT / speed).ln().abs() < 0.1, "{speed} and {scaled_speed} x {UNIT}");
    let error = fails(folder, &["extrapolate", "scaled", "--to", "0.9", "--out", "no"]);
    assert!(error.contains("expected a time after 287.5"), "{error}");
    let said = says(folder, &["extrapolate", "scaled", "--to", "350", "--frames", "3", "--out", "later"]).join("\n");
    assert!(said.contains("gain over held"), "{said}");
    let info = says(folder, &["info", "scaled"]).join("\n");
    assert!(info.contains("100 to 287.5"), "{info}");
}

/// Frames are missing irregularly: the recording has the times that are left, and a step has the length of two median
/// frames.
#[test]
fn times_may_be_unevenly_spaced() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    world(folder);
    edit(folder, |json| {
        let frames = json["frames"].as_array_mut().expect("frames");
        let index = |frame: &Value| (32.0 * frame["time"].as_f64().expect("a time")).round() as usize;
        frames.retain(|frame| ![1, 2, 4].contains(&(index(frame) % 7)));
    });
    let said = trains(folder, "run", "40", &["dynamics.ask=step", "bodies.mode=field"]);
    let kept = (0..=24).filter(|index| ![1, 2, 4].contains(&(index % 7))).count();
    assert!(said.contains(&format!("{kept} frames from 0 to ")), "{said}");
    let (psnr, _) = figures(folder, "run");
    assert!(psnr.is_finite() && psnr > 5.0, "{psnr}");
    // A run of the field, rolled out with half the step it was trained with.
    let said =
        succeeds(folder, &["extrapolate", "run", "--to", "1.1", "--step", "1", "--frames", "3", "--members", "0"]);
    assert!(said.contains("steps of 1 frames move a Gaussian by at most"), "{said}");
}

#[test]
fn one_camera_and_points_that_no_photo_shows_are_told() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    world(folder);
    let header = "ply\nformat ascii 1.0\nelement vertex 120\nproperty float x\nproperty float y\nproperty float z\n\
                  property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
    let far = format!("{header}{}", (0..120).map(|i| format!("{i} 0 900 255 0 0\n")).collect::<String>());
    fs::write(folder.join("world/points3d.ply"), far).expect("written");
    edit_frames(folder, |frame| {
        frame.as_object_mut().expect("a frame").retain(|key, _| !key.starts_with("depth") && !key.starts_with("conf"));
    });
    let said = trains(folder, "behind", "6", &[]);
    assert!(said.contains("no photo of the first frame shows any of the data set's 120 points"), "{said}");
    edit(folder, |json| {
        let frames = json["frames"].as_array_mut().expect("frames");
        let first = frames.first().map(|frame| frame["camera_id"].clone());
        frames.retain(|frame| Some(&frame["camera_id"]) == first.as_ref());
    });
    let said = trains(folder, "alone", "6", &[]);
    assert!(said.contains("warning: the first frame has 1 photo, expected 2 or more"), "{said}");
    edit_frames(folder, |frame| drop(frame.as_object_mut().expect("a frame").remove("time")));
    let error = fails(folder, &["train", "world", "--out", "no", "--set", "pipeline=sparsedyn"]);
    assert!(error.contains("expected a time for each frame, found none"), "{error}");
}

/// A depth prior of some pixels, from `value` to twice of it, as NPY.
fn npy(path: &Path, [height, width]: [usize; 2], value: f32) {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({height}, {width}), }}");
    let padded = format!("{header:<117}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((padded.len() as u16).to_le_bytes());
    bytes.extend(padded.bytes());
    let count = height * width;
    bytes.extend((0..count).flat_map(|pixel| (value * (1.0 + pixel as f32 / count as f32)).to_le_bytes()));
    fs::write(path, bytes).expect("written");
}

#[test]
fn priors_of_another_shape_or_without_a_valid_pixel_are_left_out() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    world(folder);
    edit_frames(folder, |frame| {
        if frame.get("depth_file_path").is_some() {
            frame["depth_file_path"] = json!("prior.npy");
            frame.as_object_mut().expect("a frame").remove("confidence_file_path");
        }
    });
    let prior = folder.join("world/prior.npy");
    npy(&prior, [10, 24], 4.0);
    let said = trains(folder, "shape", "6", &[]);
    assert!(
        said.contains("depth") && said.contains("left out") && !said.contains("depth priors of the first"),
        "{said}"
    );
    npy(&prior, [24, 24], 0.0);
    let said = trains(folder, "empty", "6", &[]);
    assert!(!said.contains("depth priors of the first frame"), "{said}");
    // Half the size in the same proportions: each pixel takes the nearest.
    npy(&prior, [12, 12], 4.0);
    let said = trains(folder, "half", "6", &[]);
    assert!(said.contains("another size") && said.contains("; 3 depth priors of the first frame"), "{said}");
}

/// Times that no rollout reaches are refused by every command that asks for one, in a sentence.
#[test]
fn times_out_of_reach_are_refused() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    world(folder);
    trains(folder, "run", "6", &["dynamics.ask=step", "bodies.mode=field"]);
    let refused = |args: &[&str]| {
        let error = fails(folder, args);
        assert!(error.contains("as far as motion can be integrated, found"), "{args:?}: {error}");
    };
    for time in ["1e9", "-1e9"] {
        let time = format!("--time={time}");
        refused(&["render", "run", "--cameras", "world", "--out", "images", &time]);
        refused(&["export", "run", "--out", "scene.ply", &time]);
    }
    refused(&["extrapolate", "run", "--to", "1e9"]);
    says(folder, &["export", "run", "--out", "scene.ply", "--time=100"]);
    says(folder, &["view", "run", "--out", "page.html"]);

    // Photos of another recording: cameras for a rendering, and views to be measured.
    fs::create_dir(folder.join("later")).expect("a folder");
    for split in ["train", "val", "test"] {
        let mut json = read_json(&folder.join(format!("world/transforms_{split}.json")));
        for frame in json["frames"].as_array_mut().expect("frames") {
            frame["time"] = json!(1e6 + frame["time"].as_f64().expect("a time"));
            let path = format!("../world/{}", frame["file_path"].as_str().expect("a path").trim_start_matches("./"));
            frame["file_path"] = json!(path);
            frame
                .as_object_mut()
                .expect("a frame")
                .retain(|key, _| !key.starts_with("depth") && !key.starts_with("conf"));
            frame.as_object_mut().expect("a frame").remove("truth");
        }
        json.as_object_mut().expect("an object").retain(|key, _| !["movers", "ply_file_path"].contains(&key.as_str()));
        fs::write(folder.join(format!("later/transforms_{split}.json")), json.to_string()).expect("written");
    }
    refused(&["render", "run", "--cameras", "later", "--out", "images"]);
    refused(&["eval", "run", "--data", "later"]);
    refused(&["extrapolate", "run", "--data", "later", "--to", "1.5"]);
}

/// A recording whose last photo is thousands of frames after the others needs more steps than a rollout has.
#[test]
fn steps_that_are_too_short_for_the_recording_are_refused() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    world(folder);
    edit_frames(folder, |frame| {
        let index = (32.0 * frame["time"].as_f64().expect("a time")).round();
        frame["time"] = json!(if index < 20.0 { 1e-3 * index } else { 5.0 });
    });
    let set: Vec<&str> = KEYS.iter().flat_map(|key| ["--set", *key]).collect();
    let train = |out: &'static str, step: &'static str| {
        [&["train", "world", "--out", out, "--steps", "4", "--set", step][..], &set].concat()
    };
    let error = fails(folder, &train("short", "dynamics.step_frames=0.01"));
    assert!(error.contains("dynamics.step_frames: expected at least 0.16"), "{error}");
    assert!(!folder.join("short/checkpoints").exists());
}
